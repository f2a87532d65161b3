"""Constants of a flight that change the inertial unit's samples: clock, drifts, a filter's delay.

Keyframes stay where they are, and the rows of the motion between them depend on constants c,

    r(c) = r(0) + J c        J_i = (r'(h_i) - r'(0)) / h_i

r'(h_i) of samples without their noise that a step of constant i has changed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.constants import FlightConstant
from fgnav.graph.types.motion import LinearisedMotion, Motion
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import ROTATION, States
from fgnav.identification.noise.denoised import denoised
from fgnav.solve.chain import constant_step, solve_batch
from fgnav.types.flight import Imu

Change = Callable[[Imu], Imu]


class ChangedBy(NamedTuple):
    """Constants of c numbers in all, what a step of each does to the unit, and these steps, (c,).

    Nothing depends on them but the samples.
    """

    parts: tuple[FlightConstant, ...]
    changes: tuple[Change, ...]
    steps: FloatArray


def with_changed_samples(problem: SmoothingProblem, by: ChangedBy) -> SmoothingProblem:
    """Return a problem whose motion depends on more constants, the last; for chains alone.

    Raises
    ------
    NoSolutionError
        If the problem has no inertial unit.
    """
    motion, first = problem.motion, problem.constants.width
    if not isinstance(motion, GyroFree | Inertial):
        raise NoSolutionError("constants of samples: the flight has no inertial unit")
    quiet = denoised(motion.imu)
    at = replace(motion, imu=quiet)
    changed = tuple(replace(motion, imu=change(quiet)) for change in by.changes)
    extended = problem.with_constants(by.parts)
    # All of a motion that a chain reads.
    by_step = _Changed(motion, at, changed, by.steps, first)
    return replace(extended, motion=cast("Motion", by_step))


def solved_with_changes(
    problem: SmoothingProblem,
    by: ChangedBy,
    enough: float = np.inf,
    begin: States | None = None,
) -> Solution | None:
    """Return a whole problem's minimum with constants that change samples; None without one.

    Or without one of at most a cost, ``enough``.
    """
    return minimum_below(with_changed_samples(problem, by), enough, begin)


def minimum_below(
    problem: SmoothingProblem, enough: float, begin: States | None = None
) -> Solution | None:
    """Return a problem's minimum if it has one, and of no more than a cost; else None."""
    try:
        solution = solve_batch(problem, begin=begin, enough=enough)
    except NoSolutionError:
        return None
    return solution if solution.converged and solution.cost <= enough else None


def attitude_covariance(solution: Solution, first: int) -> FloatArray:
    """Return what constants from a column on add to the covariance of attitudes, (n, 3, 3), rad2.

    ``G C G' = X C^-1 X'``, C of the constants, X that of attitudes and them, G the attitudes'
    derivative; negative columns count from the last.
    """
    C = solution.constant_covariance[0, first:, first:]
    X = solution.constant_cross[:, ROTATION, first:]
    return np.asarray(X @ np.linalg.solve(C, X.swapaxes(1, 2)))


def promised(problem: SmoothingProblem, at: States, by: ChangedBy) -> tuple[float, FloatArray]:
    """Return what the score of such constants promises, nats, and its step, (c,).

    Half of the step's squares by its covariance (Rao, 1948); infinite where there is no step.

    Parameters
    ----------
    problem : SmoothingProblem
    at : States
        Its minimum, without the constants.
    by : ChangedBy
    """
    return promised_each(problem, at, (by,))[0]


def promised_each(
    problem: SmoothingProblem, at: States, by: tuple[ChangedBy, ...]
) -> list[tuple[float, FloatArray]]:
    """Return what the scores of several sets of constants promise, each alone, and their steps.

    By one elimination: with information N and score s of all of them, states integrated out, a set
    g has ``s_g N_gg^-1 s_g / 2``. Parameters as of ``promised``.
    """
    if not by:
        return []
    joined = ChangedBy(
        tuple(part for one in by for part in one.parts),
        tuple(change for one in by for change in one.changes),
        np.concatenate([one.steps for one in by]),
    )
    ends = np.cumsum([len(one.steps) for one in by])
    begin = at._replace(constants=np.concatenate([at.constants, *(p.start for p in joined.parts)]))
    try:
        step, covariance = constant_step(with_changed_samples(problem, joined), begin)
    except NoSolutionError:
        return [(np.inf, np.zeros(len(one.steps))) for one in by]
    first = problem.constants.width
    information = np.linalg.inv(covariance[first:, first:])
    score, out = information @ step[first:], []
    for one, end in zip(by, ends, strict=True):
        own = slice(end - len(one.steps), end)
        alone = np.linalg.solve(information[own, own], score[own])
        out.append((float(score[own] @ alone) / 2, alone))
    return out


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
    quiet: GyroFree | Inertial  # of samples without their noise
    changed: tuple[GyroFree | Inertial, ...]  # of these after a step of each
    steps: FloatArray
    first: int

    @property
    def aux(self) -> int:
        return self.motion.aux

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        linear = self.motion.linearise(before, after, intervals)
        value, shared = linear.value.copy(), linear.shared.copy()
        at = self.quiet.linearise(before, after, intervals).value
        for i, (one, step) in enumerate(zip(self.changed, self.steps, strict=True)):
            column = (one.linearise(before, after, intervals).value - at) / step
            shared[:, :, self.first + i] = column
            value += column * before.constants[self.first + i]
        return linear._replace(value=value, shared=shared)

    def prior(self, constants: int) -> tuple[FloatArray, FloatArray]:
        return self.motion.prior(constants)
