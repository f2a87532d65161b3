"""The whole flight at once: GTSAM's least squares from each minimum that a search ends in.

Begun from attitudes alone the search ends in wrong minima across gaps; a window starts each
keyframe where the motion leads, and ends in others. The chain's descents find them (``minima``),
from where one or two Newton steps on GTSAM's elimination are enough; where these do not descend,
GTSAM's Levenberg-Marquardt does, at five times the time.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import gtsam
import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph import keys
from fgnav.graph.build import Layout, flight_graph, flight_values, read_keyframes
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import POSITION, ROTATION, States
from fgnav.solve.elimination import Elimination
from fgnav.solve.failures import in_words
from fgnav.solve.minima import BEGIN_LAG_S, Minimum, begins, distinct, minima, mixture
from fgnav.solve.own_factors import Own, OwnFactors

STEP_SIGMAS = 0.01  # the last Newton step is below this share of every sigma: it is a minimum
_ITERATIONS = 20
_RELATIVE_COST = 1e-5  # a smaller change ends the search; Newton steps do the rest
_ROUNDS = 2  # of motion preintegrated about the estimates, with a gyroscope
_NEWTON_STEPS = 8
_LEAST_SHARE = 0.01  # of a Newton step: what must be cut shorter leads nowhere
# Of the cost, that another step promises at a minimum. In an outage a hundredth of a sigma breaks
# the rows of the specific force: steps were small where the cost was 90 times the least.
_LEVEL = 0.1


def solve_batch(problem: SmoothingProblem, *, own: Sequence[Own] = ()) -> Solution:
    """Return each keyframe as known from all data.

    The search begins where a window of 2 s ended and at ``problem.start``: the likeliest minimum is
    taken, with the doubt that others leave.

    Parameters
    ----------
    problem : SmoothingProblem
    own : sequence of gtsam.NonlinearFactor or NamedFactor
        Factors of one's own, over ``fgnav.graph.keys`` with rows of the problem for numbers.

    Raises
    ------
    BadInputError
        If a factor of one's own touches a variable that is not there.
    NoSolutionError
        If the data leave a state open, by name.
    """
    entering = OwnFactors(own, problem)
    starts = begins(problem, entering.within(BEGIN_LAG_S))
    if not own:  # the chain knows none
        starts = [end.solution.states for end in minima(problem, starts)]
    return mixture(distinct([_least(problem, entering, states) for states in starts]))


def minimum(
    problem: SmoothingProblem, own: Sequence[Own] = (), begin: States | None = None
) -> Minimum:
    """Return the one minimum that a search from states, or from ``problem.start``, ends in.

    Parameters and errors are those of ``solve_batch``.
    """
    begin = problem.start if begin is None else begin
    return _least(problem, OwnFactors(own, problem), begin)


def _least(problem: SmoothingProblem, entering: OwnFactors, begin: States) -> Minimum:
    """Return the minimum that a search ends in; not converged if it ends in none."""
    end = _descended(problem, entering, begin)
    for _ in range(_ROUNDS - 1 if Layout.of(problem).gyroscope else 0):
        end = _descended(problem, entering, end.solution.states)
    return end


def _descended(problem: SmoothingProblem, entering: OwnFactors, begin: States) -> Minimum:
    """Return the same of motion preintegrated about the beginning."""
    graph = flight_graph(problem, begin, entering.factors)
    end = _newton(problem, graph, begin)
    if end.solution.converged:
        return end
    states, count = _least_squares(problem, graph, begin)
    end = _newton(problem, graph, states)
    solution = replace(end.solution, updates=end.solution.updates + count)
    return end._replace(solution=solution)


def _least_squares(
    problem: SmoothingProblem, graph: gtsam.NonlinearFactorGraph, begin: States
) -> tuple[States, int]:
    """Return where Levenberg and Marquardt end, and after how many iterations."""
    layout, n, ordering = Layout.of(problem), len(problem.t_s), gtsam.Ordering()
    blocks = range(0 if problem.phase is None else len(problem.phase.blocks))
    arcs = [keys.arcs(j) for j in blocks]
    for variables in (*map(layout.keyframe, range(n)), arcs, layout.constant_keys):
        for key in variables:
            ordering.push_back(key)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setLinearSolverType("MULTIFRONTAL_QR")
    parameters.setRelativeErrorTol(_RELATIVE_COST)
    parameters.setMaxIterations(_ITERATIONS)
    parameters.setOrdering(ordering)
    try:
        optimizer = gtsam.LevenbergMarquardtOptimizer(
            graph, flight_values(problem, begin), parameters
        )
        values = optimizer.optimize()
    except RuntimeError as error:
        raise in_words(
            error, layout.width, problem.constants, lambda k: float(problem.t_s[k])
        ) from error
    return read_keyframes(values, layout, range(n)), optimizer.iterations()


def _newton(problem: SmoothingProblem, graph: gtsam.NonlinearFactorGraph, begin: States) -> Minimum:
    """Return the minimum next to states, with covariances; not converged if there is none.

    Along a valley that bends, steps are halved until they lead down it.
    """
    factors = [graph.at(i) for i in range(graph.size())]
    n, b = len(problem.t_s), problem.constants.width
    states, values, count, share = begin, flight_values(problem, begin), 0, 1.0
    cost = 2.0 * graph.error(values)
    while True:
        linear = _linear(problem, factors, values)
        steps, constant_steps, arc_steps = linear.step()
        marginals = linear.marginals()
        is_least = linear.promised < _LEVEL and _is_small(steps, marginals.covariance)
        if is_least or count == _NEWTON_STEPS:
            break
        share = min(2 * share, 1.0)
        while True:
            moved = states.moved(share * steps, share * constant_steps)
            arcs = {key: values.atVector(key) + share * step for key, step in arc_steps.items()}
            moved_values = flight_values(problem, moved, arcs)
            lower = 2.0 * graph.error(moved_values)
            if lower <= cost or share < _LEAST_SHARE:
                break
            share /= 2
        if lower > cost:
            break
        states, values, cost, count = moved, moved_values, lower, count + 1
    cost -= linear.promised if is_least else 0.0
    solution = Solution(
        states=states.moved(steps, constant_steps) if is_least else states,
        covariance=marginals.covariance,
        cross=marginals.cross[:-1],
        constant_covariance=np.broadcast_to(marginals.constant, (n, b, b)),
        constant_cross=marginals.constant_cross,
        converged=is_least,
        cost=cost,
        solver="gtsam.LevenbergMarquardtOptimizer",
        updates=count,
    )
    return Minimum(solution, -cost / 2 - linear.log_root)


def _linear(
    problem: SmoothingProblem, factors: Iterable[gtsam.NonlinearFactor], values: gtsam.Values
) -> Elimination:
    """Return all factors linearised at values and eliminated."""
    layout, last = Layout.of(problem), len(problem.t_s) - 1
    return Elimination(
        layout, lambda k: float(problem.t_s[k]), factors, values, last, problem.phase
    )


def _is_small(steps: FloatArray, covariance: FloatArray) -> bool:
    """Return whether rotations and positions would move by next to nothing beside their sigma."""
    pose = slice(ROTATION.start, POSITION.stop)
    sigma = np.sqrt(np.einsum("nii->ni", covariance[:, pose, pose]))
    return bool((np.abs(steps[:, pose]) < STEP_SIGMAS * sigma).all())
