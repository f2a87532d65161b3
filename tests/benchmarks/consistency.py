"""Whether the smoother's covariance can be believed: many flights, errors over stated sigmas.

``python -m tests.benchmarks consistency`` flies ``FLIGHTS`` of each case (the environment variable
``FGNAV_FLIGHTS``). Codes err by what messages and atmosphere models state, drawn per satellite and
flight, which the simulator by itself does not do: without that positions are better than stated.
"""

import os
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import msgspec
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import chdtri, erf

from fgnav import rotations
from fgnav.checks import FloatArray
from fgnav.estimate import Estimate
from fgnav.evaluation.bound import attitude_bound
from fgnav.flight import Flight
from fgnav.integers.resolve import resolve
from fgnav.integers.truth import Truth, attitude_at
from fgnav.methods.smoother import Batch
from fgnav_sim.message_errors import with_message_errors
from fgnav_sim.motion import Hold, Ramp, Rate, Sine
from fgnav_sim.scenario import FixesTable, Scenario, load_scenario
from fgnav_sim.simulate import simulate

SCENARIOS = Path(__file__).resolve().parents[2] / "sim" / "scenarios"
FLIGHTS = int(os.environ.get("FGNAV_FLIGHTS", "10"))
RIGHT = Truth()
DRAWN_DENSITY = 1e-4  # (rad/s2)2/Hz: in 20 s an angle walks by half a radian
SHARES = erf(np.array([1, 2, 3]) / np.sqrt(2))
STATES = ("attitude", "position", "velocity")


@dataclass(frozen=True, eq=False)
class Drawn:
    """One Euler angle of a drawn motion, as a command of the simulator."""

    angle: CubicSpline

    def __call__(self, t_s: FloatArray) -> FloatArray:
        return np.stack([self.angle(t_s, order) for order in range(3)])


def turned(scenario: Scenario, command: object) -> Scenario:
    """Return the scenario with one command for all three angles."""
    motion = msgspec.structs.replace(scenario.motion, roll=command, pitch=command, yaw=command)
    return msgspec.structs.replace(scenario, motion=motion)


def drawn(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """Return the scenario with body rates that are a random walk, as the smoother takes them."""
    step_s = 0.01
    t_s = step_s * np.arange(round(scenario.duration_s / step_s) + 2)
    while True:
        white = np.sqrt(DRAWN_DENSITY * step_s) * rng.standard_normal((len(t_s), 3))
        R = [np.eye(3)]
        for turn in rotations.exp(np.cumsum(white, axis=0) * step_s)[:-1]:
            R.append(R[-1] @ turn)
        euler = np.unwrap(rotations.to_euler(np.array(R)), axis=0)
        if np.abs(euler[:, 1]).max() < np.radians(75):
            break
    roll, pitch, yaw = (Drawn(CubicSpline(t_s, column)) for column in euler.T)
    motion = msgspec.structs.replace(scenario.motion, roll=roll, pitch=pitch, yaw=yaw)
    return msgspec.structs.replace(scenario, motion=motion)


def cases() -> dict[str, Scenario]:
    """Return the scenarios by name."""
    change = msgspec.structs.replace
    six, spin = (load_scenario(SCENARIOS / f"{name}.toml") for name in ("six", "spin"))
    sine = {a: turned(six, Sine(amplitude_deg=a)) for a in (5.0, 20.0, 45.0)}
    gyroscope = change(
        six.imu,
        gyroscope_noise_radps_per_sqrt_hz=1e-4,
        gyroscope_bias_radps=2e-3,
        gyroscope_bias_walk_radps_per_sqrt_s=1e-6,
    )
    return {
        "a5": sine[5.0],
        "a20": sine[20.0],
        "a45": sine[45.0],
        "ramp45": turned(six, Ramp(amplitude_deg=45.0)),
        "spin2hz": change(spin, motion=change(spin.motion, roll=Rate(rate_degps=720.0))),
        "gnss1hz": change(sine[20.0], gnss=change(six.gnss, rate_hz=1.0)),
        "gyro": change(sine[20.0], imu=gyroscope),
        "sight": load_scenario(SCENARIOS / "terminal.toml"),
        "no_phase": change(sine[20.0], gnss=None, fixes=FixesTable(rate_hz=10.0)),
        "drawn": change(turned(six, Hold()), duration_s=20.0),
    }


NAMES = (
    *(f"rmse_over_sigma_{case}" for case in cases()),
    *(f"anees_{state}_{case}" for case in cases() for state in STATES),
    *(f"rmse_{case}_{angle}" for case in cases() for angle in ("roll", "pitch", "yaw")),
)


def flown(scenario: Scenario, name: str, seed: int) -> Flight:
    """Return one flight of a case."""
    rng = np.random.default_rng(seed)
    flight = simulate(drawn(scenario, rng) if name == "drawn" else scenario, rng)
    return flight if flight.observations is None else with_message_errors(flight, rng)


@dataclass(frozen=True, eq=False)
class Flown:
    """Errors and covariances of one flight, (n, 3) and (n, 3, 3) by state; its bound, degrees."""

    converged: bool
    errors: dict[str, FloatArray]
    covariances: dict[str, FloatArray]
    euler_deg: FloatArray
    bound_deg: FloatArray


def judged(flight: Flight, estimate: Estimate) -> Flown:
    """Return the errors of an estimate with the covariances it states."""
    truth = flight.truth
    R_nb, covered = attitude_at(truth, estimate.t_s)
    assert covered.all()
    place, speed = (CubicSpline(truth.t_s, x)(estimate.t_s) for x in (truth.p_n_m, truth.v_n_mps))
    bound = np.full(3, np.nan)
    if flight.observations is not None:
        found = attitude_bound(
            *resolve(flight, RIGHT), attitude_at(truth, flight.observations.t_s)[0]
        )
        bound = np.array([found.roll, found.pitch, found.yaw], dtype=float)
    euler = rotations.to_euler(estimate.R_nb) - rotations.to_euler(R_nb)
    return Flown(
        converged=estimate.converged,
        errors={
            "attitude": rotations.log(rotations.transpose(estimate.R_nb) @ R_nb),
            "position": estimate.p_n_m - place,
            "velocity": estimate.v_n_mps - speed,
        },
        covariances={
            "attitude": estimate.attitude_covariance_rad2,
            "position": estimate.position_covariance_m2,
            "velocity": estimate.velocity_covariance_m2ps2,
        },
        euler_deg=np.degrees(rotations.wrap(euler)),
        bound_deg=bound,
    )


def anees(errors: FloatArray, covariances: FloatArray) -> tuple[FloatArray, float]:
    """Return the mean NEES of flights at each epoch, (n,), and the share inside its 95 % band.

    Parameters
    ----------
    errors, covariances : ndarray, shape (flights, n, 3) and (flights, n, 3, 3)
    """
    squares = np.einsum(
        "fni,fni->fn", errors, np.linalg.solve(covariances, errors[..., None])[..., 0]
    )
    mean, freedom = squares.mean(axis=0), 3 * len(errors)
    low, high = chdtri(freedom, 0.975) / len(errors), chdtri(freedom, 0.025) / len(errors)
    return mean, float(((mean > low) & (mean < high)).mean())


def rows_of(name: str, flights: list[Flown]) -> list[dict[str, object]]:
    """Return the figures of one case."""
    rows: list[dict[str, object]] = []
    ratios, notes = [], []
    for state in STATES:
        errors = np.array([f.errors[state] for f in flights])
        covariances = np.array([f.covariances[state] for f in flights])
        mean, inside = anees(errors, covariances)
        sigma = np.sqrt(np.einsum("fnii->fni", covariances))
        ratios.append(float(np.sqrt((errors**2).mean()) / np.sqrt((sigma**2).mean())))
        within = [100 * float((np.abs(errors) < k * sigma).mean()) for k in (1, 2, 3)]
        shares = ", ".join(f"{w:.1f}" for w in within)
        notes.append(f"{state} {ratios[-1]:.2f}")
        rows.append(
            _row(
                f"anees_{state}_{name}",
                float(mean.mean()),
                3.0,
                "chi2",
                f"{100 * inside:.0f} % of epochs in the 95 % band; within 1, 2, 3 sigma: {shares} "
                f"%, expected {', '.join(f'{100 * s:.1f}' for s in SHARES)}",
            )
        )
    converged = sum(f.converged for f in flights)
    note = f"{len(flights)} flights, {converged} converged; RMSE over RMS sigma: {', '.join(notes)}"
    rows.append(_row(f"rmse_over_sigma_{name}", ratios[0], 1.0, "", note))
    rmse_deg = np.sqrt(np.mean([(f.euler_deg**2).mean(axis=0) for f in flights], axis=0))
    bound_deg = np.sqrt(np.mean([f.bound_deg**2 for f in flights], axis=0))
    for angle, ours, bound in zip(("roll", "pitch", "yaw"), rmse_deg, bound_deg, strict=True):
        peer = float(bound) if np.isfinite(bound) else None
        note = "peer: bound of one epoch's phase"
        rows.append(_row(f"rmse_{name}_{angle}", float(ours), peer, "deg", note))
    return rows


def run() -> list[dict[str, object]]:
    """Fly all cases."""
    method = Batch(resolver=RIGHT)
    rows: list[dict[str, object]] = []
    for name, scenario in cases().items():
        fly = partial(flown, scenario, name)
        flights = [judged(flight, method(flight)) for flight in map(fly, range(FLIGHTS))]
        rows += rows_of(name, flights)
    return rows


def _row(name: str, ours: float, peer: float | None, unit: str, note: str) -> dict[str, object]:
    ratio = None if peer is None else (peer / ours if unit == "deg" else ours / peer)
    return {"name": name, "ours": ours, "peer": peer, "ratio": ratio, "unit": unit, "note": note}
