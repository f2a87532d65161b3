"""The whole flight at once: Gauss-Newton over the chain, damped where its cost does not fall."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.graph.factors.antenna_phase import StackedRows
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import ROTATION, States
from fgnav.solve.chain import back_kernel
from fgnav.solve.chain.arcs import Border, LinearPhases
from fgnav.solve.chain.linear import Links, Prior, linearise
from fgnav.solve.failures import weakest_state

_CHUNK = 128  # keyframes linearised at once: 2 MB
_ITERATIONS = 300  # in outages a search creeps along a valley: 143 where it took most
_STEP_SIGMAS = 0.01  # a next Newton step below this share of every sigma: it is a minimum
_NEAR = 1.0  # promised decreases below it shrink with their square, as Newton's do
_NEARER = 0.01  # where a Newton step is not short yet: it is ten times as far as a damped one
_KEPT = 0.75  # share of a promise that a good model keeps (Madsen et al., 2004, equation 2.20)
_DAMPING, _MOST_DAMPING = 0.1, 1e8  # 1/rad2, first and last of Levenberg's on rotations


class _Linear(NamedTuple):
    """A flight linearised and solved."""

    cost: float  # where it is linearised
    least: float  # of the linear problem
    steps: FloatArray  # (n, D)
    end: FloatArray  # (D + b,), steps of the last state and the constants
    end_covariance: FloatArray  # (D + b, D + b)
    arcs: tuple[FloatArray, ...]  # where the A of each block is estimated


class _Chain:
    """Elimination of one flight again and again, in memory of 8 kB a keyframe.

    Attributes
    ----------
    root : ndarray, shape (n, D, D)
    gain : ndarray, shape (n - 1, D, D + b + 1)
        See ``kernel``; of the states solved last.
    """

    def __init__(self, problem: SmoothingProblem) -> None:
        self._problem = problem
        n, D, b = len(problem.t_s), problem.width, problem.constants.width
        self.border = Border(problem.phase)
        for row in range(n):
            self.border.append(row)
        beside = self.border.width
        self.root = np.zeros((n, D, D))
        self.gain = np.empty((n - 1, D, D + b + beside + 1))
        self._links = Links.empty(min(n, _CHUNK + 1), D, b, beside)
        self._stacked: dict[int, StackedRows | None] = {}  # by the chunk's first keyframe
        self._prior = Prior.of(problem)
        self._forward = np.empty_like(self._links.node)
        self._by_rows = False

    def solved(
        self,
        states: States,
        damping: float = 0.0,
        arcs: Sequence[FloatArray] = (),
        most: float = np.inf,
    ) -> _Linear:
        """Return the linear problem at states and arcs, solved.

        With damping, 1/rad2, on every rotation. Where the cost is more than ``most`` that alone is
        returned, or as much of it as exceeds that: squares only add to it.

        Raises
        ------
        NoSolutionError
            Naming the state that the data leave open, and when.
        """
        cost, least, end, covariance = self.newest(states, damping, arcs, most)
        if cost > most:
            return _Linear(cost, cost, *(np.empty(0),) * 3, ())
        steps = np.empty((len(self.root), states.width))
        self.border.substitute(self.gain, end, steps)
        moved = self.border.moved()
        return _Linear(cost, least, steps, end, covariance, moved)

    def newest(
        self,
        states: States,
        damping: float = 0.0,
        arcs: Sequence[FloatArray] = (),
        most: float = np.inf,
    ) -> tuple[float, float, FloatArray, FloatArray]:
        """Return cost, least cost, and the step of the last state and the constants, ± covariance.

        See ``solved``.
        """
        self.border.linearise(arcs)
        cost, information = self._eliminated(states, damping, most)
        end = np.empty(len(information) - 1)
        covariance = np.empty((len(end), len(end)))
        if cost > most:
            return cost, cost, end, covariance
        least = back_kernel.newest(information, covariance, end)
        if not np.isfinite(least):
            if self._by_rows:
                raise self._open(information, -1)
            self._by_rows = True  # for good: squares have not digits enough
            return self.newest(states, damping, arcs, most)
        return cost, float(least), end, covariance

    def _open(self, information: FloatArray, k: int) -> NoSolutionError:
        problem = self._problem
        return weakest_state(information, problem.width, problem.constants, float(problem.t_s[k]))

    def cost(self, states: States, arcs: Sequence[FloatArray]) -> float:
        """Return the cost at states and arcs."""
        self.border.linearise(arcs)
        return self.border.cost + sum(links.cost() for _, links in self._linearised(states))

    def _eliminated(self, states: States, damping: float, most: float) -> tuple[float, FloatArray]:
        """Fill factors and gains; return the cost, and the information at the last keyframe.

        Until the cost exceeds ``most``.
        """
        forward, turns, cost = self._forward, np.arange(states.width)[ROTATION], self.border.cost
        for first, entering in self._linearised(states):
            cost += entering.cost()
            if cost > most:
                break
            entering.node[:, turns, turns] += damping
            if first == 0:
                forward[0] = entering.node[0]
                self.border.begin(forward[0])
                continue
            begin, count = first - 1, len(entering.node)
            motion, node = (part[: count + 1] for part in self._links)
            kept = slice(begin, None)
            parts = (motion, node, forward[: count + 1], self.root[kept], self.gain[kept])
            failed = self.border.eliminate(parts, 0, by_rows=self._by_rows, offset=begin)
            if failed >= 0:
                raise self._open(forward[failed], begin + failed)
            forward[0] = forward[count]
        return cost, forward[0]

    def _linearised(self, states: States) -> Iterator[tuple[int, Links]]:
        """Yield the first of some keyframes and what enters with them: the first, then chunks.

        What entered before the first of a chunk is overwritten.
        """
        links, n = self._links, len(self._problem.t_s)
        rows, none = np.zeros(1, np.int64), states.at(slice(0, 0))
        phases = self._phases_of(rows)
        linearise(self._problem, rows, states.at(rows), none, links, rows, phases, self._prior)
        yield 0, Links(links.motion[:1], links.node[:1])
        for first in range(1, n, _CHUNK):
            count = min(_CHUNK, n - first)
            into, rows = np.arange(1, count + 1), np.arange(first, first + count)
            at, before = (states.at(slice(k, k + count)) for k in (first, first - 1))
            linearise(self._problem, rows, at, before, links, into, self._phases_of(rows))
            yield first, Links(links.motion[1 : count + 1], links.node[1 : count + 1])

    def _phases_of(self, rows: IntArray) -> LinearPhases | None:
        """Return the phases of a chunk, whose rows are made once: 1 kB a keyframe."""
        phase, first = self._problem.phase, int(rows[0])
        if phase is None:
            return None
        if first not in self._stacked:
            self._stacked[first] = phase.stacked(rows)
        return LinearPhases(self._stacked[first], self.border.at)


def solve_batch(
    problem: SmoothingProblem,
    *,
    begin: States | None = None,
    most: int = _ITERATIONS,
) -> Solution:
    """Return the minimum of the whole graph with its covariances.

    What a Newton step promises of the cost is its squared length in the measure of the information:
    no state moves by more sigmas than its root. Near a minimum promises fall with their square, so
    the ratio of the last two bounds the next step, which need not be computed. Where the cost rises
    rotations have gone too far, and information grows that they stay where they are; it shrinks
    where a step kept its promise (Marquardt's rule), for where it did not the residuals' own
    curvature outweighs their slopes', and a Newton step never leads to the minimum. Promises then
    shrink in a ratio of their own, and what remains is the sum of their series, until it is so
    little that a Newton step is short as well.

    Parameters
    ----------
    problem : SmoothingProblem
    begin : States, optional
        Where the search begins, instead of ``problem.start``: where a window ended.
    most : int
        Iterations after which a search is given up.

    Raises
    ------
    NoSolutionError
        Naming the state that the data leave open, and when.

    References
    ----------
    Madsen, Nielsen & Tingleff, Methods for Non-Linear Least Squares Problems, 2004, section 3.2.
    """
    chain, D = _Chain(problem), problem.width
    states = problem.start if begin is None else begin
    arcs: tuple[FloatArray, ...] = ()
    linear, previous, damping, iterations = chain.solved(states), np.inf, 0.0, 1
    is_kept, aim = True, _STEP_SIGMAS**2  # the last promise, as far as damping may be lowered
    if linear.arcs:  # linear: at once where states would have them, which changes the cost alone
        arcs = linear.arcs
        linear = linear._replace(cost=chain.cost(states, arcs))
    while iterations < most and damping < _MOST_DAMPING:
        promised = max(linear.cost - linear.least, 0.0)  # of large costs it is rounding
        near = promised < min(previous, _NEAR) and previous < np.inf
        ratio = promised / previous if near else 1.0
        is_last = promised * ratio < (_STEP_SIGMAS**2 if damping == 0.0 else aim * (1.0 - ratio))
        if is_last and damping == 0.0:
            return _solution(chain, states, linear, iterations, is_short=True)
        trial = states.moved(linear.steps, linear.end[D : D + len(states.constants)])
        lower = damping / 10 if is_kept else damping
        lower = 0.0 if is_last or lower < _DAMPING else lower
        tried = chain.solved(trial, lower, linear.arcs, most=linear.cost)
        iterations += 1
        if tried.cost <= linear.cost:
            if is_last and tried.cost - tried.least < _STEP_SIGMAS**2:  # which is not gone
                end = _solution(chain, trial, tried, iterations)
                return replace(end, states=trial, converged=True, cost=tried.cost)
            if is_last:
                aim, lower = _NEARER * aim, damping
                tried = chain.solved(trial, damping, linear.arcs)
            is_kept = linear.cost - tried.cost > _KEPT * promised
            previous = promised if lower == damping else np.inf
            arcs, states, linear, damping = linear.arcs, trial, tried, lower
        else:
            is_kept, damping, previous = False, max(10 * damping, _DAMPING), np.inf
            linear = chain.solved(states, damping, arcs)
    return _solution(chain, states, chain.solved(states, arcs=arcs), iterations)


def covariance_at(problem: SmoothingProblem, states: States) -> Solution:
    """Return states as they are given, with the covariances of the graph linearised there.

    Nothing is searched: at the truth that is a posterior Cramer-Rao bound. ``converged`` tells
    whether the minimum is there, too.

    Parameters
    ----------
    problem : SmoothingProblem
    states : States

    Raises
    ------
    NoSolutionError
        Naming the state that the data leave open, and when.
    """
    chain = _Chain(problem)
    linear = chain.solved(states)
    solution = _solution(chain, states, linear, 1)
    return replace(solution, states=states, cost=linear.cost)


def _solution(
    chain: _Chain, states: States, linear: _Linear, iterations: int, *, is_short: bool = False
) -> Solution:
    """Return the end of a last step if that is known to be short or is, else where it begins."""
    n, D = linear.steps.shape
    b = len(states.constants)
    covariance, cross = chain.root, np.empty((n - 1, D, D))
    shared = np.empty((n, D, b))
    out = covariance, cross, shared
    chain.border.marginals(0, chain.gain, chain.root, linear.end_covariance, out)
    constant = linear.end_covariance[D : D + b, D : D + b]
    sigma = np.sqrt(np.einsum("nii->ni", covariance))
    converged = is_short or bool((np.abs(linear.steps) < _STEP_SIGMAS * sigma).all())
    return Solution(
        states=states.moved(linear.steps, linear.end[D : D + b]) if converged else states,
        covariance=covariance,
        cross=cross,
        constant_covariance=np.broadcast_to(constant, (n, b, b)),
        constant_cross=shared,
        converged=converged,
        cost=linear.least if converged else linear.cost,
        solver="descent by block elimination",
        updates=iterations,
    )


def log_evidence(problem: SmoothingProblem, states: States) -> float:
    """Return the log marginal likelihood of all that was measured, linearised at states.

    ``-least / 2 - log det(H) / 2 + log det(whitening)`` of the linearised chain with Hessian H:
    states and constants are integrated out (Laplace). Constant terms are left out, and so is what a
    sensor's whitening does not tell: a motion or a measurement may offer ``log_white(rows)``, the
    sum of the log determinants of its intervals' or measurements' whitening, an array of their
    numbers given. Without it its noise is taken for a constant. The prior of the motion's ``aux``
    is counted always.

    References
    ----------
    Särkkä & Svensson, Bayesian Filtering and Smoothing, 2nd edition, section 16.3.
    """
    chain, aux = _Chain(problem), problem.motion.aux
    linear = chain.solved(states)
    _, white = problem.motion.prior(len(states.constants))
    total = -linear.least / 2 + np.linalg.slogdet(white[:, :aux])[1]
    total -= np.log(np.einsum("nii->ni", chain.root[:-1])).sum()
    total += np.linalg.slogdet(linear.end_covariance)[1] / 2 - chain.border.log_root
    intervals = np.arange(len(problem.t_s) - 1)
    total += _log_white(problem.motion, intervals)
    for measurement in problem.measurements:
        total += _log_white(measurement, np.arange(len(measurement.row)))
    return float(total)


def _log_white(model: object, rows: IntArray) -> float:
    offered = getattr(model, "log_white", None)
    return float(offered(rows)) if offered is not None else 0.0
