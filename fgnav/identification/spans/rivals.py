"""What looks like a clock beside phases of arcs and is none: tags that are off for a while.

A clock that is off holds for the whole record. Where tags that are off over a span of it are
likelier by a hundred to one, and by as many again as there are seconds at which it may begin, tags
stay as they are, and the search for noise and for faults of spans goes on without the clock.
"""

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.spans.beside_phases import late_gain
from fgnav.identification.time_tags import AtTags, TagSearch
from fgnav.solve.chain import solve_batch


def unless_of_a_span(search: TagSearch, at_tags: AtTags) -> AtTags:
    """Return what a flight says with tags as they were where a span explains more than a clock."""
    first = at_tags.doubted or at_tags
    if not (at_tags.moved.any() or at_tags.identified.times.significant.any()):
        return at_tags
    try:
        is_rather = _is_of_a_span(search, first, at_tags)
    except NoSolutionError:
        return at_tags
    return AtTags(first.identified.in_time(), first.moved) if is_rather else at_tags


def _is_of_a_span(search: TagSearch, first: AtTags, at_tags: AtTags) -> bool:
    problem = search.at_tags(first.moved).problem
    if problem.phase is None:
        return False
    odds = LIKELY + float(np.log(max(float(np.ptp(problem.t_s)), 1.0)))
    solution = solve_batch(problem)
    clock = solve_batch(search.at_tags(at_tags.moved).problem)
    gained = (solution.cost - clock.cost) / 2
    return late_gain(problem, solution.states) > gained + odds
