"""Whether the smoother's covariance can be believed: many flights, errors over stated sigmas.

``python -m tests.benchmarks consistency`` flies ``FLIGHTS`` of each case (the environment variable
``CONSISTENCY_FLIGHTS``) in two processes, with seeds from ``CONSISTENCY_SEED`` on: none that has
chosen a constant of the library may judge it, so the default begins at 20000. Methods other than
the batch: ``CONSISTENCY_METHOD``; some of the cases: ``CONSISTENCY_CASES``. Codes err by what
messages and atmosphere models state, drawn per satellite and flight: without that positions are
better than stated. Where there is no phase, gravity directions good to three degrees tell roll and
pitch, and with motion heading.
"""

import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial, reduce

import msgspec
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline
from scipy.special import chdtri, erf

from fgnav.assembly.prepared import PreparedFlight
from fgnav.checks import FloatArray
from fgnav.evaluation.bound import attitude_bound
from fgnav.evaluation.posterior_bound import posterior_bound
from fgnav.geometry import rotations
from fgnav.integers.resolvers.resolve import resolve
from fgnav.integers.resolvers.truth import Truth, attitude_at
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.process import matern
from fgnav.process.evidence import rate_prior
from fgnav.process.hyperparameters import RatePrior
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight
from fgnav_sim.motion import Hold, Ramp, Rate, Sine
from fgnav_sim.propagation.message_errors import with_message_errors
from fgnav_sim.scenario import FixesTable, Scenario, load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import Row, row
from tests.methods.true_gravity import TrueGravity

FLIGHTS = int(os.environ.get("CONSISTENCY_FLIGHTS", "10"))
SEED = int(os.environ.get("CONSISTENCY_SEED", "20000"))
PROCESSES = int(os.environ.get("CONSISTENCY_PROCESSES", "2"))
RIGHT = Truth()
METHODS: dict[str, Smoother] = {
    "batch": Batch(resolver=RIGHT),
    "smoother": Smoother(resolver=RIGHT),
    "forward": Forward(resolver=RIGHT),
}
METHOD = METHODS[os.environ.get("CONSISTENCY_METHOD", "batch")]
ANGLES = ("roll", "pitch", "yaw")
# Of drawn motions: in 20 s an angle walks by half a radian.
DRAWN_PRIOR = RatePrior(length_s=0.5, variance_rad2ps2=np.full(3, 0.1**2), evidence=float("nan"))
SHARES = erf(np.array([1, 2, 3]) / np.sqrt(2))
STATES = ("attitude", "position", "velocity", "bias")
FLOWN = ("coast", "tumble", "glider", "rocket")  # scenarios by forces: throws, thrust, gusts
END_S = 0.5  # of a flight's first and last epochs
QUIET = 1e-12  # of a noise, in its own unit: none
TRUTH_RAD = 1e-4  # 1-sigma of true attitudes: between their samples they are interpolated


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
    """Return the scenario with body rates drawn from ``DRAWN_PRIOR``, about a mean of zero."""
    step_s = 0.01
    t_s = step_s * np.arange(round(scenario.duration_s / step_s) + 2)
    while True:
        R = [np.eye(3)]
        for turn in rotations.exp(drawn_turns(len(t_s) - 1, step_s, DRAWN_PRIOR, rng)):
            R.append(R[-1] @ turn)
        euler = np.unwrap(rotations.to_euler(np.array(R)), axis=0)
        if np.abs(euler[:, 1]).max() < np.radians(75):
            break
    roll, pitch, yaw = (Drawn(CubicSpline(t_s, column)) for column in euler.T)
    motion = msgspec.structs.replace(scenario.motion, roll=roll, pitch=pitch, yaw=yaw)
    return msgspec.structs.replace(scenario, motion=motion)


def drawn_turns(
    count: int, step_s: float, prior: RatePrior, rng: np.random.Generator
) -> FloatArray:
    """Return the integrals of a body rate over steps, (count, 3), rad, drawn from its prior.

    Steps are so short that axes do not mix in one.
    """
    poles = prior.poles_per_s[0]
    F, H = matern.transition(step_s, poles), matern.integral(step_s, poles)
    root = matern.noise_factor(step_s, poles)
    x = np.linalg.cholesky(matern.stationary(poles)) @ rng.standard_normal((3, 3))
    turns = np.empty((count, 3))
    for k in range(count):
        noise = root @ rng.standard_normal((4, 3))
        turns[k], x = H @ x + noise[0], F @ x + noise[1:]
    return np.asarray(turns * np.sqrt(prior.variance_rad2ps2))


def cases() -> dict[str, Scenario]:
    """Return the scenarios by name."""
    change = msgspec.structs.replace
    six, spin = (load_scenario(name) for name in ("six", "spin"))
    sine = {a: turned(six, Sine(amplitude_deg=a)) for a in (5.0, 20.0, 45.0)}
    gyroscope = change(
        six.imu,
        gyroscope_noise_radps_per_sqrt_hz=1e-4,
        gyroscope_bias_radps=2e-3,
        gyroscope_bias_walk_radps_per_sqrt_s=1e-6,
    )
    unlike = change(
        six.motion,
        roll=Sine(amplitude_deg=20.0),
        pitch=Sine(amplitude_deg=20.0, rate_radps=1.7, phase_deg=60.0),
        yaw=Ramp(amplitude_deg=45.0),
    )
    return {
        "a5": sine[5.0],
        "a20": sine[20.0],
        "a45": sine[45.0],
        "unlike": change(six, motion=unlike),
        "ramp45": turned(six, Ramp(amplitude_deg=45.0)),
        "spin2hz": change(spin, motion=change(spin.motion, roll=Rate(rate_degps=720.0))),
        "gnss1hz": change(sine[20.0], gnss=change(six.gnss, rate_hz=1.0)),
        "gyro": change(sine[20.0], imu=gyroscope),
        "sight": load_scenario("approach"),
        "no_phase": change(sine[20.0], gnss=None, fixes=FixesTable(rate_hz=10.0)),
        "between": sine[20.0],
        # Of the model's own motion: its rate prior stated, so that all of the model is as the truth
        # is drawn; and identified from the flight, as it is of all others.
        "drawn": change(turned(six, Hold()), duration_s=20.0),
        "drawn_identified": change(turned(six, Hold()), duration_s=20.0),
        **{name: load_scenario(name) for name in FLOWN},
    }


NAMES = (
    *(f"rmse_over_sigma_{case}" for case in cases()),
    *(f"anees_{state}_{case}" for case in cases() for state in STATES),
    *(f"rmse_{case}_{angle}" for case in cases() for angle in (*ANGLES, "turn")),
)


def scenario_of(name: str, rng: np.random.Generator) -> Scenario:
    """Return the scenario of one flight of a case."""
    scenario = cases()[name]
    return drawn(scenario, rng) if name.startswith("drawn") else scenario


def flown(name: str, seed: int) -> Flight:
    """Return one flight of a case."""
    rng = np.random.default_rng(seed)
    flight = simulate(scenario_of(name, rng), rng)
    return flight if flight.observations is None else with_message_errors(flight, rng)


def true_bias(name: str, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return the times of a flight's inertial samples and their bias, (k,) and (k, 3).

    The gyroscope's where there is one. Told from the same unit with the same random numbers and no
    noise, less the same without a bias.
    """
    change = msgspec.structs.replace
    rng = np.random.default_rng(seed)
    whole = scenario_of(name, rng)
    part, gyroscope = change(whole, gnss=None, fixes=None, photodetector=None), None
    if whole.imu.gyroscope_bias_radps is not None:
        gyroscope = {"gyroscope_noise_radps_per_sqrt_hz": QUIET}
    felt = change(part.imu, accelerometer_noise_mps2_per_sqrt_hz=QUIET, **(gyroscope or {}))
    none = {"accelerometer_bias_mps2": QUIET, "accelerometer_bias_walk_mps2_per_sqrt_s": QUIET}
    if gyroscope:
        none |= {"gyroscope_bias_radps": QUIET, "gyroscope_bias_walk_radps_per_sqrt_s": QUIET}
    with_bias, without = (
        simulate(change(part, imu=imu), np.random.default_rng(seed)).imu
        for imu in (felt, change(felt, **none))
    )
    if gyroscope:
        return with_bias.t_s, with_bias.w_b_radps - without.w_b_radps
    return with_bias.t_s, with_bias.f_b_mps2 - without.f_b_mps2


@dataclass(frozen=True, eq=False)
class Flown:
    """Errors and covariances of one flight, (n, 3) and (n, 3, 3) by state.

    Attributes
    ----------
    bounds_deg : ndarray, shape (2, 3)
        See ``bounds_of``.
    """

    converged: bool
    t_s: FloatArray
    errors: dict[str, FloatArray]
    covariances: dict[str, FloatArray]
    euler_deg: FloatArray
    bounds_deg: FloatArray


def judged(
    flight: Flight,
    estimate: Estimate,
    bias: tuple[FloatArray, FloatArray],
    bounds_deg: FloatArray,
) -> Flown:
    """Return the errors of an estimate with the covariances it states."""
    truth, t_s = flight.truth, estimate.t_s
    # Turned evenly between its samples a tenth of a second apart, a swing of 20 degrees is off by
    # 0.02 degrees in their middle.
    R_nb = RotationSpline(truth.t_s, Rotation.from_matrix(truth.R_nb))(t_s).as_matrix()
    place, speed = (CubicSpline(truth.t_s, x)(t_s) for x in (truth.p_n_m, truth.v_n_mps))
    euler = rotations.to_euler(estimate.R_nb) - rotations.to_euler(R_nb)
    true_bias_b = np.stack([np.interp(t_s, bias[0], column) for column in bias[1].T], axis=1)
    estimated, covariance = (
        estimate.gyroscope_bias_radps,
        estimate.gyroscope_bias_covariance_rad2ps2,
    )
    if estimated is None:
        estimated = estimate.accelerometer_bias_mps2
        covariance = estimate.accelerometer_bias_covariance_m2ps4
    return Flown(
        converged=estimate.converged,
        t_s=t_s,
        errors={
            "attitude": rotations.log(rotations.transpose(estimate.R_nb) @ R_nb),
            "position": estimate.p_n_m - place,
            "velocity": estimate.v_n_mps - speed,
            "bias": estimated - true_bias_b,
        },
        covariances={
            "attitude": estimate.attitude_covariance_rad2,
            "position": estimate.position_covariance_m2,
            "velocity": estimate.velocity_covariance_m2ps2,
            "bias": covariance,
        },
        euler_deg=np.degrees(rotations.wrap(euler)),
        bounds_deg=bounds_deg,
    )


def bounds_of(flight: Flight, prepared: PreparedFlight, prior: RatePrior | None) -> FloatArray:
    """Return the RMS bounds of roll, pitch, yaw, (2, 3), deg: of one epoch's phase, and posterior.

    The posterior bound is that of the prior which the motion was drawn from, else of the one under
    which the true attitudes are most likely; NaN where there is none.
    """
    bounds = np.full((2, 3), np.nan)
    if flight.observations is None:
        return bounds
    at = attitude_at(flight.truth, flight.observations.t_s)[0]
    one = attitude_bound(*resolve(flight, RIGHT), at)
    bounds[0] = np.array([one.roll, one.pitch, one.yaw], dtype=float)
    t_s = prepared.problem.t_s
    if flight.imu.w_b_radps is None:
        prepared = with_prior(prepared, prior or true_rate_prior(flight, t_s))
    jacobian = rotations.euler_jacobian(attitude_at(flight.truth, t_s)[0])
    least_rad2 = posterior_bound(flight, prepared)
    covariance = jacobian @ least_rad2 @ jacobian.swapaxes(1, 2)
    bounds[1] = np.degrees(np.sqrt(np.einsum("nii->ni", covariance).mean(axis=0)))
    return bounds


def true_rate_prior(flight: Flight, t_s: FloatArray) -> RatePrior:
    """Return the rate prior under which the true attitudes at some times, (n,), are most likely."""
    R_nb = attitude_at(flight.truth, t_s)[0]
    return rate_prior(t_s, R_nb, np.tile(TRUTH_RAD**2 * np.eye(3), (len(t_s), 1, 1)))


def with_prior(prepared: PreparedFlight, prior: RatePrior) -> PreparedFlight:
    """Return a flight without a gyroscope whose body rate has another prior."""
    problem, n = prepared.problem, len(prepared.problem.t_s) - 1
    motion = replace(
        problem.motion,
        poles_per_s=np.tile(prior.poles_per_s, (n, 1, 1)),
        variance_rad2ps2=np.tile(prior.variance_rad2ps2, (n, 1)),
    )
    return replace(prepared, problem=replace(problem, motion=motion))


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


def rows_of(name: str, flights: list[Flown]) -> list[Row]:
    """Return the figures of one case, of the epochs that all its flights have."""
    rows = []
    ratios, notes = [], []
    t_s = reduce(np.intersect1d, [f.t_s for f in flights])
    at = [np.searchsorted(f.t_s, t_s) for f in flights]
    ends = (t_s < t_s[0] + END_S) | (t_s > t_s[-1] - END_S)
    for state in STATES:
        errors = np.array([f.errors[state][k] for f, k in zip(flights, at, strict=True)])
        covariances = np.array([f.covariances[state][k] for f, k in zip(flights, at, strict=True)])
        mean, inside = anees(errors, covariances)
        sigma = np.sqrt(np.einsum("fnii->fni", covariances))
        ratios.append(float(np.sqrt((errors**2).mean()) / np.sqrt((sigma**2).mean())))
        within = [100 * float((np.abs(errors) < k * sigma).mean()) for k in (1, 2, 3)]
        shares = ", ".join(f"{w:.1f}" for w in within)
        notes.append(f"{state} {ratios[-1]:.2f}")
        rows.append(
            row(
                f"anees_{state}_{name}",
                mean.mean(),
                3.0,
                "chi2",
                f"{100 * inside:.0f} % of epochs in the 95 % band; first and last half second "
                f"{mean[ends].mean():.2f}; within 1, 2, 3 sigma: {shares} %, expected "
                f"{', '.join(f'{100 * s:.1f}' for s in SHARES)}",
            )
        )
    converged = sum(f.converged for f in flights)
    left = max(len(f.t_s) for f in flights) - len(t_s)
    count = f"{len(flights)} flights, {converged} converged, {left} epochs not of all"
    note = f"{count}; RMSE over RMS sigma: {', '.join(notes)}"
    rows.append(row(f"rmse_over_sigma_{name}", ratios[0], 1.0, "", note))
    rmse_deg = np.sqrt(np.mean([(f.euler_deg**2).mean(axis=0) for f in flights], axis=0))
    bounds = np.sqrt(np.mean([f.bounds_deg**2 for f in flights], axis=0))
    for angle, ours, (one, posterior) in zip(ANGLES, rmse_deg, bounds.T, strict=True):
        note = f"peer: bound of one epoch's phase; posterior bound {posterior:.4f} deg"
        peer = one if np.isfinite(one) else None
        rows.append(row(f"rmse_{name}_{angle}", ours, peer, "deg", note, less=True))
    squares = [(f.errors["attitude"] ** 2).sum(axis=1).mean() for f in flights]
    whole_deg = np.degrees(np.sqrt(np.mean(squares)))
    note = "of the turn from estimate to truth: near the vertical roll and yaw err together"
    rows.append(row(f"rmse_{name}_turn", whole_deg, None, "deg", note))
    return rows


def one(name: str, seed: int) -> Flown:
    """Fly once, and judge what the method makes of it."""
    flight = flown(name, seed)
    gravity = TrueGravity(seed=seed) if name == "no_phase" else None
    stated = DRAWN_PRIOR if name == "drawn" else None
    method = replace(METHOD, gravity=gravity, rate_prior=stated)
    prepared = method.prepare(flight)
    estimate = method.estimate_prepared(flight, prepared)
    drawn_from = DRAWN_PRIOR if name.startswith("drawn") else None
    bounds_deg = bounds_of(flight, prepared, drawn_from)
    if name == "between":
        estimate = method.at(flight, (estimate.t_s[1:] + estimate.t_s[:-1]) / 2)
    return judged(flight, estimate, true_bias(name, seed), bounds_deg)


def run() -> list[Row]:
    """Fly all cases, or those that are asked for."""
    rows = []
    asked = os.environ.get("CONSISTENCY_CASES")
    seeds = range(SEED, SEED + FLIGHTS)
    with ProcessPoolExecutor(PROCESSES) as processes:
        for name in cases():
            if asked is None or name in asked.split(","):
                rows += rows_of(name, list(processes.map(partial(one, name), seeds)))
    return rows
