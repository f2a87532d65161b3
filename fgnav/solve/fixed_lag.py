"""A recorded flight through the window: each keyframe by what came within a lag, or by the past."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from fgnav.graph.types.problem import Opening, Problem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import POSITION, ROTATION, States
from fgnav.progress import steps
from fgnav.solve.custom_factors import Custom, CustomFactors
from fgnav.solve.sliding.relinearisation import BLOCK_S
from fgnav.solve.sliding.window import FixedLag

_BY_KEYFRAME = (
    "covariance",
    "cross",
    "constant_covariance",
    "constant_cross",
    "refused",
    "constants",
)


def solve_fixed_lag(
    problem: Problem,
    lag_s: float,
    *,
    custom: Sequence[Custom] = (),
    keep_linearisation: bool = False,
    opening: Opening | None = None,
) -> Solution:
    """Return each keyframe as known from the data up to at least ``lag_s`` after it.

    Parameters
    ----------
    problem : Problem
    lag_s : float
        Length of the window; a block, of a second or of the lag if that is shorter, is added to it
        before keyframes leave.
    custom : sequence of gtsam.NonlinearFactor or NamedFactor
        Custom factors, over ``fgnav.graph.keys`` with rows of the problem for numbers. Each
        enters with the last keyframe that it touches.
    keep_linearisation : bool
        As in ``FixedLag``.
    opening : Opening, optional
        Keyframes that leave while it holds are as a window over it has them; one over the problem
        has the others, and begins at the first keyframe, too. Custom factors are not in the
        former: its heading is arbitrary, and one that speaks of it would tilt the body.

    Raises
    ------
    BadInputError
        If a custom factor touches a variable that is not there, or one that has left.
    NoSolutionError
        If the data leave a state open.
    """

    def leaving(of: Problem, end: int) -> Iterator[Solution | None]:
        # An opening holds an arbitrary heading fixed: it has no better place to linearise.
        keep = keep_linearisation and of is problem
        window = FixedLag(lag_s, min(BLOCK_S, lag_s), keep_linearisation=keep)
        factors = CustomFactors(custom if of is problem else (), of)
        for row in steps(end):
            yield window.update(of, row, factors.at(row, window.oldest))
        if end == len(of.t_s) and len(window):
            yield window.flush()

    return joined_solution(_opened(leaving, problem, opening), len(problem.t_s))


def solve_forward(
    problem: Problem,
    lag_s: float,
    *,
    custom: Sequence[Custom] = (),
    opening: Opening | None = None,
) -> Solution:
    """Return each keyframe as known from the data up to it: what a filter estimates.

    Parameters as in ``solve_fixed_lag``; states up to ``lag_s`` back are still relinearised.
    """

    def newest(of: Problem, end: int) -> Iterator[Solution | None]:
        window = FixedLag(lag_s, 0.0)
        factors = CustomFactors(custom, of)
        for row in steps(end):
            window.advance(of, row, factors.at(row, window.oldest))
            yield window.latest()

    return replace(joined_solution(_opened(newest, problem, opening), len(problem.t_s)), cross=None)


def with_open_heading(solution: Solution, opening: Opening) -> Solution:
    """Return keyframes with what is not known of the heading that the opening holds fixed.

    The body may be turned about the vertical through its antenna.
    """
    J = np.zeros(solution.covariance.shape[:2])
    J[:, ROTATION] = solution.states.R_nb[:, 2]
    J[:, POSITION] = np.cross(opening.arm_b_m, J[:, ROTATION])
    variance_rad2 = opening.heading_variance_rad2
    open_rad2 = variance_rad2 * J[:, :, None] * J[:, None, :]
    inward = np.cross(J[:, POSITION], J[:, ROTATION])  # by 1 - cos of the turn: 1.5 if uniform
    second = min(0.75 * variance_rad2**2, 1.5)
    open_rad2[:, POSITION, POSITION] += second * inward[:, :, None] * inward[:, None, :]
    return replace(solution, covariance=solution.covariance + open_rad2)


def joined_solution(parts: Iterable[Solution], count: int) -> Solution:
    """Return ``count`` keyframes that leave a window one after another as one solution.

    Each part is copied as it comes, and none is kept.
    """
    joined, end = list[np.ndarray](), 0
    for part in parts:
        arrays = [*part.states[:4], *(getattr(part, name) for name in _BY_KEYFRAME)]
        joined = joined or [np.empty((count, *array.shape[1:]), array.dtype) for array in arrays]
        begin, end = end, end + len(arrays[0])
        for of, array in zip(joined, arrays, strict=True):
            of[begin:end] = array
    states = States._make((*joined[:4], part.states.constants))
    fields: dict[str, Any] = dict(zip(_BY_KEYFRAME, joined[4:], strict=True))
    return replace(part, states=states, converged=not fields["refused"].any(), **fields)


def _opened(
    leaving: Callable[[Problem, int], Iterator[Solution | None]],
    problem: Problem,
    opening: Opening | None,
) -> Iterator[Solution]:
    """Yield the states that leave a window, first those of an opening, then of the problem.

    ``leaving`` yields what leaves with each of a problem's first keyframes, and what is left.
    """
    count = 0
    if opening is not None:
        for solution in leaving(opening.problem, opening.keyframes):
            count += 1
            if solution is not None:
                yield with_open_heading(solution, opening)
    if count < len(problem.t_s):
        later = islice(leaving(problem, len(problem.t_s)), count, None)
        yield from (solution for solution in later if solution is not None)
