"""Constants of a flight that change the inertial unit's samples: clock, drifts, a filter's delay.

Keyframes stay where they are, and the rows of the motion between them depend on constants c,

    r(c) = r(0) + J c        J_i = (r'(h_i) - r'(0)) / h_i

r'(h_i) of samples without their noise that a step of constant i has changed.
"""

from collections.abc import Callable, Mapping
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


class Promise(NamedTuple):
    """What a step of constants promises, half of its squares by its covariance, and it, (c,)."""

    nats: float
    step: FloatArray


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


def promised_each(
    problem: SmoothingProblem,
    at: States,
    by: Mapping[str, ChangedBy],
    beside: tuple[str, SmoothingProblem] | None = None,
) -> dict[str, Promise]:
    """Return what the scores of several sets of constants promise, each alone.

    By one elimination: with information N and score s of all of them, states integrated out, a set
    g has ``s_g N_gg^-1 s_g / 2`` (Rao, 1948). Infinite where there is no step.

    Parameters
    ----------
    problem : SmoothingProblem
    at : States
        Its minimum.
    by : mapping of str to ChangedBy
    beside : tuple of str and SmoothingProblem, optional
        Another set: the same problem with more constants, which need not be of samples.
    """
    first, free = problem.constants.width, problem
    sizes = {name: len(one.steps) for name, one in by.items()}
    starts = [part.start for one in by.values() for part in one.parts]
    if beside is not None:
        name, free = beside
        sizes = {name: free.constants.width - first} | sizes
        starts = [free.start.constants[first:], *starts]
    if not sizes:
        return {}
    begin = at._replace(constants=np.concatenate([at.constants, *starts]))
    try:
        extended = with_changed_samples(free, _joined(by)) if by else free
        step, covariance = constant_step(extended, begin)
    except NoSolutionError:
        return {name: Promise(np.inf, np.zeros(size)) for name, size in sizes.items()}
    step, P = step[first:], covariance[first:, first:]
    unit = np.sqrt(P.diagonal())  # seconds and ppm would cost digits
    information = np.linalg.inv(P / np.outer(unit, unit))
    score, out, end = information @ (step / unit), {}, 0
    for name, size in sizes.items():
        own, end = slice(end, end + size), end + size
        alone = np.linalg.solve(information[own, own], score[own])
        out[name] = Promise(float(score[own] @ alone) / 2, unit[own] * alone)
    return out


def _joined(by: Mapping[str, ChangedBy]) -> ChangedBy:
    """Return all of them as one."""
    each = by.values()
    return ChangedBy(
        tuple(part for one in each for part in one.parts),
        tuple(change for one in each for change in one.changes),
        np.concatenate([one.steps for one in each]),
    )


def step_promises(problem: SmoothingProblem, at: States, first: int) -> Promise:
    """Return what the step of constants from a column on promises; see ``promised_each``.

    Infinite where there is no step.

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
        return Promise(np.inf, np.zeros(len(at.constants) - first))
    step, P = step[first:], covariance[first:, first:]
    return Promise(float(step @ np.linalg.solve(P, step)) / 2, step)


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
