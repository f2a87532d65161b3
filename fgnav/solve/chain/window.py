"""A sliding window over the chain: keyframes come one by one, are smoothed, and leave."""

from dataclasses import replace

import numpy as np

from fgnav.checks import BoolArray
from fgnav.graph.types.problem import Opening, SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import ROTATION, States
from fgnav.progress import steps
from fgnav.solve.chain.linear_window import LinearWindow
from fgnav.solve.sliding.departed import Departed, departed, joined_solution, opened
from fgnav.solve.sliding.relinearisation import (
    BLOCK_S,
    REPEATS,
    SLOW_S,
    has_gyroscope,
    may_leave,
    moved_far,
    relaxed,
    repeats_at,
)
from fgnav.solve.sliding.retract_kernel import retracted

_ROUNDING_S = 1e-6


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
        where the motion leads, and is linearised anew as its estimate moves; without a gyroscope
        the oldest is not once others have left, which speak of it where it was. Constants are not.
    """

    def __init__(
        self,
        lag_s: float,
        block_s: float = BLOCK_S,
        *,
        keep_linearisation: bool = False,
    ) -> None:
        self._lag_s, self._block_s, self._keep = lag_s, block_s, keep_linearisation
        self._linear = LinearWindow()
        self._new = 0  # keyframes not yet in the estimates
        self._blocks: list[int] = []  # numbers of those that ended a block and have not left
        self._solved_s = -np.inf
        self._departed = 0  # keyframes that have left, not all of them marginalised
        self._newest: States
        self._updates = 0
        self._attitude_s = np.inf  # of the last keyframe with an attitude of its own
        self._is_slow = False  # whether such keyframes are far apart
        self._turn_sigma_rad: dict[int, float] = {}  # of keyframes when last asked for

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
        self._relinearise()
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
        self._departed = end
        t_s, count = linear.rows.t_s, end - linear.oldest
        if count and t_s[count] - t_s[0] > BLOCK_S - _ROUNDING_S and self._may_leave(count):
            linear.forget(count)

    def _may_leave(self, count: int) -> bool:
        """Return whether the attitude is known where the window would begin."""
        if self._keep:
            return True
        linear, oldest = self._linear, self._linear.oldest + count
        t_s, sigma_rad = linear.rows.t_s, self._turn_sigma_rad.get(oldest - 1)
        self._turn_sigma_rad = {k: s for k, s in self._turn_sigma_rad.items() if k >= oldest - 1}
        sigma_rad = linear.turn_sigma_rad(count) if sigma_rad is None else sigma_rad
        return may_leave(sigma_rad, t_s[-1] - t_s[0])

    def _begin(self, problem: SmoothingProblem, row: int) -> None:
        """Place a keyframe where its search starts."""
        at = problem.start.at(slice(row, row + 1))
        if len(self) and not self._keep:
            at = problem.begun(row, problem.motion.predict(self._newest, np.array([row - 1])))
        self._linear.append(problem, row, at)
        if problem.attitude_known[row]:
            self._is_slow = problem.t_s[row] - self._attitude_s > SLOW_S
            self._attitude_s = float(problem.t_s[row])
        self._new, self._newest = self._new + 1, at

    def _solve(self) -> None:
        """Solve with new keyframes, and again while that moves estimates too far."""
        if not self._new:
            return
        linear = self._linear
        self._pass(self._far())  # where the last estimates are
        times = repeats_at(linear.rows.steps, self._is_slow)
        if times is not None:
            self._relinearise(times)
        self._new, self._solved_s = 0, float(linear.rows.t_s[-1])
        end = linear.oldest + len(linear)
        self._blocks.append(end - 1)
        self._newest = self._estimated(end - 1, end)

    def _relinearise(self, times: float = 1.0) -> None:
        """Relinearise states that have moved too far, until none has."""
        share = 1.0
        for _ in range(REPEATS):
            far, before = self._far(times), self._linear.rows.steps.copy()
            if not far.any():
                return
            self._pass(far, share)
            share = relaxed(share, self._linear.rows.steps, before)

    def _pass(self, far: BoolArray, share: float = 1.0) -> None:
        """Linearise some keyframes, (n,), a share of the way to their estimates, and solve."""
        linear, which = self._linear, np.flatnonzero(far)
        if len(which):
            steps, none = share * linear.rows.steps[which], np.zeros(len(linear.constants))
            linear.relinearise(which, retracted(linear.states.at(which), steps, none))
        linear.solve()
        linear.substitute()
        self._updates += 1

    def _far(self, times: float = 1.0) -> BoolArray:
        """Return which keyframes are too far from where they are linearised, and may be moved."""
        if self._keep:
            return np.zeros(len(self._linear), dtype=np.bool_)
        far = moved_far(self._linear.rows.steps, times)
        far[0] &= not self._linear.oldest or has_gyroscope(self._linear.rows.steps)
        return far

    def _estimated(self, begin: int, end: int) -> States:
        """Return the estimates of keyframes ``begin`` to ``end - 1``."""
        linear = self._linear
        begin, end = begin - linear.oldest, end - linear.oldest
        steps = linear.rows.steps[begin:end]
        at = linear.states.at(slice(begin, end))
        return retracted(at, steps, linear.end[steps.shape[1] :][: len(linear.constants)])

    def _estimates(self, begin: int, end: int) -> Departed:
        first, stop = begin - self._linear.oldest, end - self._linear.oldest
        rows, marginals = (
            self._linear.rows.between(first, stop),
            self._linear.marginals(first, stop),
        )
        last = np.trace(marginals.covariance[-1, ROTATION, ROTATION])
        self._turn_sigma_rad[end - 1] = float(np.sqrt(last))
        return departed(
            rows.t_s,
            self._estimated(begin, end),
            rows.steps,
            marginals,
            keep_linearisation=self._keep,
            solver="chain",
            updates=self._updates,
        )


def solve_fixed_lag(
    problem: SmoothingProblem,
    lag_s: float,
    *,
    keep_linearisation: bool = False,
    opening: Opening | None = None,
) -> Solution:
    """Return each keyframe as known from the data up to at least ``lag_s`` after it.

    Parameters as in ``ChainWindow``, blocks of a second; and as in ``solve.fixed_lag``.
    """

    def leaving(of: SmoothingProblem, end: int) -> list[Departed | None]:
        # An opening holds an arbitrary heading fixed: it has no better place to linearise.
        keep = keep_linearisation and of is problem
        window = ChainWindow(lag_s, min(BLOCK_S, lag_s), keep_linearisation=keep)
        parts = [window.update(of, row) for row in steps(end)]
        return [*parts, window.rest()] if end == len(of.t_s) else parts

    return joined_solution(opened(leaving, problem, opening))


def solve_forward(
    problem: SmoothingProblem,
    lag_s: float,
    *,
    keep_linearisation: bool = False,
    opening: Opening | None = None,
) -> Solution:
    """Return each keyframe as known from the data up to it: what a filter estimates.

    Parameters as in ``ChainWindow``, and as in ``solve.fixed_lag``; states up to ``lag_s`` back are
    still linearised anew.
    """

    def newest(of: SmoothingProblem, end: int) -> list[Departed | None]:
        window = ChainWindow(lag_s, 0.0, keep_linearisation=keep_linearisation)
        return [window.filter(of, row) for row in steps(end)]

    return replace(joined_solution(opened(newest, problem, opening)), cross=None)
