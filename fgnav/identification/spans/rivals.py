"""What looks like a clock and is none: tags that step, or measurements that are off for a while.

A clock that is off, and late velocities, hold for the whole record. They are compared with what
holds for a span of it: tags that are off there, or measurements. If one of these is likelier by a
hundred to one, and by as many again as there are seconds at which it may begin, tags stay as they
are, and the search for noise and for faults of spans goes on without clocks and delays.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.likelihood.span_offsets import LIKELY, of_measurements
from fgnav.identification.likelihood.thinned import thinned
from fgnav.identification.spans.beside_phases import late_gain
from fgnav.identification.spans.unit_faults import anchored
from fgnav.identification.time_tags import AtTags, TagSearch
from fgnav.solve.chain import solve_batch


def unless_of_a_span(search: TagSearch, at_tags: AtTags) -> AtTags:
    """Return what a flight says with tags as they were where a span explains more than a clock."""
    first = at_tags.doubted or at_tags
    times = at_tags.identified.times
    if not (at_tags.moved.any() or times.significant.any()):
        return at_tags
    try:
        is_rather = _is_of_a_span(search, first, at_tags)
    except NoSolutionError:
        return at_tags
    return AtTags(first.identified.in_time(), first.moved) if is_rather else at_tags


def _is_of_a_span(search: TagSearch, first: AtTags, at_tags: AtTags) -> bool:
    problem = search.at_tags(first.moved).problem
    odds = LIKELY + float(np.log(max(float(np.ptp(problem.t_s)), 1.0)))
    if problem.phase is not None:  # of arcs, which tell it best
        solution = solve_batch(problem)
        clock = solve_batch(search.at_tags(at_tags.moved).problem)
        gained = (solution.cost - clock.cost) / 2
        return late_gain(problem, solution.states) > gained + odds
    small = anchored(thinned(problem))
    solution = solve_batch(small, begin=solve_batch(small).states)
    measured = replace(small, measurements=small.measurements[:-1])
    least = max((one.gain for one in of_measurements(measured, solution)), default=0.0) - odds
    # Clock and delay as constants, at noise as stated, of which these offsets are as well.
    for moved in (first.moved, at_tags.moved):
        rest = search.tested(moved).problem
        lost = _rows(small) - _rows(rest)  # outside of the unit's record: of these 1 is left each
        if least <= (solution.cost - solve_batch(rest).cost - lost) / 2:
            return False
    return True


def _rows(problem: SmoothingProblem) -> int:
    return sum(int(one.freedom.sum()) for one in problem.measurements)
