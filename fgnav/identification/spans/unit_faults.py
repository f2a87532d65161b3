"""Faults of the inertial unit over a span of time: biases that step, other scales, turned axes.

Such an error is no noise: while it lasts, samples err alike. From one time to another it adds
``M(x) u`` to a sensor's samples x, u constant: M is one for a bias that steps, diag(x) for scales,
[x]x for axes that turn. Each is tested over all spans of a second or more, on the thinned chain at
the stated noise and at the noise identified. It is taken for true where the flight is likelier with
it than with that noise by the odds of any contradiction, and by as many again as there are seconds
at which it may begin, and than with an offset of any measurement over a span, if without it, its
noise identified anew, it is no less likely than before. Then samples are taken without it, and what
is left of it is a bias that may step at the ends of the span. Where the unit is louder than any
noise, errors of less than half of the record may be why: they stand if what is left is noise. Where
all of these leave more than chance axes may be mixed (``spans.mixed_axes``).
"""

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.frontend.calibration_request import CalibrationRequest
from fgnav.frontend.prepared import AttitudeDoubt, PreparedFlight
from fgnav.frontend.settings import ProblemSettings
from fgnav.graph.types.constants import flight_constant
from fgnav.graph.types.measurement import Linearised, Measurement
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import POSITION, ROTATION, States
from fgnav.identification.likelihood.beside_phases import chance_of, is_misfit, noise_gain
from fgnav.identification.likelihood.changed_samples import (
    Change,
    ChangedBy,
    solved_with_changes,
)
from fgnav.identification.likelihood.span_offsets import (
    LIKELY,
    Offset,
    of_biases,
    of_measurements,
)
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
from fgnav.identification.spans.errors import (
    ANY_MIX,
    DRIFT,
    ERRORS,
    MIX,
    SAMPLES,
    added,
    further,
)
from fgnav.identification.spans.mixed_axes import Built, mixed_axes
from fgnav.identification.spans.span_fault import SpanFault
from fgnav.identification.time_tags import AtTags, Build, TagSearch
from fgnav.identification.track.tags import middle_of_tags_s, with_tags_moved
from fgnav.identification.track.windows import EXCLUDED
from fgnav.solve.chain import solve_batch
from fgnav.types.flight import Flight, Imu

_MOST = 3  # of a flight
_STEPS = 4  # at most: each leaves a few hundredths of what is left
_ANY = 100.0  # sigmas by the thinned chain: next to nothing is known of it beside phases
_Mended = tuple[TagSearch, AtTags, tuple[SpanFault, ...]]
Requests = Callable[[TagSearch, AtTags], tuple[CalibrationRequest, ...]]


def building(build: Build, faults: tuple[SpanFault, ...]) -> Build:
    """Return what builds the problem of a flight without such faults."""

    def built(flight: Flight, settings: ProblemSettings) -> PreparedFlight:
        imu = flight.imu
        if imu is None:
            return build(flight, settings)
        for one in faults:
            imu = one.undone(imu)
        prepared = build(replace(flight, imu=imu), settings)
        for one in faults:
            prepared = prepared.changed(one.stepping)
        return prepared

    return built if faults else build


def with_span_faults(
    search: TagSearch,
    at_tags: AtTags,
    requests: Requests,
    begin: PreparedFlight | None,
    is_louder: bool,
) -> _Mended:
    """Return a search without faults of spans, what the flight says then, and the faults.

    Parameters
    ----------
    search : TagSearch
    at_tags : AtTags
    requests : callable
        What is to be estimated with a flight.
    begin : PreparedFlight or None
        Its problem, where tags and requests are as they were.
    is_louder : bool
        Whether phases of arcs, which the chain has not, show the noise that is identified.
    """
    mended = _mended(search, at_tags, requests, begin, is_louder)
    if not at_tags.moved.any() or _whole(search, at_tags) is None:
        return mended
    try:
        instead = _mended(search, search.on_time(), requests, None, is_louder=False)
    except NoSolutionError:
        return mended
    return max(mended, instead, key=_less_odds)


def _mended(
    search: TagSearch,
    at_tags: AtTags,
    requests: Requests,
    begin: PreparedFlight | None,
    is_louder: bool,
) -> _Mended:
    """Return the same with tags as they are moved."""
    faults: tuple[SpanFault, ...] = ()
    build, as_it_is = search.build, (search, at_tags, faults)
    for _ in range(_MOST):
        likeliest = _likeliest(search, at_tags, requests(search, at_tags), begin, is_louder)
        if not likeliest or _is_of_most(likeliest[0], search.flight.imu, at_tags.identified):
            break
        rest = search._replace(build=building(build, (*faults, *likeliest)))
        if not likeliest[0].is_likely:
            return rest, at_tags, (*faults, *likeliest)
        refined = _refined(as_it_is[0], at_tags, faults, likeliest[0])
        if refined is None:
            break
        likeliest = (refined, *likeliest[1:])
        rest = search._replace(build=building(build, (*faults, *likeliest)))
        try:
            after = rest.identified(at_tags.moved)
        except NoSolutionError:  # then it is not what the flight contradicts
            break
        if after is None or not _is_no_less_likely((rest, after), (search, at_tags)):
            break
        faults, search, at_tags, begin = (*faults, *likeliest), rest, after, None
        is_louder = False
    return as_it_is if at_tags.identified.exceeds_noise.any() else (search, at_tags, faults)


def _is_no_less_likely(after: tuple[TagSearch, AtTags], before: tuple[TagSearch, AtTags]) -> bool:
    """Return whether a flight is no less likely without a fault: beside phases by all of it."""
    without, with_it = _whole(*after), _whole(*before)
    if without is None or with_it is None:
        return after[1].identified.likelihood >= before[1].identified.likelihood
    return without >= with_it


def _whole(search: TagSearch, at_tags: AtTags) -> float | None:
    """Return how likely a flight is by all of its problem, its unit as loud as identified.

    None where it has no phases of arcs.
    """
    flight = with_tags_moved(search.flight, at_tags.moved, middle_of_tags_s(search.flight.imu))
    problem = search.build(flight, search.settings).problem
    if problem.phase is None:
        return None
    try:
        cost = solve_batch(problem).cost
    except NoSolutionError:
        return -np.inf
    return _noise_gain(search, at_tags, flight) - cost / 2


def _noise_gain(search: TagSearch, at_tags: AtTags, flight: Flight) -> float:
    """Return what the unit's white noise gains of a whole problem as it is identified."""

    def louder(factors: dict[str, float]) -> SmoothingProblem:
        return search.build(with_factors(flight, factors), search.settings).problem

    factors = at_tags.identified.factors
    return noise_gain({one: factors[one] for one in WHITE if one in factors}, louder)


def _less_odds(mended: _Mended) -> float:
    """Return how likely a flight is without its faults, less the odds of all contradictions."""
    search, at_tags, faults = mended
    whole = _whole(search, at_tags)
    imu = search.flight.imu
    if whole is None or imu is None:
        return -np.inf
    likely = sum(one.is_likely for one in faults)
    others = bool(at_tags.moved.any()) + len(at_tags.identified.contradicted)
    return whole - likely * _limit(imu.t_s) - others * EXCLUDED


def _is_of_most(fault: SpanFault, imu: Imu | None, identified: Identified) -> bool:
    """Return whether a fault would be of most samples, where a unit is louder than any noise."""
    if imu is None or not identified.exceeds_noise.any():
        return False
    is_of_most = fault.shape not in (DRIFT, MIX) and fault.strikes(imu.t_s).mean() > 0.5
    return bool(is_of_most or not fault.is_likely)


def _likeliest(
    search: TagSearch,
    at_tags: AtTags,
    requests: tuple[CalibrationRequest, ...],
    begin: PreparedFlight | None,
    is_louder: bool,
) -> tuple[SpanFault, ...]:
    """Return the fault that may be, and one of the other sensor that is as likely, if there is.

    Empty where odds are a hundred to one against it, beside those of any contradiction.
    """
    identified = at_tags.identified
    flight = with_tags_moved(search.flight, at_tags.moved, middle_of_tags_s(search.flight.imu))
    settings = replace(search.settings, calibration=requests)
    prepared = search.build(flight, settings) if begin is None else begin
    if prepared.problem.phase is not None:
        by_phases = _by_phases(search, at_tags, prepared, flight)
        if by_phases:
            return by_phases
    odds = _odds(search, identified, (flight, settings, prepared), is_louder)
    if odds is None or odds.nats < -LIKELY or odds.best.of_measurements >= odds.best.offset.gain:
        return ()
    share, best = float(1.0 / (1.0 + np.exp(-odds.nats))), odds.best
    if is_turned_throughout(best.problem, best.at, best.offset, len(odds.t_s)):
        return ()
    return tuple(
        _fault(one, (odds.t_s, prepared.imu), share, is_first=one is best.offset)
        for one in best.offsets
    )


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
    return _Odds(best, best.likelihood - gain - _limit(chain.t_s), chain.t_s)


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
    noise = _noise_gain(search, at_tags, flight)
    nats = offsets[0].gain - noise - _limit(t_s) - np.log(len(ERRORS))
    if nats < -LIKELY:
        return ()
    share = float(1.0 / (1.0 + np.exp(-nats)))
    return tuple(
        _fault(one, (t_s, prepared.imu), share, is_first=one is offsets[0]) for one in offsets
    )


def _mixed_by_phases(problem: SmoothingProblem, built: Built) -> tuple[Offset, ...]:
    """Return how axes are mixed, where errors of three numbers leave the chain more, too."""
    try:
        stated = solve_batch(problem)
        if not is_misfit(problem, stated.cost) or "gyroscope" not in (
            problem.motion.noise_parts().names
        ):
            return ()
        chain = _Tested.of(anchored(thinned(problem)), 0.0)
    except NoSolutionError:
        return ()
    return mixed_axes(problem, stated, built) if chain.is_left else ()


def _changed(flight: Flight, change: Change) -> Flight:
    return flight if flight.imu is None else replace(flight, imu=change(flight.imu))


def _limit(t_s: FloatArray) -> float:
    """Return the nats beyond which an error that begins at any second is likelier than none."""
    return EXCLUDED + seconds_nats(t_s)


def _refined(
    search: TagSearch, at_tags: AtTags, faults: tuple[SpanFault, ...], fault: SpanFault
) -> SpanFault | None:
    """Return a fault by steps, each about the one before, and what it leaves of attitudes.

    By the whole problem beside phases of arcs, which the thinned chain has not: None where mixed
    axes leave more than chance there. ``faults``: those taken out already.
    """
    flight = with_tags_moved(search.flight, at_tags.moved, middle_of_tags_s(search.flight.imu))
    numbers = tuple(map(str, range(len(fault.value))))
    any_ = ANY_MIX if fault.shape == MIX else float(fault.sigma.max()) * _ANY
    part = flight_constant("span fault", numbers, "", any_, reported=False)

    def less(by: FloatArray) -> Change:
        return fault._replace(value=by).undone

    changes = tuple(map(less, np.diag(fault.sigma)))
    is_left = fault.shape == MIX
    for _ in range(_STEPS):
        build = building(search.build, (*faults, fault))
        problem = build(flight, search.settings).problem
        problem = problem if problem.phase is not None else thinned(problem)
        solution = solved_with_changes(problem, ChangedBy((part,), changes, fault.sigma))
        if solution is None:
            break
        step = solution.states.constants[-len(numbers) :]
        sigma = np.sqrt(solution.constant_covariance[0].diagonal()[-len(numbers) :])
        doubt = AttitudeDoubt(problem.t_s, _attitude_covariance(solution, len(numbers)))
        value = further(fault.shape, fault.value, step)
        fault = fault._replace(value=value, doubt=doubt)
        is_left = fault.shape == MIX and is_misfit(problem, solution.cost)
        if np.all(np.abs(step) < sigma):
            break
    return None if is_left else fault


def _attitude_covariance(solution: Solution, g: int) -> FloatArray:
    """Return the covariance of attitudes by a fault, the last g constants, (n, 3, 3)."""
    C = solution.constant_covariance[0, -g:, -g:]
    X = solution.constant_cross[:, ROTATION, -g:]
    return np.asarray(X @ np.linalg.solve(C, X.swapaxes(1, 2)))


class _Tested(NamedTuple):
    """The likeliest offsets of the unit, what its noise has gained, and a measurement's offset."""

    offsets: tuple[Offset, ...]  # of sensors, as likely as the first
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
        return cls(offsets, noise, gains, small, solution.states, is_left)


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
