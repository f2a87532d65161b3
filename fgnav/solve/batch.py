"""The whole flight at once, from each minimum that a search ends in.

Begun from attitudes alone the search ends in wrong minima across gaps; a window starts each
keyframe where the motion leads, and ends in others.
"""

from collections.abc import Sequence
from contextlib import suppress

from fgnav.checks import NoSolutionError
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.solve.custom_factors import Custom, CustomFactors
from fgnav.solve.fixed_lag import solve_fixed_lag
from fgnav.solve.gauss_newton import ITERATIONS, Minimum, gauss_newton
from fgnav.solve.minima import distinct, mixture

_BEGIN_LAG_S = 2.0  # of the window in whose end a search begins


def solve_batch(problem: Problem, *, custom: Sequence[Custom] = ()) -> Solution:
    """Return each keyframe as known from all data.

    The search begins where a window of 2 s ended and at ``problem.start``: the likeliest minimum is
    taken, with the doubt that others leave.

    Parameters
    ----------
    problem : Problem
    custom : sequence of gtsam.NonlinearFactor or NamedFactor
        Custom factors, over ``fgnav.graph.keys`` with rows of the problem for numbers.

    Raises
    ------
    BadInputError
        If a custom factor touches a variable that is not there.
    NoSolutionError
        If the data leave a state open, by name, wherever a search begins.
    """
    entering = CustomFactors(custom, problem)
    starts, ends = [problem.start], list[Minimum]()
    failure = NoSolutionError("state: there is nowhere to begin")
    with suppress(NoSolutionError):  # what came until then left a state open
        held = entering.within(_BEGIN_LAG_S)
        starts.insert(0, solve_fixed_lag(problem, _BEGIN_LAG_S, custom=held).states)
    for states in starts:
        try:
            ends.append(gauss_newton(problem, begin=states, custom=entering.factors))
        except NoSolutionError as error:
            failure = error
    if not ends:
        raise failure
    return mixture(distinct(ends))


def minimum(
    problem: Problem,
    custom: Sequence[Custom] = (),
    begin: States | None = None,
    most: int = ITERATIONS,
) -> Minimum:
    """Return the one minimum that a search from states, or from ``problem.start``, ends in.

    Given up after ``most`` iterations. Parameters and errors are those of ``solve_batch``.
    """
    return gauss_newton(
        problem, begin=begin, custom=CustomFactors(custom, problem).factors, most=most
    )
