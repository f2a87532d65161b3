"""The minimum of a whole flight: Gauss-Newton by GTSAM's elimination, damped where the cost rises.

The decrease that a linear model predicts of a step is its squared length in the measure of the
information: no state moves by more sigmas than its root. Near a minimum predictions fall with their
square, so the ratio of the last two bounds the next step, which need not be computed. Where the
cost rises rotations have gone too far, and damping holds them; it falls where the gain ratio, of
what the cost fell to what was predicted, is near one (Marquardt's rule [1]_). Where the residuals'
own curvature outweighs their slopes' a Newton step never ends at the minimum: predictions of damped
steps then shrink in a constant ratio, and what remains is the sum of their series, until it is so
little that a Newton step is short as well.

``gtsam.LevenbergMarquardtOptimizer`` takes minutes where carrier phases have gaps, and its damping
holds positions as much as rotations.

References
----------
.. [1] Madsen, Nielsen & Tingleff, Methods for Non-Linear Least Squares Problems, 2004, section 3.2.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import gtsam
import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph import keys
from fgnav.graph.build import Layout, flight_values
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.solve.elimination import Elimination
from fgnav.solve.linear import linearise

STEP_SIGMAS = 0.01  # a next Newton step below this share of every sigma: it is a minimum
ITERATIONS = 300  # in outages a search creeps along a valley: 143 where it took most
_NEAR = 1.0  # predicted decreases below it shrink with their square, as Newton's do
_NEARER = 0.01  # where a Newton step is not short yet: it is ten times as far as a damped one
_GAIN = 0.75  # gain ratio of a good model (Madsen et al., 2004, equation 2.20)
_DAMPING, _MOST_DAMPING = 0.1, 1e8  # 1/rad2, first and last of Levenberg's on rotations


class Minimum(NamedTuple):
    """Minimum that a search has found."""

    solution: Solution
    log_evidence: float  # log marginal likelihood of all that was measured, but for a constant


class _Point(NamedTuple):
    """Point of a search: states, and ambiguities by key."""

    states: States
    arcs: Mapping[int, FloatArray]


class _Linear(NamedTuple):
    """A flight linearised at a place."""

    at: _Point
    cost: float
    factors: list[list[gtsam.GaussianFactor]]  # by the oldest keyframe of each


class _Eliminated(NamedTuple):
    """The same, eliminated."""

    linear: _Linear
    elimination: Elimination
    cost: float  # at its states; of ambiguities as states would have them, at the beginning

    @property
    def least(self) -> float:
        """The cost to which a step would lead, if all were linear."""
        return self.linear.cost - self.elimination.predicted_decrease

    @property
    def predicted(self) -> float:
        """The decrease that a step would bring; of large costs it is rounding."""
        return max(self.cost - self.least, 0.0)

    def moved(self) -> _Point:
        """Return where a step leads."""
        at, (steps, constants, arcs) = self.linear.at, self.elimination.step()
        moved = {key: at.arcs[key] + step for key, step in arcs.items()}
        return _Point(at.states.moved(steps, constants), moved)


class _Flight:
    """A problem and custom factors, linearised again and again."""

    def __init__(self, problem: Problem, custom: Sequence[gtsam.NonlinearFactor]) -> None:
        self._problem, self._layout = problem, Layout.of(problem)
        phase, last = problem.phase, len(problem.t_s) - 1
        self._arcs: dict[int, list[tuple[int, int]]] = {}  # that end with a keyframe
        single = list(custom)  # factors that are linearised one by one
        if phase is not None:
            for k, of in phase.ending(last).items():
                self._arcs[k] = [(keys.arcs(j), phase.blocks[j].size) for j in of]
            single += [phase.factor(i, k) for i, k in enumerate(phase.row.tolist())]
            single += [phase.transition_factor(j) for j in range(len(phase.blocks))]
        self._end = {key: k for k, of in self._arcs.items() for key, _ in of}
        self._graph, self._first = gtsam.NonlinearFactorGraph(), [self._oldest(f) for f in single]
        for factor in single:
            self._graph.add(factor)

    def point(self, states: States) -> _Point:
        """Return states, with all ambiguities at zero."""
        return _Point(states, {key: np.zeros(n) for of in self._arcs.values() for key, n in of})

    def linear(self, at: _Point) -> _Linear:
        """Return the problem linearised."""
        factors, cost = linearise(self._problem, at.states)
        if self._first:
            values = flight_values(self._problem, at.states, at.arcs)
            linear = self._graph.linearize(values)
            for j, k in enumerate(self._first):
                if (factor := linear.at(j)) is not None:  # a factor that is not active is none
                    factors[k].append(factor)
            cost += 2 * self._graph.error(values)
        return _Linear(at, cost, factors)

    def eliminated(self, linear: _Linear, damping: float = 0.0) -> _Eliminated:
        """Eliminate the linear system, with damping, 1/rad2, on every rotation."""
        elimination = Elimination(self._layout, lambda k: float(self._problem.t_s[k]))
        rows = np.hstack([np.sqrt(damping) * np.eye(3), np.zeros((3, 3))])
        unit = gtsam.noiseModel.Unit.Create(3)
        for k, factors in enumerate(linear.factors):
            held = [gtsam.JacobianFactor(keys.pose(k), rows, np.zeros(3), unit)] if damping else []
            elimination.append([*factors, *held], self._arcs.get(k, ()))
        elimination.solve()
        return _Eliminated(linear, elimination, linear.cost)

    def _oldest(self, factor: gtsam.NonlinearFactor) -> int:
        """Return the keyframe with which a factor is eliminated; 0 where it touches none."""
        touched = [key for key in factor.keys() if not keys.is_constant(key)]  # noqa: SIM118
        return min((self._end.get(key, keys.index(key)) for key in touched), default=0)


def gauss_newton(
    problem: Problem,
    *,
    begin: States | None = None,
    custom: Sequence[gtsam.NonlinearFactor] = (),
    most: int = ITERATIONS,
) -> Minimum:
    """Return the minimum that a search ends in; not converged if it ends in none.

    Parameters
    ----------
    problem : Problem
    begin : States, optional
        Where the search begins, instead of ``problem.start``: where a window ended.
    custom : sequence of gtsam.NonlinearFactor
        Custom factors.
    most : int
        Iterations after which a search is given up.

    Raises
    ------
    NoSolutionError
        Naming the state that the data leave open, and when.
    """
    flight = _Flight(problem, custom)
    here = flight.eliminated(flight.linear(flight.point(problem.start if begin is None else begin)))
    trial, iterations, damping, previous = here.moved(), 1, 0.0, np.inf
    is_good, aim = True, STEP_SIGMAS**2  # the prediction below which damping may be lowered
    if trial.arcs:  # linear: at once where states would have them, which changes the cost alone
        here = here._replace(cost=flight.linear(_Point(here.linear.at.states, trial.arcs)).cost)
    while iterations < most and damping < _MOST_DAMPING:
        predicted = here.predicted
        near = predicted < min(previous, _NEAR) and previous < np.inf
        ratio = predicted / previous if near else 1.0
        is_last = predicted * ratio < (STEP_SIGMAS**2 if damping == 0.0 else aim * (1.0 - ratio))
        if is_last and damping == 0.0:
            return _minimum(problem, here, iterations, trial.states)
        lower = damping / 10 if is_good else damping
        lower = 0.0 if is_last or lower < _DAMPING else lower
        linear = flight.linear(trial)
        iterations += 1
        if linear.cost > here.cost:
            is_good, damping, previous = False, max(10 * damping, _DAMPING), np.inf
            here = flight.eliminated(here.linear, damping)._replace(cost=here.cost)
        else:
            tried = flight.eliminated(linear, lower)
            if is_last and tried.predicted < STEP_SIGMAS**2:  # which is not gone
                return _minimum(problem, tried, iterations, trial.states)
            if is_last:
                aim, lower = _NEARER * aim, damping
                tried = flight.eliminated(linear, damping)
            is_good = here.cost - tried.cost > _GAIN * predicted
            previous = predicted if lower == damping else np.inf
            here, damping = tried, lower
        trial = here.moved()
    return _minimum(problem, flight.eliminated(here.linear) if damping else here, iterations, None)


def elimination_at(
    problem: Problem, states: States, custom: Sequence[gtsam.NonlinearFactor] = ()
) -> Elimination:
    """Return a problem and custom factors linearised at states and eliminated.

    Raises
    ------
    NoSolutionError
        If a variable is in no factor, by name.
    """
    flight = _Flight(problem, custom)
    return flight.eliminated(flight.linear(flight.point(states))).elimination


def posterior_at(problem: Problem, states: States) -> Solution:
    """Return states as they are given, with the covariances of the graph linearised there.

    Nothing is searched: at the truth that is a posterior Cramer-Rao bound. ``converged`` tells
    whether the minimum is there, too.

    Raises
    ------
    NoSolutionError
        Naming the state that the data leave open, and when.
    """
    flight = _Flight(problem, ())
    linear = flight.linear(flight.point(states))
    return replace(_minimum(problem, flight.eliminated(linear), 1, None).solution, states=states)


def _minimum(problem: Problem, here: _Eliminated, iterations: int, end: States | None) -> Minimum:
    """Return the end of a search; None: it was given up, perhaps next to a minimum."""
    elimination, n, b = here.elimination, len(problem.t_s), problem.constants.width
    marginals = elimination.marginals()
    if end is None:
        steps, constants, _ = elimination.step()
        sigma = np.sqrt(np.einsum("nii->ni", marginals.covariance))
        if (np.abs(steps) < STEP_SIGMAS * sigma).all():
            end = here.linear.at.states.moved(steps, constants)
    solution = Solution(
        states=here.linear.at.states if end is None else end,
        covariance=marginals.covariance,
        cross=marginals.cross,
        constant_covariance=np.broadcast_to(marginals.constant, (n, b, b)),
        constant_cross=marginals.constant_cross,
        converged=end is not None,
        cost=here.cost if end is None else here.least,
        solver="Gauss-Newton by gtsam.EliminateQR",
        updates=iterations,
    )
    return Minimum(solution, -here.least / 2 - elimination.log_root + _log_white(problem))


def _log_white(problem: Problem) -> float:
    """Return the log determinants of all whitening, as far as motion and sensors tell it [1]_.

    Those that do not, whose noise is taken for a constant, lack ``log_white``.

    References
    ----------
    .. [1] Särkkä & Svensson, Bayesian Filtering and Smoothing, 2nd edition, section 16.3.
    """
    motion, aux = problem.motion, problem.motion.aux
    _, white = motion.prior(problem.constants.width)
    total = float(np.linalg.slogdet(white[:, :aux])[1])
    of_intervals = np.arange(len(problem.t_s) - 1)
    models = [(motion, of_intervals), *((m, np.arange(len(m.row))) for m in problem.sensors)]
    for model, rows in models:
        offered = getattr(model, "log_white", None)
        total += 0.0 if offered is None else float(offered(rows))
    return total
