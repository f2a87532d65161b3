"""Faults of the inertial unit that the phases of arcs show, and their thinned chain does not.

Each error is tested over all spans of a second or more by the whole problem
(``likelihood.span_constants``), and so is a drift of either bias: scales, turns and drifts where
more is left of all measurements than of nine right flights in ten, or a bias that steps gains more
than of every other right flight. An error that leaves more than chance is none: then something else
is wrong. Where phases show the unit louder, too, noise gains the integral
of its score on the way from what is stated.
"""

from itertools import product

import numpy as np
from scipy.special import chdtri

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.identification.likelihood.beside_phases import measured_rows, schwarz_nats
from fgnav.identification.likelihood.span_constants import seconds
from fgnav.identification.likelihood.span_offsets import BY_CHANCE, LIKELY, SHAPES, TURN, Offset
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.spans.errors import DRIFT, ERRORS
from fgnav.identification.spans.likeliest import finer_span, likeliest
from fgnav.identification.track.windows import FALSE_ALARM
from fgnav.solve.chain import solve_batch

_DOUBTED = 0.1  # share of right flights


def offsets_by_phases(
    problem: SmoothingProblem, stated: Solution | None = None
) -> tuple[Offset, ...]:
    """Return the likeliest errors of the unit's sensors, those as likely as the best.

    Empty where nothing is doubted, or something else is wrong; and without a gyroscope, for a rate
    that follows its prior so far is none to hold the accelerometer against.

    Parameters
    ----------
    problem : SmoothingProblem
        With phases of arcs.
    stated : Solution, optional
        Its minimum, if that is known.
    """
    rows = measured_rows(problem)
    if "gyroscope" not in problem.motion.noise_parts().names:
        return ()
    try:
        solution = stated or solve_batch(problem)
    except NoSolutionError:
        return ()
    if not solution.converged:
        return ()
    edges, is_doubted = seconds(problem.t_s), solution.cost > chdtri(rows, _DOUBTED)

    def of_unit(shapes: tuple[str, ...]) -> list[Offset]:
        errors = product(WHITE, shapes)
        each = (likeliest(problem, solution.states, error, edges) for error in errors)
        return [one for one in each if one is not None]

    offsets = of_unit(SHAPES[:1])
    if not (is_doubted or any(one.gain > BY_CHANCE for one in offsets)):
        return ()
    offsets += [*of_unit(SHAPES[1:]), *of_drifts(problem, solution.states)]
    offsets.sort(key=lambda one: -one.gain)
    if not offsets or solution.cost - 2 * offsets[0].gain > chdtri(rows, FALSE_ALARM):
        return ()
    if is_turned_throughout(problem, solution.states, offsets[0], len(edges)):
        return ()
    likely = [one for one in offsets if one.gain > offsets[0].gain - LIKELY]
    refined = (finer_span(problem, solution.states, one, edges) for one in likely)
    return tuple(sorted(refined, key=lambda one: -one.gain))


def nats_of_span(problem: SmoothingProblem, stated: Solution | None = None) -> float:
    """Return by how much the likeliest error of the unit over a span is likelier than none.

    Less what each of its numbers costs (``schwarz_nats``), and ln of the seconds at which it may
    begin and of the errors. Minus infinity where there is none. Parameters as above.
    """
    offsets = offsets_by_phases(problem, stated)
    if not offsets:
        return -np.inf
    (best, *_), each = offsets, schwarz_nats(problem)
    of_many = seconds_nats(problem.t_s) + float(np.log(len(ERRORS)))
    return best.gain - len(best.value) * each - of_many


def seconds_nats(t_s: FloatArray) -> float:
    """Return ln of the seconds at which an error between keyframes, (n,), may begin."""
    return float(np.log(max(float(np.ptp(t_s)), 1.0)))


def of_drifts(problem: SmoothingProblem, at: States) -> list[Offset]:
    """Return how either bias drifts over all of a record, about a problem's minimum."""
    ends = np.array([0, len(problem.t_s) - 1])
    drifts = (likeliest(problem, at, (sensor, DRIFT), ends) for sensor in WHITE)
    return [one for one in drifts if one is not None]


def is_turned_throughout(problem: SmoothingProblem, at: States, turned: Offset, edges: int) -> bool:
    """Return whether axes may as well be turned from the first sample to the last.

    Which sensor's then are, or all the body's, no measurement tells. Such a turn has no span that
    is chosen among many, between so many edges.
    """
    if turned.shape != TURN:
        return False
    spans, ends = edges * (edges - 1) / 2, np.array([0, len(problem.t_s) - 1])
    throughout = (likeliest(problem, at, (sensor, TURN), ends) for sensor in WHITE)
    gain = max((one.gain for one in throughout if one is not None), default=0.0)
    return bool(gain + np.log(spans) > turned.gain - LIKELY)


def is_throughout(problem: SmoothingProblem, at: States, error: tuple[str, str]) -> bool:
    """Return whether an error of the unit may as well be one of all of a record as of a span.

    Parameters
    ----------
    problem : SmoothingProblem
    at : States
        Its minimum.
    error : tuple of str
        Sensor and shape.
    """
    edges, ends = seconds(problem.t_s), np.array([0, len(problem.t_s) - 1])
    of_span, of_all = (likeliest(problem, at, error, between) for between in (edges, ends))
    if of_span is None or of_all is None:
        return True
    spans = len(edges) * (len(edges) - 1) / 2
    return bool(of_all.gain + np.log(spans) > of_span.gain - LIKELY)
