"""Errors of the inertial unit over spans beside phases of arcs, which tie distant states together.

A chain with arcs has no covariance of distant states that follows from neighbours'. But an error
that is another constant u_j in each block j of intervals is a constant of the whole problem, of
column ``J_j`` in the rows of that block alone. About its minimum without them a step c of all, and
their covariance P, tell their score and information; p is their prior variance:

    s = P^-1 c      N = P^-1 - I / p      gain of a span = s_S' N_S^-1 s_S / 2

s_S and N_S summed over the span's blocks [1]_.

References
----------
.. [1] Willsky, Jones, as in ``span_offsets``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.constants import flight_constant
from fgnav.graph.types.motion import LinearisedMotion, Motion
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.identification.likelihood.span_offsets import LEAST_S, LIKELY, Offset
from fgnav.identification.noise.denoised import denoised
from fgnav.solve.chain import constant_step
from fgnav.types.flight import Imu

_BLOCKS = 24  # of a record, at most: a bound of cost
_ROUNDING = 1e-6  # s, of times
_STEP = 0.1  # of a prior sigma, of difference quotients: far above rounding, nearly linear


class Error(NamedTuple):
    """An error of a sensor by g numbers u, and a unit without it."""

    sensor: str
    shape: str
    any: float  # 1-sigma of each: next to nothing is known
    less: Callable[[FloatArray, Imu], Imu]
    size: int = 3

    @property
    def step(self) -> float:
        """Of the difference quotients."""
        return _STEP * self.any


def likeliest_span(
    problem: SmoothingProblem, at: States, error: Error, edges: IntArray, least_s: float
) -> Offset | None:
    """Return an error's likeliest span between edges of blocks; None where there is no minimum.

    Parameters as in ``of_blocks``; ``least_s``: of a span.
    """
    information = of_blocks(problem, at, error, edges)
    if information is None:
        return None
    return best_span(problem.t_s, error[:3], edges, information, least_s)


def seconds(t_s: FloatArray) -> IntArray:
    """Return the keyframes between blocks of a second, or of as many as there may be."""
    duration_s = float(t_s[-1] - t_s[0])
    count = int(np.clip(np.floor(duration_s / LEAST_S), 1, _BLOCKS))
    edges = np.searchsorted(t_s, t_s[0] + duration_s * np.arange(count + 1) / count - 1e-9)
    return np.unique(np.append(edges[:-1], len(t_s) - 1))


def finer(edges: IntArray, span: Offset) -> IntArray:
    """Return edges of blocks with all keyframes a block about where a span begins and ends."""
    widest, rows = int(np.diff(edges).max()), np.arange(edges[-1] + 1)
    near = np.min(np.abs(rows[:, None] - np.array([span.begin, span.end])), axis=1) <= widest
    return np.union1d(edges, rows[near])


def of_blocks(
    problem: SmoothingProblem, at: States, error: Error, edges: IntArray
) -> tuple[FloatArray, FloatArray] | None:
    """Return score, (m, g), and information, (m, m, g, g), of an error in blocks of intervals.

    In units of its prior sigma, and without that prior. None where there is no minimum.

    Parameters
    ----------
    problem : SmoothingProblem
    at : States
        Its minimum.
    error : Error
    edges : ndarray of int, shape (m + 1,)
        Keyframes, the first and the last among them.
    """
    extended = with_blocks(problem, error, edges)
    if extended is None:
        return None
    first = problem.constants.width
    return information_of(extended, at, first, error.any, (len(edges) - 1, error.size))


def with_blocks(
    problem: SmoothingProblem, error: Error, edges: IntArray
) -> SmoothingProblem | None:
    """Return a problem with an error in blocks as its last constants; None without a unit.

    Parameters as in ``of_blocks``.
    """
    m, g, motion = len(edges) - 1, error.size, problem.motion
    if not isinstance(motion, GyroFree | Inertial):
        return None
    block = np.repeat(np.arange(m), np.diff(edges))
    quiet = denoised(motion.imu)
    at_none = replace(motion, imu=quiet)
    changed = tuple(replace(motion, imu=error.less(by, quiet)) for by in error.step * np.eye(g))
    names = tuple(f"{j}" for j in range(g * m))
    part = flight_constant("span", names, "", error.any, reported=False)
    column = problem.constants.width + g * block
    in_blocks = _InBlocks(motion, at_none, changed, error.step, column)
    return replace(problem.with_constants((part,)), motion=cast("Motion", in_blocks))


def information_of(
    extended: SmoothingProblem, at: States, first: int, any_: float, shape: tuple[int, int]
) -> tuple[FloatArray, FloatArray] | None:
    """Return score, (m, g), and information, (m, m, g, g), of constants that are free.

    In units of their prior sigma, and without that prior. None where there is no minimum.

    Parameters
    ----------
    extended : SmoothingProblem
    at : States
        The minimum without them.
    first : int
        The first of their columns.
    any_ : float
        Their prior sigma.
    shape : tuple of int
        Blocks m and numbers g of each.
    """
    m, g = shape
    begin = at._replace(constants=np.concatenate([at.constants, np.zeros(g * m)]))
    try:
        step, covariance = constant_step(extended, begin)
    except NoSolutionError:
        return None
    # In units of their prior, which leaves their information its digits.
    inverse = np.linalg.inv(covariance[first:, first:] / any_**2)
    s = (inverse @ step[first:] / any_).reshape(m, g)
    return s, (inverse - np.eye(g * m)).reshape(m, g, m, g).transpose(0, 2, 1, 3)


def best_span(
    t_s: FloatArray,
    error: tuple[str, str, float],
    edges: IntArray,
    information: tuple[FloatArray, FloatArray],
    least_s: float,
) -> Offset:
    """Return the span of the greatest gain.

    Parameters
    ----------
    t_s : ndarray, shape (n,)
        Of keyframes.
    error : tuple of str, str and float
        Sensor, shape and prior sigma.
    edges : ndarray of int, shape (m + 1,)
        Keyframes between blocks.
    information : tuple of ndarray, shapes (m, g) and (m, m, g, g)
        Score and information.
    least_s : float
        Of a span.
    """
    (s, N), (sensor, shape, any_), t_s = information, error, t_s[edges]
    m, g = s.shape
    begin, end = np.triu_indices(m + 1, 1)
    long = t_s[end] - t_s[begin] > min(least_s, t_s[-1] - t_s[0]) - _ROUNDING
    begin, end = begin[long], end[long]
    total = np.zeros((m + 1, m + 1, g, g))
    total[1:, 1:] = N.cumsum(axis=0).cumsum(axis=1)
    sums = np.concatenate([np.zeros((1, g)), s.cumsum(axis=0)])
    of_span = total[end, end] - total[begin, end] - total[end, begin] + total[begin, begin]
    of_span = of_span + np.eye(g)  # of its prior
    score = sums[end] - sums[begin]
    value = np.linalg.solve(of_span, score[:, :, None])[:, :, 0]
    gains = (score * value).sum(axis=1) / 2
    i = int(gains.argmax())
    likely = gains > gains[i] - LIKELY
    begins, ends = edges[begin], edges[end]
    return Offset(
        sensor,
        shape,
        int(begins[i]),
        int(ends[i]),
        (int(begins[likely].min()), int(begins[likely].max())),
        (int(ends[likely].min()), int(ends[likely].max())),
        float(gains[i]),
        value[i] * any_,
        np.linalg.inv(of_span[i]) * any_**2,
    )


@dataclass(frozen=True, eq=False, slots=True)
class _InBlocks:
    """A motion whose samples change with constants of each interval's own block."""

    motion: GyroFree | Inertial
    quiet: GyroFree | Inertial  # of samples without their noise
    changed: tuple[GyroFree | Inertial, ...]
    step: float
    first: IntArray  # (n - 1,), column

    @property
    def aux(self) -> int:
        return self.motion.aux

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        linear = self.motion.linearise(before, after, intervals)
        at_none = self.quiet.linearise(before, after, intervals).value
        value, shared, rows = linear.value.copy(), linear.shared.copy(), np.arange(len(intervals))
        for i, one in enumerate(self.changed):
            column = (one.linearise(before, after, intervals).value - at_none) / self.step
            at = self.first[intervals] + i
            shared[rows, :, at] = column
            value += column * before.constants[at][:, None]
        return linear._replace(value=value, shared=shared)

    def prior(self, constants: int) -> tuple[FloatArray, FloatArray]:
        return self.motion.prior(constants)
