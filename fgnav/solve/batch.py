"""The whole flight at once, from each minimum that a search ends in.

Begun from attitudes alone the search ends in wrong minima across gaps; a window starts each
keyframe where the motion leads, and ends in others.
"""

from collections.abc import Sequence

from fgnav.checks import NoSolutionError
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.solve.descent import ITERATIONS, Minimum, descended
from fgnav.solve.minima import BEGIN_LAG_S, begins, distinct, mixture
from fgnav.solve.own_factors import Own, OwnFactors


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
        If the data leave a state open, by name, wherever a search begins.
    """
    entering = OwnFactors(own, problem)
    ends, failure = [], NoSolutionError("state: there is nowhere to begin")
    for states in begins(problem, entering.within(BEGIN_LAG_S)):
        try:
            ends.append(descended(problem, begin=states, own=entering.factors))
        except NoSolutionError as error:
            failure = error
    if not ends:
        raise failure
    return mixture(distinct(ends))


def minimum(
    problem: SmoothingProblem,
    own: Sequence[Own] = (),
    begin: States | None = None,
    most: int = ITERATIONS,
) -> Minimum:
    """Return the one minimum that a search from states, or from ``problem.start``, ends in.

    Given up after ``most`` iterations. Parameters and errors are those of ``solve_batch``.
    """
    return descended(problem, begin=begin, own=OwnFactors(own, problem).factors, most=most)
