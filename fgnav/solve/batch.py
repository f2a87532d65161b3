"""The whole flight at once, begun where a window ended.

Begun from attitudes alone the search ends in wrong minima across gaps; a window does not, for it
starts each keyframe where the motion leads. From there one or two Newton steps are enough; where
they do not descend, GTSAM's Levenberg-Marquardt does, at five times the time.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import gtsam
import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.graph.build import Layout, flight_graph, flight_values, read_keyframes
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import POSITION, ROTATION, States
from fgnav.solve import chain
from fgnav.solve.elimination import Elimination
from fgnav.solve.failures import in_words
from fgnav.solve.fixed_lag import solve_fixed_lag
from fgnav.solve.marginals import Marginals
from fgnav.solve.own_factors import Own, OwnFactors

BEGIN_LAG_S = 2.0
STEP_SIGMAS = 0.02  # a Newton step below this share of every sigma: it is a minimum
_ITERATIONS = 20
_RELATIVE_COST = 1e-5  # a smaller change ends the search; Newton steps do the rest
_ROUNDS = 2  # of motion preintegrated about the estimates, with a gyroscope
_NEWTON_STEPS = 8
# Of the cost, that another step promises at a minimum. In an outage a hundredth of a sigma breaks
# the rows of the specific force: steps were small where the cost was 90 times the least.
_LEVEL = 0.1
_DOUBT = 20.0  # of the cost, ten nats: less does not tell a mirrored attitude, where a window ended


def solve_batch(
    problem: SmoothingProblem, *, own: Sequence[Own] = (), begin: Solution | None = None
) -> Solution:
    """Return each keyframe as known from all data.

    Parameters
    ----------
    problem : SmoothingProblem
    own : sequence of gtsam.NonlinearFactor or NamedFactor
        Factors of one's own, over ``fgnav.graph.keys`` with rows of the problem for numbers.
    begin : Solution, optional
        Where the search begins; by default where a window of 2 s ended and, if that did not
        converge, at ``problem.start``, too: the lower cost is taken.

    Raises
    ------
    BadInputError
        If a factor of one's own touches a variable that is not there.
    NoSolutionError
        If the data leave a state open, by name.
    """
    entering = OwnFactors(own, problem)
    if begin is not None:
        return _least(problem, entering, begin.states)
    begins = _begins(problem, entering)
    if len(begins) == 1:
        return _least(problem, entering, begins[0])
    # The chain's descent is a tenth of the time; factors of one's own follow.
    of_window, of_start = (chain.solve_batch(problem, begin=states) for states in begins)
    is_start = of_start.converged and of_start.cost < of_window.cost + _DOUBT
    return _least(problem, entering, (of_start if is_start else of_window).states)


def _begins(problem: SmoothingProblem, entering: OwnFactors) -> list[States]:
    """Return where a window ends and, if that did not converge, the problem's start."""
    try:
        window = solve_fixed_lag(problem, BEGIN_LAG_S, own=entering.within(BEGIN_LAG_S))
    except NoSolutionError:  # what came until then left a state open
        return [problem.start]
    return [window.states] if window.converged else [window.states, problem.start]


def _least(problem: SmoothingProblem, entering: OwnFactors, begin: States) -> Solution:
    """Return the minimum that a search ends in; not converged if it ends in none."""
    solution = _descended(problem, entering, begin)
    for _ in range(_ROUNDS - 1 if Layout.of(problem).gyroscope else 0):
        solution = _descended(problem, entering, solution.states)
    return solution


def _descended(problem: SmoothingProblem, entering: OwnFactors, begin: States) -> Solution:
    """Return the same of motion preintegrated about the beginning."""
    graph = flight_graph(problem, begin, entering.factors)
    solution = _newton(problem, graph, begin)
    if solution.converged:
        return solution
    states, count = _least_squares(problem, graph, begin)
    solution = _newton(problem, graph, states)
    return replace(solution, updates=solution.updates + count)


def _least_squares(
    problem: SmoothingProblem, graph: gtsam.NonlinearFactorGraph, begin: States
) -> tuple[States, int]:
    """Return where Levenberg and Marquardt end, and after how many iterations."""
    layout, n, ordering = Layout.of(problem), len(problem.t_s), gtsam.Ordering()
    for variables in (*map(layout.keyframe, range(n)), layout.constant_keys):
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


def _newton(
    problem: SmoothingProblem, graph: gtsam.NonlinearFactorGraph, begin: States
) -> Solution:
    """Return the minimum next to states, with covariances; not converged if there is none."""
    factors = [graph.at(i) for i in range(graph.size())]
    n, b = len(problem.t_s), problem.constants.width
    states, least, count = begin, np.inf, 0
    while True:
        values = flight_values(problem, states)
        steps, constant_steps, known, promised = _linear(problem, factors, values)
        cost = 2.0 * graph.error(values)
        is_least = promised < _LEVEL and _is_small(steps, known)
        if is_least or cost > least + _LEVEL or count == _NEWTON_STEPS:
            break
        states, least, count = states.moved(steps, constant_steps), cost, count + 1
    return Solution(
        states=states,
        covariance=known.covariance,
        cross=known.cross[:-1],
        constant_covariance=np.broadcast_to(known.constant, (n, b, b)),
        constant_cross=known.constant_cross,
        converged=is_least,
        cost=cost,
        updates=count,
    )


def _linear(
    problem: SmoothingProblem, factors: Iterable[gtsam.NonlinearFactor], values: gtsam.Values
) -> tuple[FloatArray, FloatArray, Marginals, float]:
    """Return the Newton step of keyframes and constants, covariances, and what it promises."""
    layout, last = Layout.of(problem), len(problem.t_s) - 1
    eliminated = Elimination(layout, lambda k: float(problem.t_s[k]), factors, values, last)
    steps, constant_steps = eliminated.step()
    return steps, constant_steps, eliminated.marginals(), eliminated.promised


def _is_small(steps: FloatArray, known: Marginals) -> bool:
    """Return whether rotations and positions would move by next to nothing beside their sigma."""
    pose = slice(ROTATION.start, POSITION.stop)
    sigma = np.sqrt(np.einsum("nii->ni", known.covariance[:, pose, pose]))
    return bool((np.abs(steps[:, pose]) < STEP_SIGMAS * sigma).all())
