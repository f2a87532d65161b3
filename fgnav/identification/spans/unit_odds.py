"""The likeliest error of the inertial unit over a span, and how likely it is.

By the thinned chain at the stated noise and at the noise identified, and by the whole problem
beside phases of arcs. An error may begin at any second.
"""

from collections.abc import Collection
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.frontend.calibration_request import CalibrationRequest
from fgnav.frontend.prepared import PreparedFlight
from fgnav.frontend.settings import ProblemSettings
from fgnav.graph.types.measurement import Linearised, Measurement
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import POSITION, States
from fgnav.identification.likelihood.beside_phases import chance_of, is_misfit, noise_gain
from fgnav.identification.likelihood.changed_samples import Change
from fgnav.identification.likelihood.span_offsets import LIKELY, Offset, of_biases, of_measurements
from fgnav.identification.likelihood.thinned import thinned
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.noise.identified import Identified
from fgnav.identification.noise.stated import with_factors, with_rest
from fgnav.identification.noise.thinned_flight import ThinnedFlight
from fgnav.identification.spans.beside_phases import (
    is_turned_throughout,
    of_drifts,
    offsets_by_phases,
    seconds_nats,
)
from fgnav.identification.spans.errors import DRIFT, ERRORS, MIX, SAMPLES, added
from fgnav.identification.spans.mixed_axes import Built, mixed_axes
from fgnav.identification.spans.span_fault import SpanFault
from fgnav.identification.time_tags import AtTags, TagSearch
from fgnav.identification.track.tags import middle_of_tags_s, with_tags_moved
from fgnav.identification.track.windows import EXCLUDED
from fgnav.solve.chain import solve_batch
from fgnav.types.flight import Flight, Imu


class Likeliest(NamedTuple):
    """The fault that may be, and one of the other sensor that is as likely, if there is.

    ``errors``: all of which one may be meant, with their values, by decreasing gain.
    """

    faults: tuple[SpanFault, ...] = ()
    errors: tuple[SpanFault, ...] = ()


def likeliest_faults(
    search: TagSearch,
    at_tags: AtTags,
    requests: tuple[CalibrationRequest, ...],
    begin: PreparedFlight | None,
    is_louder: bool,
) -> Likeliest:
    """Return the likeliest error; none where odds are a hundred to one against it.

    Beside those of any contradiction.
    """
    identified = at_tags.identified
    flight = with_tags_moved(search.flight, at_tags.moved, middle_of_tags_s(search.flight.imu))
    settings = replace(search.settings, calibration=requests)
    prepared = search.build(flight, settings) if begin is None else begin
    if prepared.problem.phase is not None:
        by_phases = _by_phases(search, at_tags, prepared, flight)
        if by_phases:
            return Likeliest(by_phases, by_phases[:1])
    odds = _odds(search, identified, (flight, settings, prepared), is_louder)
    if odds is None or odds.nats < -LIKELY or odds.best.of_measurements >= odds.best.offset.gain:
        return Likeliest()
    share, best = float(1.0 / (1.0 + np.exp(-odds.nats))), odds.best
    if is_turned_throughout(best.problem, best.at, best.offset, len(odds.t_s)):
        return Likeliest()

    def fault(one: Offset, *, is_first: bool) -> SpanFault:
        return _fault(one, (odds.t_s, prepared.imu), share, is_first=is_first)

    faults = tuple(fault(one, is_first=one is best.offset) for one in best.offsets)
    spans = [one for one in best.others if one.shape not in (DRIFT, MIX)]
    errors = tuple(fault(one, is_first=True) for one in (best.offset, *spans))
    return Likeliest(faults, errors)


def nats_beside(search: TagSearch, at_tags: AtTags, instruments: Collection[str]) -> float:
    """Return by how much an error that is no instrument's is likelier than what is identified.

    Beyond its limit: of the unit, or an offset of fixes, over a span. Minus infinity without a
    gyroscope, or a solution.
    """
    flight = with_tags_moved(search.flight, at_tags.moved, middle_of_tags_s(search.flight.imu))
    prepared, settings = search.build(flight, search.settings), search.settings
    odds = _odds(search, at_tags.identified, (flight, settings, prepared), is_louder=False)
    if odds is None:
        return -np.inf
    others = (gain for name, gain in odds.best.instead.items() if name not in instruments)
    return odds.nats + max(0.0, max(others, default=0.0) - odds.best.offset.gain)


class _Odds(NamedTuple):
    """The likeliest errors of the unit, at stated or identified noise, over this noise alone."""

    best: "_Tested"
    nats: float  # beyond the limit
    t_s: FloatArray


def _odds(
    search: TagSearch,
    identified: Identified,
    subject: tuple[Flight, ProblemSettings, PreparedFlight],
    is_louder: bool,
) -> _Odds | None:
    """Return how likely errors of the unit are by the thinned chain; None without a gyroscope."""
    flight, settings, prepared = subject
    small = ThinnedFlight.of(flight, prepared, ())
    if "gyroscope" not in small.parts.names:
        return None
    chain = anchored(small.problem)

    def built(change: Change) -> SmoothingProblem:
        return anchored(thinned(search.build(_changed(flight, change), settings).problem))

    offsets, gain, is_mixed = [], 0.0, False
    try:
        offsets.append(_Tested.of(chain, 0.0, built))
        is_mixed = offsets[0].offset.shape == MIX
        if identified.used.any():
            gain = small.likelihood_at(identified.factors) - small.likelihood_at({})
        if identified.used.any() and not is_mixed:  # which leaves but chance
            louder = search.build(
                with_factors(flight, identified.factors), with_rest(settings, identified.factors)
            )
            offsets.append(_Tested.of(anchored(thinned(louder.problem)), gain))
    except NoSolutionError:
        if not is_mixed:  # else noise is weighed with axes put right
            return None
    best = offsets[-1] if is_louder else max(offsets, key=lambda one: one.likelihood)
    return _Odds(best, best.likelihood - gain - limit_nats(chain.t_s), chain.t_s)


def _by_phases(
    search: TagSearch, at_tags: AtTags, prepared: PreparedFlight, flight: Flight
) -> tuple[SpanFault, ...]:
    """Return all faults that are as likely as the first, as the phases of arcs show them."""

    def built(change: Change) -> SmoothingProblem:
        return search.build(_changed(flight, change), search.settings).problem

    problem, t_s = prepared.problem, prepared.problem.t_s
    offsets = offsets_by_phases(problem) or _mixed_by_phases(problem, built)
    if not offsets:
        return ()
    noise = unit_noise_nats(search, at_tags, flight)
    nats = offsets[0].gain - noise - limit_nats(t_s) - np.log(len(ERRORS))
    if nats < -LIKELY:
        return ()
    share = float(1.0 / (1.0 + np.exp(-nats)))
    return tuple(
        _fault(one, (t_s, prepared.imu), share, is_first=one is offsets[0]) for one in offsets
    )


def _mixed_by_phases(problem: SmoothingProblem, built: Built) -> tuple[Offset, ...]:
    """Return how axes are mixed, where errors of three numbers leave the chain more, too."""
    if "gyroscope" not in problem.motion.noise_parts().names:
        return ()
    try:
        stated = solve_batch(problem)
        if not is_misfit(problem, stated.cost):
            return ()
        chain = _Tested.of(anchored(thinned(problem)), 0.0)
    except NoSolutionError:
        return ()
    return mixed_axes(problem, stated, built) if chain.is_left else ()


def _changed(flight: Flight, change: Change) -> Flight:
    return flight if flight.imu is None else replace(flight, imu=change(flight.imu))


def limit_nats(t_s: FloatArray) -> float:
    """Return the nats beyond which an error that begins at any second is likelier than none."""
    return EXCLUDED + seconds_nats(t_s)


def unit_noise_nats(search: TagSearch, at_tags: AtTags, flight: Flight) -> float:
    """Return what the unit's white noise gains of a whole problem as it is identified."""

    def with_noise(factors: dict[str, float]) -> SmoothingProblem:
        return search.build(with_factors(flight, factors), search.settings).problem

    factors = at_tags.identified.factors
    return noise_gain({one: factors[one] for one in WHITE if one in factors}, with_noise)


class _Tested(NamedTuple):
    """The likeliest offsets of the unit, what its noise has gained, and a measurement's offset."""

    offsets: tuple[Offset, ...]  # of sensors, as likely as the first
    others: tuple[Offset, ...]  # than the first
    noise: float
    instead: dict[str, float]  # gains of offsets by measurement
    problem: SmoothingProblem
    at: States
    is_left: bool  # more than chance by errors of three numbers

    @property
    def of_measurements(self) -> float:
        return max(self.instead.values(), default=0.0)

    @property
    def offset(self) -> Offset:
        return self.offsets[0]

    @property
    def likelihood(self) -> float:
        return self.offset.gain + self.noise

    @classmethod
    def of(cls, small: SmoothingProblem, noise: float, built: Built | None = None) -> "_Tested":
        solution = solve_batch(small)
        solution = solve_batch(small, begin=solution.states)  # covariances of its linearisation
        if not solution.converged:
            raise NoSolutionError("faults of spans: the chain has no minimum")
        errors = (*of_biases(small, solution), *of_drifts(small, solution.states))
        least = solution.cost - 2 * max(one.gain for one in errors)
        is_left = least > chance_of(small)
        if built is not None and is_left:
            errors = (*errors, *mixed_axes(small, solution, built))
        of_unit = sorted(errors, key=lambda one: -one.gain)
        of_sensors = {one.sensor: one for one in reversed(of_unit)}.values()
        as_likely = (one for one in of_sensors if one.gain > of_unit[0].gain - LIKELY)
        offsets = tuple(sorted(as_likely, key=lambda one: -one.gain))
        measured = replace(small, measurements=small.measurements[:-1])
        instead = of_measurements(measured, solution)
        gains = {one.sensor: one.gain for one in instead}
        others = tuple(of_unit[1:])
        return cls(offsets, others, noise, gains, small, solution.states, is_left)


def _fault(
    offset: Offset, record: tuple[FloatArray, Imu], share: float, *, is_first: bool
) -> SpanFault:
    """Return a fault of the unit between keyframes, (n,), s, that the thinned chain has.

    Only the likeliest is taken out of the samples, if it is likely at all.
    """
    t_s, imu = record
    last = len(t_s) - 1
    (first_begin, last_begin), (first_end, last_end) = offset.begins, offset.ends
    from_s, until_s = offset.span_s or t_s[[offset.begin, offset.end]]
    fault = SpanFault(
        sensor=offset.sensor,
        shape=offset.shape,
        from_s=float(from_s) if offset.begin else -np.inf,
        until_s=float(until_s) if offset.end < last else np.inf,
        # Either happens in the interval before such a keyframe, and not before the first or last.
        begins_s=(float(t_s[max(first_begin - 1, 0)]), float(t_s[last_begin])),
        ends_s=(
            float(t_s[first_end if first_end == last else first_end - 1]),
            float(t_s[last_end]),
        ),
        value=offset.value,
        sigma=np.sqrt(offset.covariance.diagonal()),
        variance=offset.covariance.diagonal(),
        size=0.0,
        share=share,
    )
    inside = fault.strikes(imu.t_s)
    x, at_s = getattr(imu, SAMPLES[offset.sensor])[inside], imu.t_s[inside]
    each = np.eye(len(offset.value))
    by_unit = np.stack([added(offset.shape, x, one, at_s) for one in each], axis=2)
    effect = by_unit @ offset.value
    noise = np.einsum("kig,gh,kih->ki", by_unit, offset.covariance, by_unit)
    variance = (effect**2 + noise).mean(axis=0)
    size = float(np.sqrt((effect**2).sum(axis=1).mean()))
    value = offset.value if is_first and fault.is_likely else np.zeros_like(offset.value)
    return fault._replace(value=value, variance=share * variance, size=size)


class _Anchor(NamedTuple):
    """The first position, to a metre: raw observations without arcs have none, and lose digits."""

    p_n_m: FloatArray
    name: str = "anchor"
    row: IntArray = np.zeros(1, dtype=np.int64)
    freedom: IntArray = np.full(1, 3)

    def linearise(self, at: States, which: IntArray) -> Linearised:
        state = np.zeros((len(which), 3, at.width))
        state[:, :, POSITION] = at.R_nb
        shared = np.zeros((len(which), 3, len(at.constants)))
        return Linearised(at.p_n_m - self.p_n_m, state, shared)


def anchored(problem: SmoothingProblem) -> SmoothingProblem:
    """Return a chain whose position begins where it begins."""
    anchor = cast("Measurement", _Anchor(problem.start.p_n_m[:1]))
    return replace(problem, measurements=(*problem.measurements, anchor))
