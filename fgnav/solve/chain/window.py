"""A sliding window over the chain: keyframes come one by one, are smoothed, and leave."""

from dataclasses import replace

import numpy as np

from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.solve.chain.linear_window import LinearWindow
from fgnav.solve.sliding.departed import Departed, departed, joined_solution
from fgnav.solve.sliding.relinearisation import UNKNOWN_RAD, WAITS_S, moved_far
from fgnav.solve.sliding.retract_kernel import retracted

_ROUNDING_S = 1e-6
_PASSES = 5  # at most, while states are linearised anew: a rough start needs three


class ChainWindow:
    """The newest keyframes of a flight, each smoothed by what came after it.

    Parameters
    ----------
    lag_s : float
        Keyframes leave known from the data up to this long after them at least.
    block_s : float
        The window is solved, and keyframes leave, when this much is new; 0: at every keyframe.
    keep_linearisation : bool
        Whether states are linearised at ``problem.start`` and stay there. Else a keyframe starts
        where the motion leads, and is linearised anew as its estimate moves; the oldest is not once
        others have left, which speak of it where it was. Constants are not.
    """

    def __init__(
        self, lag_s: float, block_s: float = 1.0, *, keep_linearisation: bool = False
    ) -> None:
        self._lag_s, self._block_s, self._keep = lag_s, block_s, keep_linearisation
        self._linear = LinearWindow()
        self._new = 0  # keyframes not yet in the estimates
        self._blocks: list[int] = []  # numbers of those that ended a block and have not left
        self._solved_s = -np.inf
        self._departed = 0  # keyframes that have left, not all of them marginalised
        self._was_known = False  # whether the attitude was, where the window began
        self._newest: States
        self._updates = 0

    def __len__(self) -> int:
        """Return how many keyframes have not left."""
        return self._linear.oldest + len(self._linear) - self._departed

    @property
    def updates(self) -> int:
        """Eliminations so far."""
        return self._updates

    def update(self, problem: SmoothingProblem, row: int) -> Departed | None:
        """Take a keyframe in; return those that leave by that, if any.

        Raises
        ------
        NoSolutionError
            Naming the state that the data leave open, and when.
        """
        first, end = self._departed, self._advance(problem, row)
        leaving = self._estimates(first, end) if end > first else None
        self._leave(end)
        return leaving

    def filter(self, problem: SmoothingProblem, row: int) -> Departed:
        """Take a keyframe in; return it, known from the data up to it; others leave unseen."""
        self._leave(self._advance(problem, row))
        return self.newest()

    def newest(self) -> Departed:
        """Return the newest keyframe, known from the data up to it and no further."""
        self._solve()
        end = self._departed + len(self)
        return self._estimates(end - 1, end)

    def rest(self) -> Departed:
        """Return all keyframes that have not left, known from all data so far."""
        self._solve()
        return self._estimates(self._departed, self._departed + len(self))

    def _advance(self, problem: SmoothingProblem, row: int) -> int:
        """Take a keyframe in, solve if it ends a block; return which is the first to stay."""
        if not len(self):
            self._solved_s = float(problem.t_s[row])
        self._begin(problem, row)
        if problem.t_s[row] - self._solved_s < self._block_s - _ROUNDING_S:
            return self._departed
        self._solve()
        limit_s, end = self._solved_s - self._lag_s + _ROUNDING_S, self._departed
        for last in self._blocks[:-1]:
            if self._linear.rows.t_s[last - self._linear.oldest] <= limit_s:
                end = last + 1
        return end

    def _leave(self, end: int) -> None:
        """Marginalise keyframes before ``end``, unless the attitude is unknown there by now."""
        linear = self._linear
        while self._blocks and self._blocks[0] < end:
            del self._blocks[0]
        if end > self._departed and not self._keep:
            t_s = linear.rows.t_s
            is_known = linear.turn_sigma_rad(end - linear.oldest) < UNKNOWN_RAD
            waits = self._was_known and t_s[-1] - t_s[0] < WAITS_S and not is_known
            self._was_known |= is_known
        else:
            waits = end == self._departed
        self._departed = end
        if not waits:
            linear.forget(end - linear.oldest)

    def _begin(self, problem: SmoothingProblem, row: int) -> None:
        """Place a keyframe where its search starts."""
        at = problem.start.at(slice(row, row + 1))
        if len(self) and not self._keep:
            known, at = at.R_nb, problem.motion.predict(self._newest, np.array([row - 1]))
            if problem.attitude_known[row]:
                at = at._replace(R_nb=known)
        self._linear.append(problem, row, at)
        self._new, self._newest = self._new + 1, at

    def _solve(self) -> None:
        """Solve with new keyframes, and again while that moves estimates too far."""
        if not self._new:
            return
        linear, n = self._linear, len(self._linear)
        for left in range(_PASSES - 1, -1, -1):
            linear.solve()
            steps = linear.substitute()
            self._updates += 1
            far = moved_far(steps)
            far[0] &= not linear.oldest
            if self._keep or not left or not far.any():
                break
            which, none = np.flatnonzero(far), np.zeros(len(linear.constants))
            linear.relinearise(which, retracted(linear.states.at(which), steps[which], none))
        self._new, self._solved_s = 0, float(linear.rows.t_s[-1])
        self._blocks.append(linear.oldest + n - 1)
        self._newest = self._estimated(linear.oldest + n - 1, linear.oldest + n)

    def _estimated(self, begin: int, end: int) -> States:
        """Return the estimates of keyframes ``begin`` to ``end - 1``."""
        linear = self._linear
        begin, end = begin - linear.oldest, end - linear.oldest
        steps = linear.rows.steps[begin:end]
        at = linear.states.at(slice(begin, end))
        return retracted(at, steps, linear.end[steps.shape[1] :])

    def _estimates(self, begin: int, end: int) -> Departed:
        first, stop = begin - self._linear.oldest, end - self._linear.oldest
        rows = self._linear.rows.between(first, stop)
        return departed(
            rows.t_s,
            self._estimated(begin, end),
            rows.steps,
            self._linear.marginals(first, stop),
            keep_linearisation=self._keep,
            updates=self._updates,
        )


def solve_fixed_lag(
    problem: SmoothingProblem, lag_s: float, *, keep_linearisation: bool = False
) -> Solution:
    """Return each keyframe as known from the data up to at least ``lag_s`` after it.

    Parameters as in ``ChainWindow``; blocks of a second.
    """
    window = ChainWindow(lag_s, min(1.0, lag_s), keep_linearisation=keep_linearisation)
    parts = [window.update(problem, row) for row in range(len(problem.t_s))]
    return joined_solution([part for part in (*parts, window.rest()) if part is not None])


def solve_forward(
    problem: SmoothingProblem, lag_s: float, *, keep_linearisation: bool = False
) -> Solution:
    """Return each keyframe as known from the data up to it: what a filter estimates.

    Parameters as in ``ChainWindow``; states up to ``lag_s`` back are still linearised anew.
    """
    window = ChainWindow(lag_s, 0.0, keep_linearisation=keep_linearisation)
    parts = [window.filter(problem, row) for row in range(len(problem.t_s))]
    return replace(joined_solution(parts), cross=None)
