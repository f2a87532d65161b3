"""A detector whose quadrants have unlike gains: its spot is off by what is no angle.

True logarithms of currents are ``l = (ln I4 / I2, ln I1 / I3) - c``. With A the whitening rows
across the direction e that is seen so, lines of sight err by ``-A de/dc`` for each of c, sought by
steps, each about the currents that the steps before have put right: of all lines, or of a span's.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.frontend.sensors.directional import sight
from fgnav.graph.factors.directions import Directions
from fgnav.graph.factors.line_of_sight import LineOfSight
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.measurement_factor import of_measurement, parts_of
from fgnav.graph.types.constants import FlightConstant, flight_constant
from fgnav.graph.types.measurement import Linearised, Measurement, OfAnother
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.identification.lasting.error import LastingError, least_of_use
from fgnav.identification.likelihood.beside_phases import is_misfit
from fgnav.identification.likelihood.changed_samples import minimum_below
from fgnav.identification.likelihood.span_constants import best_span, finer, information_of, seconds
from fgnav.identification.likelihood.span_offsets import LEAST_S, Offset
from fgnav.identification.likelihood.thinned import Some
from fgnav.identification.spans.errors import ANY_SHARE
from fgnav.optional_gtsam import gtsam
from fgnav.types.flight import Flight, Seeker

QUADRANTS = "quadrants"
KINDS = (QUADRANTS,)
_PAIRS = ("I4 / I2", "I1 / I3")
_ALWAYS = (-np.inf, np.inf)
_NONE = -1
_STEPS = 4  # at most: each leaves a few hundredths of what is left
_STEP = 1e-3  # of difference quotients


def quadrant_error(
    problem: SmoothingProblem, stated: Solution, seeker: Seeker
) -> LastingError | None:
    """Return by how much pairs of quadrants are out of balance; None without a minimum.

    Throughout, or over the likeliest span, where throughout leaves more than chance: less ln of
    the number of spans.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    seeker : Seeker
    """
    throughout = _sought(problem, stated, seeker, _ALWAYS)
    least = stated.cost if throughout is None else throughout.cost
    if not is_misfit(problem, least):
        return throughout
    edges = seconds(problem.t_s)
    span = _likeliest_span(problem, stated, seeker, edges)
    span = span and _likeliest_span(problem, stated, seeker, finer(edges, span))
    of_span = None if span is None else _sought(problem, stated, seeker, _span_s(problem, span))
    if of_span is None:
        return throughout
    spans = len(edges) * (len(edges) - 1) / 2
    of_span = of_span._replace(nats=of_span.nats - float(np.log(spans)))
    return of_span if throughout is None or of_span.nats > throughout.nats else throughout


def in_balance(seeker: Seeker, off: FloatArray, span_s: tuple[float, float]) -> Seeker:
    """Return a detector with currents of like gains, by what logarithms of ratios are off, (2,)."""
    gains = np.exp([-off[1], 0.0, 0.0, -off[0]])
    inside = (seeker.t_s >= span_s[0]) & (seeker.t_s < span_s[1])
    return replace(seeker, currents=np.where(inside[:, None], gains, 1.0) * seeker.currents)


def put_right(flight: Flight, error: LastingError) -> Flight:
    """Return a flight whose quadrants have like gains."""
    if flight.seeker is None:
        return flight
    span_s = (error.from_s, error.until_s)
    return replace(flight, seeker=in_balance(flight.seeker, error.off, span_s))


def sentence(error: LastingError) -> str:
    """Return what is to be said of it."""
    ratios = np.exp(error.off)
    sigma = ratios * np.sqrt(np.diag(error.covariance))
    begin = "" if error.from_s == -np.inf else f" from {error.from_s:.1f} s on"
    when = begin if error.until_s == np.inf else f"{begin} up to {error.until_s:.1f} s"
    return (
        f"The detector's quadrants have unlike gains{when}: I4 / I2 is {ratios[0]:.3f} ± "
        f"{sigma[0]:.3f}, I1 / I3 {ratios[1]:.3f} ± {sigma[1]:.3f} times what it should be; "
        "taken out."
    )


def _sought(
    problem: SmoothingProblem, stated: Solution, seeker: Seeker, span_s: tuple[float, float]
) -> LastingError | None:
    """Return by how much pairs are out of balance over a span, s."""
    part = flight_constant(QUADRANTS, _PAIRS, "", ANY_SHARE, reported=False)
    inside = (problem.t_s >= span_s[0]) & (problem.t_s < span_s[1])
    column = np.where(inside, problem.constants.width, _NONE)
    off, error, cost = np.zeros(2), None, stated.cost
    for _ in range(_STEPS):
        right = in_balance(seeker, off, span_s)
        free = _freed(problem, replace(part, mean=-off), right, stated.states, column)
        if free is None:
            return None
        solution = minimum_below(free, least_of_use(problem, cost, 2 if error is None else 1))
        if solution is None:
            return None
        step, cost = solution.states.constants[-2:], solution.cost
        off = off + step
        error = LastingError.of(part, free, stated.cost, solution)
        error = error._replace(off=off, from_s=span_s[0], until_s=span_s[1])
        if (step**2 < error.covariance.diagonal()).all():
            return error
    return error


def _likeliest_span(
    problem: SmoothingProblem, stated: Solution, seeker: Seeker, edges: IntArray
) -> Offset | None:
    """Return when pairs are likeliest out of balance; None without a minimum."""
    t_s, m, first = problem.t_s, len(edges) - 1, problem.constants.width
    names = tuple(f"{pair} {j}" for j in range(m) for pair in _PAIRS)
    part = flight_constant(QUADRANTS, names, "", ANY_SHARE, reported=False)
    block = np.searchsorted(edges[1:-1], np.arange(len(t_s)), side="right")
    free = _freed(problem, part, seeker, stated.states, first + 2 * block)
    if free is None:
        return None
    information = information_of(free, stated.states, first, ANY_SHARE, (m, 2))
    if information is None:
        return None
    return best_span(t_s, (QUADRANTS, "balance", ANY_SHARE), edges, information, LEAST_S)


def _span_s(problem: SmoothingProblem, span: Offset) -> tuple[float, float]:
    """Return when a span begins and ends, halfway from one keyframe to the next, s.

    Endless where it lasts from or to the end.
    """
    halfway_s = np.concatenate([[-np.inf], (problem.t_s[1:] + problem.t_s[:-1]) / 2])
    is_last = span.end == len(problem.t_s) - 1
    return float(halfway_s[span.begin]), np.inf if is_last else float(halfway_s[span.end])


def _freed(
    problem: SmoothingProblem,
    part: FlightConstant,
    seeker: Seeker,
    at: States,
    column: IntArray,
) -> SmoothingProblem | None:
    """Return a problem in which the balance is free; None where the spot leaves the detector.

    ``column``: first of its constants by keyframes, (n,), none where it is below zero.
    """
    free, measurements = problem.with_constants((part,)), []
    for one in problem.measurements:
        inner = one.measurement if isinstance(one, Some) else one
        if not isinstance(inner, LineOfSight):
            measurements.append(one)
            continue
        seen = _seen(problem, seeker, one, at)
        if seen is None:
            return None
        by = np.zeros((len(one.row), 2, 2))
        for i, step in enumerate(np.diag([_STEP, _STEP])):
            stepped = _seen(problem, in_balance(seeker, step, _ALWAYS), one, at)
            if stepped is None:
                return None
            change = (stepped.e_b - seen.e_b) / _STEP
            by[:, :, i] = -np.einsum("kij,kj->ki", seen.across_b, change)
        constants = free.constants
        again = replace(inner, row=one.row, across_b=seen.across_b, constants=constants)
        measurements.append(
            Unbalanced(measurement=again, by=by, column=column[one.row], constants=constants)
        )
    return replace(free, measurements=tuple(measurements))


def _seen(
    problem: SmoothingProblem, seeker: Seeker, one: Measurement, at: States
) -> Directions | None:
    """Return directions at a measurement's keyframes; None unless all are seen."""
    motion, rows = problem.motion, one.row
    if not isinstance(motion, GyroFree | Inertial):
        return None
    seen, _ = sight(seeker, motion.imu, problem.t_s[rows], at.p_n_m[rows])
    return seen if seen is not None and np.isfinite(seen.e_b).all() else None


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Unbalanced(OfAnother):
    """Lines of sight of a detector whose pairs of quadrants are out of balance.

    Attributes
    ----------
    measurement : Measurement
    by : ndarray, shape (k, 2, 2)
        How residuals change by each pair's balance.
    column : ndarray of int, shape (k,)
        First of the two constants c; below zero where they are of no effect.
    constants : Constants
    """

    by: FloatArray
    column: IntArray

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of some, (j,), see ``Measurement``."""
        value, state, shared = self.measurement.linearise(at, which)
        shared, value = shared.copy(), value.copy()
        for i in range(2):
            k = np.flatnonzero(self.column[which] >= 0)
            column, by = self.column[which[k]] + i, self.by[which[k], :, i]
            shared[k, :, column] += by
            value[k] += by * at.constants[column][:, None]
        return Linearised(value, state, shared)

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return measurement i as a factor of keyframe ``key``."""
        parts = parts_of(self.constants, self.constants.first)
        return of_measurement(self, i, key, ("pose",), parts, rows=2)
