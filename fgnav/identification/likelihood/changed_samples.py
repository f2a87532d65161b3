"""Constants of a flight that change the inertial unit's samples: clock, drifts, a filter's delay.

Keyframes stay where they are, and the rows of the motion between them depend on constants c,

    r(c) = r(0) + J c        J_i = (r(h_i) - r(0)) / h_i

r(h_i) of samples that a step of constant i has changed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.constants import FlightConstant
from fgnav.graph.types.motion import LinearisedMotion, Motion
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.solve.chain import constant_step, solve_batch
from fgnav.types.flight import Imu

Change = Callable[[Imu], Imu]


def with_changed_samples(
    problem: SmoothingProblem, changes: tuple[Change, ...], steps: FloatArray, first: int
) -> SmoothingProblem:
    """Return a problem whose motion depends on constants from a column on; for chains alone.

    Parameters
    ----------
    problem : SmoothingProblem
        With these constants.
    changes : tuple of callable, length c
        What a step of each does to the unit.
    steps : ndarray, shape (c,)
    first : int

    Raises
    ------
    NoSolutionError
        If the problem has no inertial unit.
    """
    motion = problem.motion
    if not isinstance(motion, GyroFree | Inertial):
        raise NoSolutionError("constants of samples: the flight has no inertial unit")
    changed = tuple(replace(motion, imu=change(motion.imu)) for change in changes)
    # All of a motion that a chain reads.
    return replace(problem, motion=cast("Motion", _Changed(motion, changed, steps, first)))


def solved_with_changes(
    problem: SmoothingProblem,
    parts: tuple[FlightConstant, ...],
    changes: tuple[Change, ...],
    steps: FloatArray,
) -> Solution | None:
    """Return a whole problem's minimum with constants that change samples; None without one.

    By changes of a step of each.
    """
    first = problem.constants.width
    extended = problem.with_constants(parts)
    try:
        solution = solve_batch(with_changed_samples(extended, changes, steps, first))
    except NoSolutionError:
        return None
    return solution if solution.converged else None


def promised(
    problem: SmoothingProblem,
    at: States,
    parts: tuple[FlightConstant, ...],
    changes: tuple[Change, ...],
    steps: FloatArray,
) -> tuple[float, FloatArray]:
    """Return what the score of such constants promises, nats, and its step, (c,).

    Half of the step's squares by its covariance (Rao, 1948); infinite where there is no step.

    Parameters
    ----------
    problem : SmoothingProblem
    at : States
        Its minimum, without the constants.
    parts : tuple of FlightConstant
        Of c numbers in all.
    changes, steps
        As of ``with_changed_samples``.
    """
    begin = at._replace(constants=np.concatenate([at.constants, *(one.start for one in parts)]))
    first = problem.constants.width
    extended = problem.with_constants(parts)
    return step_promises(with_changed_samples(extended, changes, steps, first), begin, first)


def step_promises(problem: SmoothingProblem, at: States, first: int) -> tuple[float, FloatArray]:
    """Return what the step of constants from a column on promises, nats, and that step, (c,).

    Infinite where there is none. See ``promised``.

    Parameters
    ----------
    problem : SmoothingProblem
    at : States
        Its minimum, but for these constants.
    first : int
    """
    try:
        step, covariance = constant_step(problem, at)
    except NoSolutionError:
        return np.inf, np.zeros(len(at.constants) - first)
    step, P = step[first:], covariance[first:, first:]
    return float(step @ np.linalg.solve(P, step)) / 2, step


@dataclass(frozen=True, eq=False, slots=True)
class _Changed:
    """A motion whose samples change with constants, from a column on."""

    motion: GyroFree | Inertial
    changed: tuple[GyroFree | Inertial, ...]
    steps: FloatArray
    first: int

    @property
    def aux(self) -> int:
        return self.motion.aux

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        linear = self.motion.linearise(before, after, intervals)
        value, shared = linear.value.copy(), linear.shared.copy()
        for i, (one, step) in enumerate(zip(self.changed, self.steps, strict=True)):
            column = (one.linearise(before, after, intervals).value - linear.value) / step
            shared[:, :, self.first + i] = column
            value += column * before.constants[self.first + i]
        return linear._replace(value=value, shared=shared)

    def prior(self, constants: int) -> tuple[FloatArray, FloatArray]:
        return self.motion.prior(constants)
