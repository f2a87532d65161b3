"""A recorded car with default settings: positions withheld, yaw against course, fixes lost.

The drive of the shared data with the noise of its unit's data sheet and of its fixes' own sigmas,
samples stretched as its authors do. Fixes are withheld between whole seconds, or lost for 15 s of
every 45 from 40 s on, as its authors cut them; their own filter is the peer there. Nothing is said
without the recording. ``CAR_CASES`` names some of ``CASES``.
"""

import os
from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.rotations import to_euler, wrap
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Fixes, Flight
from fgnav.types.vehicle import WheeledVehicle
from tests.benchmarks._rows import DATA, Row, row
from tests.recordings import drive

METHODS = {"batch": Batch(), "smoother": Smoother(), "forward": Forward()}
CASES = (
    *(f"{kind}_{method}" for kind in ("withheld", "outages") for method in METHODS),
    *(f"plain_{rate}hz_{method}" for rate in (1, 2, 4) for method in METHODS),
    "plain_own_counter_batch",
)
ASKED = tuple(filter(None, os.environ.get("CAR_CASES", "").split(","))) or CASES
FIRST_S, LAST_S, LENGTH_S, EVERY_S = 40.0, 30.0, 15.0, 45.0  # README of the recording
AUTHORS_N_M = (0.155, 0.253, 0.089)
MOVING_MPS, STRAIGHT_DEGPS = 4.0, 1.0
WINDOW_S = 60.0
SURE_DEG = 5.0
ROUNDING_M = 0.011 / np.sqrt(12)  # of the recording's coordinates


def thinned(flight: Flight, rate_hz: int) -> BoolArray:
    """Return which fixes a receiver of a rate would have given, as a mask (n,)."""
    per = np.round(flight.fixes[0].t_s * 4).astype(int)
    return per % (4 // rate_hz) == 0


def lost(fixes: Fixes) -> BoolArray:
    """Return which fixes lie within outages, as a mask (n,)."""
    since_s = fixes.t_s - FIRST_S
    before_end = fixes.t_s < fixes.t_s[-1] - LAST_S
    return (since_s >= 0) & (since_s % EVERY_S < LENGTH_S) & before_end


@dataclass(frozen=True, eq=False)
class Off:
    """An estimate's position errors at fixes it has not seen, (m, 3), and what it states."""

    e_n_m: FloatArray
    sigma2_m2: FloatArray

    @classmethod
    def of(cls, estimate: Estimate, fixes: Fixes, rows: BoolArray) -> "Off":
        """Return the errors at rows, whose antenna is the body's origin."""
        at = np.searchsorted(estimate.t_s, fixes.t_s[rows] - 1e-6)
        right = at < len(estimate.t_s)
        at, seen = at[right], np.flatnonzero(rows)[right]
        same = np.abs(estimate.t_s[at] - fixes.t_s[seen]) < 1e-6
        at, seen = at[same], seen[same]
        noise = np.maximum(fixes.position_sigma_m[seen], ROUNDING_M) ** 2
        return cls(
            e_n_m=estimate.p_n_m[at] - fixes.p_n_m[seen],
            sigma2_m2=estimate.position_covariance_m2[at] + noise[:, :, None] * np.eye(3),
        )

    @property
    def rms_n_m(self) -> FloatArray:
        """Root mean squares north, east and down."""
        return np.asarray(np.sqrt((self.e_n_m**2).mean(axis=0)))

    @property
    def nees(self) -> float:
        """Normalised errors squared, mean of all: 3 where sigmas are right."""
        solved = np.linalg.solve(self.sigma2_m2, self.e_n_m[..., None])[..., 0]
        return float((self.e_n_m * solved).sum(axis=1).mean())


def yaw_less_course(estimate: Estimate, fixes: Fixes) -> str:
    """Return in words how far yaw is from course on straight roads, and by windows of a minute.

    Most: the mean of a window over the sigma that the estimate states there.
    """
    course = np.unwrap(np.arctan2(fixes.v_n_mps[:, 1], fixes.v_n_mps[:, 0]))
    speed = np.hypot(fixes.v_n_mps[:, 0], fixes.v_n_mps[:, 1])
    turning_degps = np.degrees(np.abs(np.gradient(course, fixes.t_s)))
    wide = np.convolve(turning_degps, np.ones(9) / 9, mode="same")
    fair = (speed > MOVING_MPS) & (wide < STRAIGHT_DEGPS)
    at = np.searchsorted(estimate.t_s, fixes.t_s - 1e-6)
    fair &= at < len(estimate.t_s)
    fair[fair] = np.abs(estimate.t_s[at[fair]] - fixes.t_s[fair]) < 1e-6
    at, t_s = at[fair], fixes.t_s[fair]
    off = np.degrees(wrap(to_euler(estimate.R_nb[at])[:, 2] - course[fair]))
    sigma = estimate.sigma_deg[at, 2]
    window = (t_s // WINDOW_S).astype(int)
    means = [off[window == w].mean() for w in np.unique(window)]
    most = [abs(off[window == w].mean()) / sigma[window == w].mean() for w in np.unique(window)]
    return (
        f"yaw less course {off.mean():+.2f} SD {off.std():.2f} deg, stated {np.median(sigma):.2f}; "
        f"by minute {' '.join(f'{m:+.1f}' for m in means)}, at most {max(most):.1f} sigma"
    )


def constants(estimate: Estimate) -> str:
    """Return the flight's constants in words."""
    return "; ".join(
        f"{one.name} {', '.join(f'{x:.4g}' for x in np.atleast_1d(one.value))} "
        f"+- {', '.join(f'{x:.2g}' for x in np.sqrt(np.diag(np.atleast_2d(one.covariance))))}"
        for one in estimate.constants
    )


def flight_of(case: str) -> tuple[Flight, BoolArray]:
    """Return the whole drive, and which of its fixes a case is given, as a mask (n,)."""
    whole = drive(DATA, stretched="own_counter" not in case)
    if case.startswith("withheld"):
        return whole, thinned(whole, 1)
    if case.startswith("outages"):
        return whole, ~lost(whole.fixes[0])
    rate_hz = int(case.split("_")[1].removesuffix("hz")) if "hz" in case else 4
    return whole, thinned(whole, rate_hz)


def solved(case: str, whole: Flight, rows: BoolArray) -> Estimate:
    """Return the estimate of a case from the given rows of the whole drive's fixes."""
    flight = replace(whole, fixes=(whole.fixes[0][rows],))
    name = case.rsplit("_", 1)[1]
    method = METHODS[name]
    if case.startswith("outages") and name != "batch":
        flight = replace(flight, vehicle=WheeledVehicle())
    if case.startswith("plain"):
        return method(flight)
    t_s, imu_s, given_s = whole.fixes[0].t_s, whole.imu.t_s, flight.fixes[0].t_s
    first_s = given_s[given_s > imu_s[0]][0]  # no keyframe is before it
    return method.at(flight, t_s[(t_s >= first_s) & (t_s < imu_s[-1])])


def _row(case: str) -> Row:
    whole, rows = flight_of(case)
    estimate = solved(case, whole, rows)
    answered = float((estimate.sigma_deg[:, 2] < SURE_DEG).sum() / estimate.n_epochs)
    course = yaw_less_course(estimate, whole.fixes[0])
    note = f"yaw known to {SURE_DEG:.0f} deg {answered:.3f}; {course}"
    note += f"; {constants(estimate)}; {' | '.join(estimate.notes)}"
    ours, peer = answered, 0.99
    if not case.startswith("plain"):
        off = Off.of(estimate, whole.fixes[0], ~rows)
        size = np.linalg.norm(off.e_n_m, axis=1).max()
        north, east, down = off.rms_n_m
        note = (
            f"{north:.4f} {east:.4f} {down:.4f} m, {size:.2f} at most, NEES {off.nees:.1f}; {note}"
        )
        ours, peer = float(np.linalg.norm(off.rms_n_m)), float(np.linalg.norm(AUTHORS_N_M))
    less = not case.startswith("plain")
    return row(f"car_{case}", ours, peer, "m" if less else "", note, less=less)


NAMES = tuple(f"car_{case}" for case in CASES)


def run() -> list[Row]:
    """Return a row for each case."""
    return [_row(case) for case in ASKED] if DATA.is_dir() else []
