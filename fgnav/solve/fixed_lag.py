"""A recorded flight through the window: each keyframe by what came within a lag, or by the past."""

from collections.abc import Sequence
from dataclasses import replace

from fgnav.graph.types.problem import Opening, Problem
from fgnav.graph.types.solution import Solution
from fgnav.progress import steps
from fgnav.solve.custom_factors import Custom, CustomFactors
from fgnav.solve.sliding.departed import Departed, joined_solution, opened
from fgnav.solve.sliding.relinearisation import BLOCK_S
from fgnav.solve.sliding.window import FixedLag

__all__ = ["Departed", "FixedLag", "solve_fixed_lag", "solve_forward"]


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

    def leaving(of: Problem, end: int) -> list[Departed | None]:
        # An opening holds an arbitrary heading fixed: it has no better place to linearise.
        keep = keep_linearisation and of is problem
        window = FixedLag(lag_s, min(BLOCK_S, lag_s), keep_linearisation=keep)
        entering = CustomFactors(custom if of is problem else (), of)
        parts = [window.update(of, row, entering.at(row, window.oldest)) for row in steps(end)]
        if end == len(of.t_s) and len(window):
            parts.append(window.flush())
        return parts

    return joined_solution(opened(leaving, problem, opening))


def solve_forward(
    problem: Problem,
    lag_s: float,
    *,
    custom: Sequence[Custom] = (),
    keep_linearisation: bool = False,
    opening: Opening | None = None,
) -> Solution:
    """Return each keyframe as known from the data up to it: what a filter estimates.

    Parameters as in ``solve_fixed_lag``; states up to ``lag_s`` back are still relinearised.
    """

    def newest(of: Problem, end: int) -> list[Departed | None]:
        window = FixedLag(lag_s, 0.0, keep_linearisation=keep_linearisation)
        entering, parts = CustomFactors(custom, of), list[Departed | None]()
        for row in steps(end):
            window.advance(of, row, entering.at(row, window.oldest))
            parts.append(window.latest())
        return parts

    return replace(joined_solution(opened(newest, problem, opening)), cross=None)
