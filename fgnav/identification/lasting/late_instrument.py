"""An instrument that is late: what it measured at t is of the body a time d before.

There the body's attitude and place are

    R(t - d) = R(t) C(t, d)        C = Q(t)' Q(t - d)        p(t - d) = p(t) - d v(t)

with Q the rotation since the first sample that the unit's rates w lead to: the gyroscope's, else
those of the states. By d they change by ``-w(t - d)`` and ``-v``. d is a constant of the
instrument's measurements, sought by steps, each about the C of the steps before: of all of them,
or of those after their longest interval, or their shortest, where a clock may have been set.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.frontend.calibration_request import calibration_requests, of_time
from fgnav.frontend.gaps import GAP
from fgnav.geometry.rotations import exp, transpose
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.measurement_factor import of_measurement, parts_of
from fgnav.graph.types.constants import FlightConstant, flight_constant
from fgnav.graph.types.measurement import Linearised, Measurement, OfAnother
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import AUX, POSITION, RATE, ROTATION, VELOCITY, States
from fgnav.identification.exclusion import FIELD_OF
from fgnav.identification.lasting.error import LastingError, least_of_use
from fgnav.identification.likelihood.changed_samples import minimum_below, step_promises
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.track.integrals import rotated, sampled
from fgnav.identification.track.windows import EXCLUDED
from fgnav.optional_gtsam import gtsam
from fgnav.types.flight import Flight

_LATE = "late "
KINDS = tuple(_LATE + name for name in FIELD_OF)
_STEPS = 8  # at most, as of a clock
_FEWEST = 3  # samples with a usual interval


def late_instruments(
    problem: SmoothingProblem, stated: Solution, flight: Flight
) -> Iterator[LastingError]:
    """Yield by how much each instrument is late, if a step from the stated says so.

    As little known before as velocities' delay, or as it is large; early where it is negative.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    flight : Flight
        Whose tags tell when a clock may have been set.
    """
    spans = [
        (one.name, from_s, t_s)
        for one in problem.measurements
        if one.name in FIELD_OF
        for t_s in [getattr(flight, FIELD_OF[one.name]).t_s]
        for from_s in _beginnings_s(t_s)
    ]
    if not isinstance(problem.motion, GyroFree | Inertial):
        return
    (delay,) = of_time(calibration_requests(["velocity-delay"])[0])
    sigma_s = float(np.sqrt(delay.covariance[0, 0]))
    for name, from_s, t_s in spans:
        error = _sought(name, from_s, sigma_s, problem, stated)
        if error is not None and abs(error.off[0]) > sigma_s:
            error = _sought(name, from_s, float(abs(error.off[0])), problem, stated)
        if error is not None and (np.diff(_retagged(t_s, error)) > 0).all():
            yield error


def put_right(flight: Flight, error: LastingError) -> Flight:
    """Return a flight whose instrument's tags are as much earlier as it is late."""
    field = FIELD_OF[error.kind.removeprefix(_LATE)]
    one = getattr(flight, field)
    if one is None:
        return flight
    return replace(flight, **{field: replace(one, t_s=_retagged(one.t_s, error))})


def sentence(error: LastingError) -> str:
    """Return what is to be said of it."""
    what = FIELD_OF[error.kind.removeprefix(_LATE)]
    when = "" if error.from_s == -np.inf else f" from {error.from_s:.1f} s on"
    return (
        f"The {what}'s samples are late by {error.off[0]:+.4f} ± "
        f"{np.sqrt(error.covariance[0, 0]):.4f} s{when}: taken off their tags."
    )


def _retagged(t_s: FloatArray, error: LastingError) -> FloatArray:
    """Return tags, (k,), without what they are late."""
    return np.asarray(t_s - error.off[0] * (t_s >= error.from_s))


def _beginnings_s(t_s: FloatArray) -> tuple[float, ...]:
    """Return from when samples at (k,) may be late: always, or after an unusual interval."""
    if len(t_s) < _FEWEST:
        return (-np.inf,)
    of_usual = np.diff(t_s) / np.median(np.diff(t_s))
    longest, shortest = int(of_usual.argmax()), int(of_usual.argmin())
    unusual = [k for k in (longest, shortest) if not 1 / GAP <= of_usual[k] <= GAP]
    return (-np.inf, *(float(t_s[k : k + 2].mean()) for k in unusual))


@dataclass(frozen=True, eq=False, slots=True)
class _Turning:
    """Rates, (m, 3), at times, and the rotation since the first that they lead to, (m, 3, 3)."""

    t_s: FloatArray
    w_b_radps: FloatArray
    R: FloatArray

    @classmethod
    def of(cls, problem: SmoothingProblem, at: States) -> "_Turning":
        motion = cast("GyroFree | Inertial", problem.motion)
        t_s, w_b_radps = problem.t_s, at.aux[:, RATE.start - AUX : RATE.stop - AUX]
        if motion.imu.w_b_radps is not None:
            t_s, w_b_radps = motion.imu.t_s, motion.imu.w_b_radps
        return cls(t_s, w_b_radps, rotated(t_s, w_b_radps))

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return rates and rotations at other times, (k, 3) and (k, 3, 3)."""
        before = np.searchsorted(self.t_s, t_s).clip(1, len(self.t_s) - 1) - 1
        w_b_radps = sampled(self.t_s, self.w_b_radps, t_s)
        between = (self.w_b_radps[before] + w_b_radps) / 2
        since_s = np.clip(t_s, self.t_s[0], self.t_s[-1]) - self.t_s[before]
        return w_b_radps, self.R[before] @ exp(between * since_s[:, None])


def _sought(
    name: str, from_s: float, sigma_s: float, problem: SmoothingProblem, stated: Solution
) -> LastingError | None:
    """Return by how much one is late from a time on; None if no step says so, or none ends."""
    part = flight_constant(_LATE + name, ("delay",), "s", sigma_s, reported=False)
    begin, column, by_s = stated.states, problem.constants.width, 0.0
    error, cost = None, stated.cost
    for left in range(_STEPS, 0, -1):
        free = _freed((name, from_s), part, problem, _Turning.of(problem, begin), by_s)
        at = begin._replace(constants=np.append(begin.constants[:column], by_s))
        if error is None and step_promises(free, at, column)[0] < EXCLUDED - LIKELY:
            return None
        solution = minimum_below(free, least_of_use(problem, cost, left), at)
        if solution is None:
            return error
        cost = solution.cost
        error = LastingError.of(part, free, stated.cost, solution)._replace(from_s=from_s)
        step_s, by_s, begin = error.off[0] - by_s, float(error.off[0]), solution.states
        if step_s**2 < error.covariance[0, 0]:
            return error
    return error


def _freed(
    which: tuple[str, float],
    part: FlightConstant,
    problem: SmoothingProblem,
    turning: _Turning,
    by_s: float,
) -> SmoothingProblem:
    """Return a problem in which an instrument's delay is free, about the turns of one."""
    name, from_s = which
    free, column = problem.with_constants((part,)), problem.constants.width

    def late(one: Measurement) -> Measurement:
        if one.name != name:
            return one
        t_s = problem.t_s[one.row]
        is_late = t_s >= from_s
        w_b_radps, R = turning.at(t_s - by_s * is_late)
        back = transpose(turning.at(t_s)[1]) @ R
        return Late(
            measurement=one,
            back=back,
            w_b_radps=w_b_radps,
            is_late=is_late,
            by_s=by_s,
            column=column,
            constants=free.constants,
        )

    return replace(free, measurements=tuple(map(late, free.measurements)))


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Late(OfAnother):
    """Measurements of the body a constant time before their keyframes.

    Attributes
    ----------
    measurement : Measurement
    back : ndarray, shape (k, 3, 3)
        C, from the body's axes a time ``by_s`` before to those of the keyframe.
    w_b_radps : ndarray, shape (k, 3)
        There.
    is_late : ndarray of bool, shape (k,)
        False where they are of their keyframe.
    by_s : float
    column : int
        Of the constant d, s.
    constants : Constants
    """

    back: FloatArray
    w_b_radps: FloatArray
    is_late: BoolArray
    by_s: float
    column: int

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of some, (j,), see ``Measurement``."""
        late, d_s = self.is_late[which, None], at.constants[self.column]
        w_b_radps, v_n_mps = late * self.w_b_radps[which], late * at.v_n_mps
        C = self.back[which] @ exp((self.by_s - d_s) * w_b_radps)
        R_nb = np.ascontiguousarray(at.R_nb @ C)
        then = at._replace(R_nb=R_nb, p_n_m=at.p_n_m - d_s * v_n_mps)
        value, state, shared = self.measurement.linearise(then, which)
        state, shared = state.copy(), shared.copy()
        by_turn, by_place_n = state[:, :, ROTATION], state[:, :, POSITION] @ transpose(R_nb)
        shared[:, :, self.column] -= np.einsum("kij,kj->ki", by_turn, w_b_radps)
        shared[:, :, self.column] -= np.einsum("kij,kj->ki", by_place_n, v_n_mps)
        state[:, :, ROTATION] = by_turn @ transpose(C)
        state[:, :, POSITION] = by_place_n @ at.R_nb
        state[:, :, VELOCITY] -= d_s * late[:, :, None] * by_place_n
        return Linearised(value, state, shared)

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return measurement i as a factor of keyframe ``key``."""
        parts = parts_of(self.constants, self.constants.first)
        rows = int(self.freedom[i])
        return of_measurement(self, i, key, ("pose", "velocity"), parts, rows=rows)
