"""The clock of the inertial unit beside phases of arcs, which take its tags as exact.

Tags that move by ``c = (o, r)`` move the samples between keyframes, which stay where they are
(``changed_samples``). So c is a constant of the whole problem [1]_: its minimum is a Gauss-Newton
step of the likelihood in c, states and ambiguities integrated out.

References
----------
.. [1] Li, Mourikis: Online temporal calibration for camera-IMU systems, International Journal of
   Robotics Research 33, 2014: a clock's offset in the propagation by inertial samples.
"""

from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.frontend.calibration_request import calibration_requests, of_time
from fgnav.geometry.interpolation import interpolate
from fgnav.graph.delayed import CLOCK_OFFSET, Delayed
from fgnav.graph.factors.velocity import Velocity
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.constants import flight_constant
from fgnav.graph.types.measurement import Measurement
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.identification.likelihood.beside_phases import chance_of
from fgnav.identification.likelihood.changed_samples import (
    Change,
    ChangedBy,
    attitude_covariance,
    solved_with_changes,
    with_changed_samples,
)
from fgnav.identification.likelihood.thinned import Some
from fgnav.identification.noise.denoised import denoised
from fgnav.identification.tested_constants import SQUARES_OF_TWO
from fgnav.identification.track.tags import tags_moved_s
from fgnav.solve.chain import constant_step
from fgnav.types.flight import Imu

# Steps of difference quotients, far below what a motion changes in and far above rounding: of a
# clock, s and ppm; of drifts, (m/s2)/s and (rad/s)/s.
_CLOCK_STEPS = np.array([1e-3, 100.0])
_FORCE_STEP, _RATE_STEP = 1e-3, 1e-5
_ANY = 1e3  # 1-sigma of a drift in its steps: next to nothing is known of it


class RecordClock(NamedTuple):
    """Offset, s, and rate, ppm, to be added to the unit's tags, (2,), and their covariance."""

    value: FloatArray
    covariance: FloatArray
    cost: float

    @property
    def sigma(self) -> FloatArray:
        """Of both, (2,)."""
        return np.sqrt(self.covariance.diagonal())

    @property
    def squares(self) -> float:
        """Chi-square of two: whether the clock is off."""
        return float(self.value @ np.linalg.solve(self.covariance, self.value))


def record_clock(
    problem: SmoothingProblem, middle_s: float, moved: FloatArray, enough: float = np.inf
) -> RecordClock | None:
    """Return the clock by a whole problem at its tags; None where it has no minimum, or no unit.

    Parameters
    ----------
    problem : SmoothingProblem
        Without a clock among its constants.
    middle_s : float
        For which the offset is stated.
    moved : ndarray, shape (2,)
        By what tags have been moved already.
    enough : float
        Cost above which a minimum is none.
    """
    if problem.constants.column(CLOCK_OFFSET) >= 0:
        return None
    solution = solved_with_changes(problem, tags(middle_s, moved), enough)
    if solution is None:
        return None
    first = problem.constants.width
    return RecordClock(
        value=solution.states.constants[first:],
        covariance=solution.constant_covariance[0, first:, first:],
        cost=solution.cost,
    )


def clock_step(
    problem: SmoothingProblem, at: Solution, middle_s: float, moved: FloatArray
) -> RecordClock | None:
    """Return one step of the clock from a problem's minimum, its cost; None without unit or step.

    Taken again at tags so moved it leads to the clock from seconds off, where a minimum of states
    and clock at once has none (variable projection: Golub, Pereyra, SIAM Journal on Numerical
    Analysis 10, 1973). Parameters as in ``record_clock``.
    """
    has_unit = isinstance(problem.motion, GyroFree | Inertial)
    if not has_unit or problem.constants.column(CLOCK_OFFSET) >= 0:
        return None
    first, by = problem.constants.width, tags(middle_s, moved)
    start = np.concatenate([at.states.constants, *(part.start for part in by.parts)])
    begin = at.states._replace(constants=start)
    try:
        step, covariance = constant_step(with_changed_samples(problem, by), begin)
    except NoSolutionError:
        return None
    return RecordClock(step[first:], covariance[first:, first:], at.cost)


def with_tags(problem: SmoothingProblem, t_s: FloatArray) -> SmoothingProblem:
    """Return a problem whose unit has other tags, (m,): its motion, and rates that turn an arm."""
    motion = cast("Inertial | GyroFree", problem.motion)
    imu = replace(motion.imu, t_s=t_s)
    moved = replace(problem, motion=cast("Motion", replace(motion, imu=imu)))
    quiet = denoised(motion.imu)
    if quiet.w_b_radps is None:
        return moved
    before, after = (interpolate(problem.t_s, at, quiet.w_b_radps) for at in (motion.imu.t_s, t_s))
    more = after - before
    return replace(
        moved, measurements=tuple(_turning(one, more[one.row]) for one in problem.measurements)
    )


def _turning(one: Measurement, more_b_radps: FloatArray) -> Measurement:
    """Return a measurement with as much more in the rates that it was made with, (k, 3)."""
    if isinstance(one, Some):
        of_all = np.zeros((len(one.measurement.row), 3))
        of_all[one.which] = more_b_radps
        return replace(one, measurement=_turning(one.measurement, of_all))
    if isinstance(one, Delayed):
        return replace(one, measurement=_turning(one.measurement, more_b_radps))
    if isinstance(one, Velocity) and one.measured_b_radps is not None:
        return replace(one, measured_b_radps=one.measured_b_radps + more_b_radps)
    return one


def doubted_attitudes(
    problem: SmoothingProblem, middle_s: float, moved: FloatArray
) -> FloatArray | None:
    """Return what attitudes' covariance is besides, (n, 3, 3), rad2, where tags are put right.

    None without a minimum.
    Parameters as in ``record_clock``.
    """
    solution = solved_with_changes(problem, tags(middle_s, moved))
    if solution is None:
        return None
    return attitude_covariance(solution, problem.constants.width)


def prior_squares(moved: FloatArray) -> float:
    """Return how unlikely tags moved so far, (2,), are beforehand, as a cost."""
    (clock,) = calibration_requests(["clock"])
    parts = of_time(replace(clock, moved=(float(moved[0]), float(moved[1]))))
    return float(sum(x**2 / p.covariance[0, 0] for x, p in zip(moved, parts, strict=True)))


def clock_off(problem: SmoothingProblem, middle_s: float, moved: FloatArray) -> RecordClock | None:
    """Return the clock where it is off, and explains what contradicts it; else None.

    Another fault that stays, such as biases that drift, looks like a clock where nothing else is
    free: it is to leave nothing, and to be likelier than steady drifts. Parameters as in
    ``record_clock``.
    """
    clock = record_clock(problem, middle_s, moved, chance_of(problem))
    if clock is None or clock.squares <= SQUARES_OF_TWO:
        return None
    drifts = with_drifts(problem, clock.cost)
    return clock if drifts is None or clock.cost < drifts.cost else None


def tags(middle_s: float, moved: FloatArray) -> ChangedBy:
    """Return a clock's constants, and what steps of them do to a unit."""

    def tags_by(by: FloatArray) -> Change:
        return lambda imu: replace(imu, t_s=tags_moved_s(imu, by, middle_s))

    (clock,) = calibration_requests(["clock"])
    clock = replace(clock, moved=(float(moved[0]), float(moved[1])))
    return ChangedBy(of_time(clock), tuple(map(tags_by, np.diag(_CLOCK_STEPS))), _CLOCK_STEPS)


def with_drifts(problem: SmoothingProblem, enough: float = np.inf) -> Solution | None:
    """Return a whole problem's minimum with biases that drift steadily; None without one.

    Or without one of at most a cost, ``enough``.
    """
    motion = problem.motion
    if not isinstance(motion, GyroFree | Inertial):
        return None
    fields = {"f_b_mps2": _FORCE_STEP}
    if isinstance(motion, Inertial):
        fields["w_b_radps"] = _RATE_STEP

    def drift(field: str, by: FloatArray) -> Change:
        def changed(imu: Imu) -> Imu:
            drifted = getattr(imu, field) + np.outer(imu.t_s - imu.t_s[0], by)
            return replace(imu, **{field: drifted})

        return changed

    changes = tuple(
        drift(field, by) for field, step in fields.items() for by in np.diag([step] * 3)
    )
    steps = np.repeat(list(fields.values()), 3)
    parts = tuple(
        flight_constant(f"{field} drift", ("x_b", "y_b", "z_b"), "/s", _ANY * step)
        for field, step in fields.items()
    )
    return solved_with_changes(problem, ChangedBy(parts, changes, steps), enough)
