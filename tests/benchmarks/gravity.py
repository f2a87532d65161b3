"""What a learned gravity direction is worth: alone, and to a smoother without an antenna array.

``GRAVITY_FLIGHTS`` in the environment states how many flights (30).
"""

import os
from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.geometry.rotations import log, to_euler, transpose, wrap
from fgnav.gravity import GravityDirection
from fgnav.methods.smoother import Batch
from fgnav.neural import NeuralFactor
from fgnav.types.flight import Flight
from fgnav_models.runtime.factors import manifest
from fgnav_models.training.gravity.data import angles_deg, rms
from fgnav_models.training.gravity.features import SPAN_S, differenced, windows
from fgnav_models.training.gravity.through import flown
from fgnav_sim.data_sets.gravity_motions import PHASES
from fgnav_sim.data_sets.gravity_world import GravityWorld

NAMES = ("gravity_ablation", "gravity_ablation_pair", "gravity_ablation_accelerometer")
FLIGHTS = int(os.environ.get("GRAVITY_FLIGHTS", "30"))
DURATION_S, SEED = 30.0, 20_077
PAIR_INTERVAL_S = 5.6  # after which errors of the network of the same velocities are new: its card
PAIR_SIGMA_RAD = np.radians(2.1)  # per axis, of the pair's errors in the world of training


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Gravity by specific force in both frames and the nose along the velocity."""

    interval_s: float
    name: str = "physical pair"

    def __call__(self, flight: Flight) -> GravityDirection:
        """Estimate from the fixes' velocities."""
        fixes = flight.fixes[0]
        velocity, acceleration = differenced(fixes.t_s, fixes.v_n_mps)
        f_b, covered = windows(flight.imu, fixes.t_s[1:-1])
        rows = np.flatnonzero(covered)[:: max(1, round(self.interval_s * 2 / SPAN_S))]
        g_n = flight.origin.gravity_n_mps2(fixes.p_n_m)[1:-1]
        down_n = g_n / np.linalg.norm(g_n, axis=1, keepdims=True)
        nose_b = np.tile([1.0, 0.0, 0.0], (len(f_b), 1))
        body = frame(f_b[:, -1], nose_b)
        R_nb = frame(acceleration - g_n, velocity) @ transpose(body)
        g_b = np.einsum("nij,ni->nj", R_nb, down_n)[rows]
        across = np.eye(3) - g_b[:, :, None] * g_b[:, None, :]
        t_s = fixes.t_s[1:-1][rows]
        return GravityDirection(t_s=t_s, g_b=g_b, covariance=PAIR_SIGMA_RAD**2 * across)


def run(count: int = FLIGHTS) -> list[dict[str, object]]:
    """Return a row for each source of gravity, against the batch without one."""
    table = ablation(flights(count, SEED), methods())
    named = dict(zip(NAMES, ("gravity", "physical pair", "gravity-accelerometer"), strict=True))
    note = f"median flight's RMS tilt, {count} flights without phase; peer: no gravity. "
    peer = table["none"].tilt_deg
    return [
        {
            "name": name,
            "ours": table[source].tilt_deg,
            "peer": peer,
            "ratio": peer / table[source].tilt_deg,
            "unit": "deg",
            "note": note + figures_of(table),
        }
        for name, source in named.items()
    ]


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Of one flight: roll, pitch, yaw (n, 3) and tilt (n,), degrees; normalised squares (n,)."""

    euler_deg: FloatArray
    tilt_deg: FloatArray
    nees: FloatArray


@dataclass(frozen=True, kw_only=True)
class Tally:
    """Over the flights that every source has solved: RMS errors, degrees, and NEES, 3 expected."""

    euler_deg: FloatArray
    median_euler_deg: FloatArray
    tilt_deg: float  # of the median flight
    nees: float
    median_nees: float
    failed: int


def flights(count: int, seed: int) -> list[Flight]:
    """Return flights of the world that the networks know, with fixes ten times a second."""
    return flown(GravityWorld(), PHASES, count, DURATION_S, [seed])


def methods() -> dict[str, Batch]:
    """Return the batch by what tells it gravity."""
    networks = ("gravity", "gravity-accelerometer")
    return {
        "none": Batch(),
        "physical pair": Batch(gravity=Pair(interval_s=PAIR_INTERVAL_S)),
    } | {name: Batch(factors=(NeuralFactor(manifest(name)),)) for name in networks}


def ablation(given: list[Flight], by: dict[str, Batch]) -> dict[str, Tally]:
    """Return the batch's errors with each source of gravity, on the same flights."""
    errors = {name: [errors_of(flight, method) for flight in given] for name, method in by.items()}
    solved = [k for k in range(len(given)) if all(of[k] is not None for of in errors.values())]
    return {
        name: tally([of[k] for k in solved], sum(one is None for one in of))
        for name, of in errors.items()
    }


def errors_of(flight: Flight, method: Batch) -> Errors | None:
    """Return the batch's errors on a flight; None where it has no solution."""
    try:
        # The window is linearised where this has the flight, and says the same.
        estimate = method(flight)
    except NoSolutionError:
        return None
    R_nb = flight.truth.R_nb[np.searchsorted(flight.truth.t_s, estimate.t_s - 1e-6)]
    error_rad = log(transpose(estimate.R_nb) @ R_nb)
    information = np.linalg.inv(estimate.attitude_covariance_rad2)
    return Errors(
        euler_deg=np.degrees(wrap(to_euler(estimate.R_nb) - to_euler(R_nb))),
        tilt_deg=angles_deg(estimate.R_nb[:, 2], R_nb[:, 2]),
        nees=np.einsum("ni,nij,nj->n", error_rad, information, error_rad),
    )


def tally(errors: list[Errors], failed: int) -> Tally:
    """Return the figures of some flights."""
    euler2 = np.stack([np.mean(e.euler_deg**2, axis=0) for e in errors])
    return Tally(
        euler_deg=np.sqrt(euler2.mean(axis=0)),
        median_euler_deg=np.sqrt(np.median(euler2, axis=0)),
        tilt_deg=float(np.median([rms(e.tilt_deg) for e in errors])),
        nees=float(np.mean([e.nees.mean() for e in errors])),
        median_nees=float(np.median([e.nees.mean() for e in errors])),
        failed=failed,
    )


def figures_of(table: dict[str, Tally]) -> str:
    """Return a table as a sentence."""
    parts = []
    for name, t in table.items():
        euler = " ".join(f"{x:.2f}" for x in t.euler_deg)
        median = " ".join(f"{x:.2f}" for x in t.median_euler_deg)
        parts.append(
            f"{name}: roll pitch yaw {euler} deg, of the median flight {median}; "
            f"NEES(3) {t.nees:.1f}, median {t.median_nees:.1f}; failed {t.failed}"
        )
    return ". ".join(parts)


def frame(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return axes as columns: the first vector, then across both."""
    x = first / np.linalg.norm(first, axis=1, keepdims=True)
    y = np.cross(first, second)
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=2)
