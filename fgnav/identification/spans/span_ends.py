"""Between which samples an error of the inertial unit begins and ends.

Spans are first sought by keyframes. An end between two of them leaves some samples wrong, or puts
some wrong: half of an interval of a gyroscope at half its scale are degrees. So each end is moved
sample by sample, to some twenty on either side at most, as long as the minimum without the error is
likely; the least stands, and the bias may step where others are a hundredth as likely or more.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.identification.likelihood.changed_samples import minimum_below
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.spans.span_fault import SpanFault

_MOST = 20  # times that an end is tried at on either side, about; a bound of cost
Without = Callable[[SpanFault], SmoothingProblem]


def at_samples(fault: SpanFault, samples_s: FloatArray, without: Without) -> SpanFault:
    """Return a fault that begins and ends where that leaves least.

    Parameters
    ----------
    fault : SpanFault
    samples_s : ndarray, shape (m,)
        Times of the unit's samples.
    without : callable
        From a fault to the problem without it.
    """
    problem = without(fault)
    least, times_s = minimum_below(problem, np.inf), (samples_s, problem.t_s)
    if least is None:
        return fault
    for end in ("from_s", "until_s"):
        if np.isfinite(getattr(fault, end)):
            fault, least = _moved(fault, least, end, times_s, without)
    return fault


def _moved(
    fault: SpanFault,
    least: Solution,
    end: str,
    times_s: tuple[FloatArray, FloatArray],
    without: Without,
) -> tuple[SpanFault, Solution]:
    """Return a fault with one of its ends where that leaves least, and what is left."""
    samples_s, t_s = times_s
    begin_s, best = getattr(fault, end), (fault, least)
    costs = {begin_s: least.cost}
    i = int(np.searchsorted(t_s, begin_s - 1e-9))
    first_s, last_s = t_s[max(i - 2, 0)], t_s[min(i + 2, len(t_s) - 1)]
    inside = samples_s[(samples_s >= first_s) & (samples_s <= last_s)]
    for side in (inside[inside < begin_s][::-1], inside[inside > begin_s]):
        states: States = least.states
        for time_s in side[:: max(len(side) // _MOST, 1)].tolist():
            changed: dict[str, Any] = {end: time_s}
            moved = fault._replace(**changed)
            problem = without(moved)
            if problem.sizes != (len(t_s), len(states.constants)):
                break  # of other keyframes costs are of other measurements
            solution = minimum_below(problem, best[1].cost + 2 * LIKELY, states)
            if solution is None:
                break
            costs[time_s], states = solution.cost, solution.states
            if solution.cost < best[1].cost:
                best = moved, solution
    likely = [at for at, cost in costs.items() if cost < best[1].cost + 2 * LIKELY]
    # A bias is one between keyframes.
    before = max(int(np.searchsorted(t_s, min(likely), side="right")) - 1, 0)
    after = min(int(np.searchsorted(t_s, max(likely), side="left")), len(t_s) - 1)
    after = max(after, min(before + 1, len(t_s) - 1))
    field = {"from_s": "begins_s", "until_s": "ends_s"}[end]
    first_s, last_s = getattr(fault, field)
    window: dict[str, Any] = {
        field: (min(first_s, float(t_s[before])), max(last_s, float(t_s[after])))
    }
    return best[0]._replace(**window), best[1]
