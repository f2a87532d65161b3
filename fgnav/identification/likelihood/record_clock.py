"""The clock of the inertial unit beside phases of arcs, which take its tags as exact.

Tags that move by ``c = (o, r)`` move the samples, and so the rows of the motion between keyframes,
which stay where they are:

    r(c) = r(0) + J c        J = (r(h) - r(0)) / h

With these columns c is a constant of the whole problem [1]_: its minimum is a Gauss-Newton step of
the likelihood in c, states and ambiguities integrated out.

References
----------
.. [1] Li, Mourikis: Online temporal calibration for camera-IMU systems, International Journal of
   Robotics Research 33, 2014: a clock's offset in the propagation by inertial samples.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.frontend.calibration_request import calibration_requests, of_time
from fgnav.graph.delayed import CLOCK_OFFSET
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.motion import LinearisedMotion, Motion
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.identification.likelihood.beside_phases import variance_factor
from fgnav.identification.track.tags import tags_moved_s
from fgnav.solve.chain import solve_batch

_STEPS = np.array([1e-3, 100.0])  # s, ppm: far below what a motion changes in, far above rounding


class RecordClock(NamedTuple):
    """Offset, s, and rate, ppm, to be added to the unit's tags, (2,), and their covariance.

    ``factor``: by how much more than noise explains is left of all variances, 1 or more.
    """

    value: FloatArray
    covariance: FloatArray
    factor: float

    @property
    def sigma(self) -> FloatArray:
        """Of both, (2,)."""
        return np.sqrt(self.covariance.diagonal())

    @property
    def squares(self) -> float:
        """Chi-square of two: whether the clock is off."""
        return float(self.value @ np.linalg.solve(self.covariance, self.value)) / self.factor


def record_clock(
    problem: SmoothingProblem, middle_s: float, moved: FloatArray
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
    """
    motion, first = problem.motion, problem.constants.width
    if not isinstance(motion, GyroFree | Inertial) or problem.constants.column(CLOCK_OFFSET) >= 0:
        return None
    motions = tuple(
        replace(motion, imu=replace(motion.imu, t_s=tags_moved_s(motion.imu, by, middle_s)))
        for by in np.diag(_STEPS)
    )
    (clock,) = calibration_requests(["clock"])
    clock = replace(clock, moved=(float(moved[0]), float(moved[1])))
    problem = problem.with_constants(of_time(clock))
    clocked = cast("Motion", _Clocked(motion, motions, first))  # all of it that a chain reads
    try:
        solution = solve_batch(replace(problem, motion=clocked))
    except NoSolutionError:
        return None
    if not solution.converged:
        return None
    return RecordClock(
        value=solution.states.constants[first:],
        covariance=solution.constant_covariance[0, first:, first:],
        factor=variance_factor(problem, solution.cost),
    )


@dataclass(frozen=True, eq=False, slots=True)
class _Clocked:
    """A motion whose samples move with two constants, from a column on."""

    motion: GyroFree | Inertial
    moved: tuple[GyroFree | Inertial, ...]
    first: int

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        linear = self.motion.linearise(before, after, intervals)
        value, shared = linear.value.copy(), linear.shared.copy()
        for i, (moved, step) in enumerate(zip(self.moved, _STEPS, strict=True)):
            column = (moved.linearise(before, after, intervals).value - linear.value) / step
            shared[:, :, self.first + i] = column
            value += column * before.constants[self.first + i]
        return linear._replace(value=value, shared=shared)

    def prior(self, constants: int) -> tuple[FloatArray, FloatArray]:
        return self.motion.prior(constants)
