"""A sliding window over a flight: keyframes are smoothed by what comes within a lag after them.

GTSAM's incremental smoother estimates; covariances are of the same factors, linearised at the same
states, by ``Elimination``.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import gtsam
import numpy as np

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.geometry.rotation_kernel import right_jacobian
from fgnav.geometry.rotations import exp, transpose
from fgnav.graph.build import Layout
from fgnav.graph.custom import touched_keyframes
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import POSITION, ROTATION, States
from fgnav.solve.elimination import Marginals
from fgnav.solve.failures import in_words
from fgnav.solve.sliding.incremental import IncrementalSmoother
from fgnav.solve.sliding.keyframes import Keyframes
from fgnav.solve.sliding.relinearisation import (
    BLOCK_S,
    REPEATS,
    SLOW_S,
    is_rough,
    may_leave,
    moved_far,
    relaxed,
    repeats_at,
)

_ROUNDING_S = 1e-6


class FixedLag:
    """The newest keyframes of a flight, each smoothed by what came after it.

    Parameters
    ----------
    lag_s : float
        Keyframes leave when they are known from the data up to this long after them, or up to a
        block longer.
    block_s : float
        The graph is solved whenever this much has come; 0 solves it at every keyframe.
    keep_linearisation : bool
        Whether states stay linearised at ``problem.start``: for flights whose heading only later
        motion determines. What has been marginalised cannot be relinearised, so such a window would
        become too sure of it.
    """

    def __init__(
        self,
        lag_s: float,
        block_s: float = BLOCK_S,
        *,
        keep_linearisation: bool = False,
    ) -> None:
        self._lag_s, self._block_s, self._keep = lag_s, block_s, keep_linearisation
        self._smoother: IncrementalSmoother | None = None
        self._keyframes = Keyframes()
        self._steps: FloatArray = np.empty((0, 0))
        self._constant_steps: FloatArray = np.empty(0)
        self._turn_sigma_rad: dict[int, float] = {}  # of keyframes when last asked for
        self._departed = 0  # keyframes that have left, not all of them marginalised
        self._blocks: list[int] = []  # last keyframes of those that have not left, or just did
        self._updates = 0
        self._newest: States
        self._attitude_s = np.inf  # of the last keyframe with an attitude of its own
        self._is_slow = False  # whether such keyframes are far apart

    def __len__(self) -> int:
        """Return the number of keyframes in the window."""
        return len(self._t_s) - self._departed

    @property
    def isam2(self) -> gtsam.ISAM2:
        """The tree of GTSAM's smoother."""
        return self._alive.isam2

    @property
    def oldest(self) -> int:
        """Number of the oldest keyframe that a factor may still touch."""
        return self._departed

    def advance(
        self, problem: Problem, row: int, custom: Sequence[gtsam.NonlinearFactor] = ()
    ) -> range:
        """Take a keyframe in, solve when a block is full; return which keyframes leave by that.

        Parameters
        ----------
        problem : Problem
        row : int
            Of the keyframe in the problem; its number in the graph counts those taken in.
        custom : sequence of gtsam.NonlinearFactor
            Custom factors that touch no later keyframe.

        Raises
        ------
        NoSolutionError
            If the data leave a state open, by name.
        """
        self._enter(problem, row)
        for factor in custom:
            self._enter_custom(factor)
        before = self._blocks[-1] if self._blocks else 0
        is_full = self._t_s[-1] - self._t_s[before] > self._block_s - _ROUNDING_S
        if not is_full:
            return range(self._departed, self._departed)
        self._solve()
        first, limit_s = self._departed, self._t_s[-1] - self._lag_s + _ROUNDING_S
        for last in self._blocks:
            if self._t_s[last] <= limit_s:
                self._departed = max(self._departed, last + 1)
        self._blocks = [k for k in self._blocks if k >= self._departed or k == self._blocks[-1]]
        return range(first, self._departed)

    def update(
        self, problem: Problem, row: int, custom: Sequence[gtsam.NonlinearFactor] = ()
    ) -> Solution | None:
        """Take a keyframe in; return those that leave by that, if any; see ``advance``."""
        leaving = self.advance(problem, row, custom)
        return self._estimates(leaving) if leaving else None

    def latest(self) -> Solution:
        """Return the newest keyframe, known from the data up to it and no further."""
        self._solve()
        return self._estimates(range(len(self._t_s) - 1, len(self._t_s)))

    def flush(self) -> Solution:
        """Return all keyframes that have not left, known from all data so far.

        Raises
        ------
        NoSolutionError
            If there is none.
        """
        if not len(self):
            raise NoSolutionError("window: no keyframe is left in it")
        self._solve()
        self._relinearise()
        return self._estimates(range(self._departed, len(self._t_s)))

    def _enter(self, problem: Problem, row: int) -> None:
        """Put a keyframe where the motion leads, and what it measured into the next update."""
        k, at, before = len(self._t_s), problem.start.at(slice(row, row + 1)), None
        if k == 0:
            self._smoother = IncrementalSmoother(Layout.of(problem))
        elif self._keep:
            before = problem.start.at(slice(row - 1, row))
        else:
            before = self._newest
            at = problem.begun(row, problem.motion.predict(before, np.array([row - 1])))
        arcs = self._keyframes.append(problem, row, at, before)
        if arcs is not None:
            self._alive.enter_arcs(*arcs, k)
        self._newest = at
        if problem.attitude_known[row]:
            self._is_slow = self._t_s[-1] - self._attitude_s > SLOW_S
            self._attitude_s = self._t_s[-1]

    def _enter_custom(self, factor: gtsam.NonlinearFactor) -> None:
        numbers = touched_keyframes(factor) or [len(self._t_s) - 1]
        self._keyframes.add(factor, numbers)
        if len(numbers) > 1:
            self._alive.is_chain = False

    def _solve(self) -> None:
        """Update GTSAM's smoother with what has come; what has left is marginalised by that."""
        if self._keyframes.graph.empty():
            return
        self._marginalise()
        self._update(self._far())
        n = len(self._t_s)
        self._blocks.append(n - 1)
        times = None if self._keep else repeats_at(self._steps, self._is_slow)
        if times is not None:
            self._relinearise(times)
        self._newest = self._estimated(range(n - 1, n))

    def _marginalise(self) -> None:
        """Take out keyframes that have left, a block of them at once, where they may."""
        smoother, keyframes = self._alive, self._keyframes
        first, oldest = keyframes.oldest, min(self._departed, smoother.end - 1)
        if oldest <= first or self._t_s[oldest] - self._t_s[first] < BLOCK_S - _ROUNDING_S:
            return
        if not self._may_leave(oldest):
            return
        with self._failing():
            smoother.marginalise(oldest)
        self._turn_sigma_rad = {k: s for k, s in self._turn_sigma_rad.items() if k >= oldest - 1}
        self._steps = self._steps[oldest - first :]
        keyframes.forget(oldest - first)

    def _may_leave(self, oldest: int) -> bool:
        """Return True if the attitude is known where the window would begin."""
        if self._keep:
            return True
        first = self._keyframes.oldest
        sigma_rad = self._turn_sigma_rad.get(oldest - 1)  # as that keyframe left: next to it
        if sigma_rad is None:
            i = oldest - first
            sigma_rad = _turn_sigma_rad(self._keyframes.marginals(i, i + 1))
        return may_leave(sigma_rad, self._t_s[-1] - self._t_s[first])

    def _update(self, far: BoolArray, share: float = 1.0) -> None:
        """Solve with what has come, some keyframes linearised where they are estimated.

        Or a share of the way there, if all are.
        """
        smoother, keyframes, rows = self._alive, self._keyframes, np.flatnonzero(far)
        if len(rows):
            share = share if self._is_free else 1.0  # GTSAM itself goes the whole way
            keyframes.relinearise(rows, share * self._steps[rows])
            is_led = rows[0] == 0 and (keyframes.oldest > 0 or share < 1.0)
            if is_led and self._is_free:
                self._smoother = smoother = keyframes.restarted()
                rows = rows[:0]
        with self._failing():
            relinearised = (keyframes.oldest + rows).tolist()
            smoother.update(keyframes.graph, keyframes.values, len(self._t_s), relinearised)
            self._steps, self._constant_steps = smoother.steps()
        keyframes.next_update()
        self._updates += 1

    @contextmanager
    def _failing(self) -> Iterator[None]:
        """Say in words what of GTSAM fails; the smoother is of no more use then."""
        try:
            yield
        except RuntimeError as error:
            self._smoother = None
            layout = self._keyframes.layout
            raise in_words(error, layout.width, layout.constants, self._t_s.__getitem__) from error
        except Exception:  # of a custom factor: as it is
            self._smoother = None
            raise

    @property
    def _t_s(self) -> list[float]:
        """Times of all keyframes so far."""
        return self._keyframes.t_s

    @property
    def _alive(self) -> IncrementalSmoother:
        if self._smoother is None:
            raise NoSolutionError("window: it has no keyframe, or has failed; start another one")
        return self._smoother

    def _relinearise(self, times: float = 1.0) -> None:
        """Relinearise states that have moved too far, until none has."""
        share = 1.0
        for _ in range(REPEATS):
            far, before = self._far(times), self._steps
            if not far.any():
                return
            self._update(far, share)
            share = relaxed(share, self._steps, before)

    def _far(self, times: float = 1.0) -> BoolArray:
        """Select keyframes that are too far from their linearization points and may be moved."""
        smoother = self._alive
        if self._keep or not len(self._steps):
            return np.zeros(len(self._steps), dtype=np.bool_)
        far = moved_far(self._steps, times)
        if self._is_free:
            return far
        for i in np.flatnonzero(far) if not smoother.is_chain else (0,):
            far[i] &= not smoother.is_fixed(smoother.oldest + int(i))
        return far

    @property
    def _is_free(self) -> bool:
        """Return True if the oldest keyframe, too, may be linearised anew."""
        return self._keyframes.layout.gyroscope and self._alive.is_chain

    def _estimated(self, numbers: range) -> States:
        """Return the present estimates of keyframes and constants."""
        oldest = self._keyframes.oldest
        steps = self._steps[numbers.start - oldest : numbers.stop - oldest]
        return self._keyframes.states(numbers).moved(steps, self._constant_steps)

    def _estimates(self, numbers: range) -> Solution:
        """Return present estimates of keyframes with their covariances."""
        oldest = self._alive.oldest
        steps = self._steps[numbers.start - oldest : numbers.stop - oldest]
        marginals = self._keyframes.marginals(numbers.start - oldest, numbers.stop - oldest)
        self._turn_sigma_rad[numbers[-1]] = _turn_sigma_rad(marginals)
        if self._keep:
            marginals = _at_estimates(marginals, steps)
        rough = is_rough(steps, marginals.covariance) & (not self._keep)
        states, n = self._estimated(numbers), len(numbers)
        return Solution(
            states=states,
            covariance=marginals.covariance,
            cross=marginals.cross,
            constant_covariance=np.tile(marginals.constant, (n, 1, 1)),
            constant_cross=marginals.constant_cross,
            converged=not rough.any(),
            refused=rough,
            constants=np.tile(states.constants, (n, 1)),
            solver="gtsam.IncrementalFixedLagSmoother",
            updates=self._updates,
        )


def _at_estimates(marginals: Marginals, steps: FloatArray) -> Marginals:
    """Return covariances along the tangents of the estimates, not of where these are linearised.

    ``Exp(s + e) = Exp(s) Exp(J_r(s) e)``: a step of a radian turns the axes by as much. That of the
    keyframe after the last is not there: its axes are the last one's.
    """
    T = np.tile(np.eye(steps.shape[1]), (len(steps), 1, 1))
    T[:, ROTATION, ROTATION] = [right_jacobian(turn) for turn in steps[:, ROTATION]]
    T[:, POSITION, POSITION] = transpose(exp(steps[:, ROTATION]))
    after = transpose(np.concatenate([T[1:], T[-1:]]))
    return Marginals(
        T @ marginals.covariance @ transpose(T),
        T @ marginals.cross @ after,
        marginals.constant,
        T @ marginals.constant_cross,
    )


def _turn_sigma_rad(marginals: Marginals) -> float:
    """Return the 1-sigma of the last keyframe's rotation, all axes."""
    return float(np.sqrt(np.trace(marginals.covariance[-1, ROTATION, ROTATION])))
