"""A problem linearised where states stand, as GTSAM's linear factors by keyframe.

Sensors and motion are linearised all epochs at once; what each keyframe has is then a
``gtsam.JacobianFactor`` of whitened rows ``A dx = -residual``, the same as ``linearize`` of the
problem's nonlinear factors yields one by one.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.graph.build import (
    Layout,
    constant_priors,
    insert_constants,
    insert_keyframe,
    keyframe_priors,
)
from fgnav.graph.linear_factor import linear_factor
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import AUX, States


class LinearFlight(NamedTuple):
    """A problem linearised: factors by the oldest keyframe of each, and the sum of squares."""

    factors: list[list[gtsam.GaussianFactor]]
    cost: float


class _Rows(NamedTuple):
    """Whitened rows, m each of k keyframes.

    Columns: the keyframe's tangent, that of the next, constants, the right-hand side.
    """

    keyframes: IntArray  # (k,)
    rows: FloatArray  # (k, m, 2 D + b + 1)


def linearise(problem: Problem, at: States) -> LinearFlight:
    """Linearise motion, sensors and priors of a problem.

    Rows of a keyframe and of the motion to the next are one factor: to make a factor takes as long
    as to eliminate it. Phases of single antennas and custom factors are not among them.

    Parameters
    ----------
    problem : Problem
    at : States

    Raises
    ------
    NoSolutionError
        If a residual is not finite.
    """
    layout, parts = Layout.of(problem), list(_rows(problem, at))
    for linear in parts:
        wrong = linear.keyframes[~np.isfinite(linear.rows[:, :, -1]).all(axis=1)]
        if len(wrong):
            raise NoSolutionError(f"residuals are not finite at {problem.t_s[wrong[0]]:.2f} s")
    priors = list(_priors(problem, layout, at))
    squares = [float(prior.getb() @ prior.getb()) for prior in priors]
    squares += [float((linear.rows[:, :, -1] ** 2).sum()) for linear in parts]
    factors: list[list[gtsam.GaussianFactor]] = [[*priors], *([] for _ in problem.t_s[1:])]
    rows, first = _stacked(parts, len(problem.t_s))
    sizes = (6, 3, layout.width - AUX)
    ends = np.cumsum([0, *sizes, *sizes, *(parameter.size for parameter in layout.constants.parts)])
    spans = list(pairwise(ends.tolist()))
    used = [bool(rows[:, begin:end].any()) for begin, end in spans]
    for k, of in enumerate(factors):
        stacked = np.ascontiguousarray(rows[first[k] : first[k + 1]].T)
        variables = (*layout.keyframe(k), *layout.keyframe(k + 1), *layout.constant_keys)
        terms = [
            (key, stacked[begin:end].T)
            for key, (begin, end), is_used in zip(variables, spans, used, strict=True)
            if is_used and not (k + 1 == len(factors) and 3 <= variables.index(key) < 6)
        ]
        if stacked.shape[1]:
            of.append(linear_factor(terms, stacked[-1]))
    return LinearFlight(factors, sum(squares))


def _rows(problem: Problem, at: States) -> Iterator[_Rows]:
    """Yield the rows of motion and sensors."""
    n, D = len(problem.t_s), at.width
    if n > 1:
        intervals = np.arange(n - 1)
        before, after = at.at(slice(0, n - 1)), at.at(slice(1, n))
        value, *blocks = problem.motion.linearise(before, after, intervals)
        yield _Rows(intervals, np.concatenate([*blocks, -value[:, :, None]], axis=2))
    for sensor in problem.sensors:
        value, state, shared = sensor.linearise(at.at(sensor.row), np.arange(len(sensor.row)))
        rows = np.zeros((*value.shape, 2 * D + len(at.constants) + 1))
        rows[:, :, :D], rows[:, :, 2 * D : -1], rows[:, :, -1] = state, shared, -value
        yield _Rows(sensor.row, rows)


def _stacked(parts: list[_Rows], n: int) -> tuple[FloatArray, IntArray]:
    """Return rows of all keyframes, one after another, and the first of each, (n + 1,)."""
    counts = np.zeros(n, dtype=np.int64)
    for keyframes, rows in parts:
        np.add.at(counts, keyframes, rows.shape[1])
    first = np.concatenate([[0], np.cumsum(counts)])
    stacked, begin = np.empty((first[-1], parts[0].rows.shape[2])), first[:-1].copy()
    for keyframes, rows in parts:
        m = rows.shape[1]
        among = np.arange(len(keyframes)) - keyframes.searchsorted(keyframes)  # of one keyframe
        stacked[(begin[keyframes] + among * m)[:, None] + np.arange(m)] = rows
        np.add.at(begin, keyframes, m)
    return stacked, first


def _priors(problem: Problem, layout: Layout, at: States) -> Iterator[gtsam.JacobianFactor]:
    """Yield what is known of the first keyframe and of the constants before the flight."""
    values = gtsam.Values()
    insert_keyframe(values, layout, 0, at)
    insert_constants(values, layout, at.constants)
    for factor in (*keyframe_priors(problem), *constant_priors(problem.constants)):
        yield gtsam.JacobianFactor(factor.linearize(values))
