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

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.special import softmax

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.frontend.calibration_request import CalibrationRequest
from fgnav.frontend.prepared import AttitudeDoubt, PreparedFlight
from fgnav.frontend.settings import ProblemSettings
from fgnav.geometry.rotations import log, transpose
from fgnav.graph.types.constants import flight_constant
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.likelihood.beside_phases import is_misfit
from fgnav.identification.likelihood.changed_samples import (
    Change,
    ChangedBy,
    attitude_covariance,
    solved_with_changes,
)
from fgnav.identification.likelihood.span_offsets import LIKELY, TURN
from fgnav.identification.likelihood.thinned import thinned
from fgnav.identification.noise.identified import Identified
from fgnav.identification.spans.errors import ANY_MIX, DRIFT, MIX, further
from fgnav.identification.spans.span_ends import Without, at_samples
from fgnav.identification.spans.span_fault import SpanFault
from fgnav.identification.spans.unit_odds import (
    Likeliest,
    likeliest_faults,
    limit_nats,
    unit_noise_nats,
)
from fgnav.identification.time_tags import AtTags, Build, TagSearch
from fgnav.identification.track.tags import middle_of_tags_s, with_tags_moved
from fgnav.identification.track.windows import EXCLUDED
from fgnav.solve.chain import solve_batch
from fgnav.types.flight import Flight, Imu

_MOST = 3  # of a flight
_STEPS = 4  # at most: each leaves a few hundredths of what is left
_ANY = 100.0  # sigmas by the thinned chain: next to nothing is known of it beside phases
_Excluded = tuple[TagSearch, AtTags, tuple[SpanFault, ...]]
Requests = Callable[[TagSearch, AtTags], tuple[CalibrationRequest, ...]]


def building(build: Build, faults: tuple[SpanFault, ...], *, is_exact: bool = False) -> Build:
    """Return what builds the problem of a flight without such faults; exact: nothing is left."""

    def built(flight: Flight, settings: ProblemSettings) -> PreparedFlight:
        imu = flight.imu
        if imu is None:
            return build(flight, settings)
        for one in faults:
            imu = one.undone(imu)
        prepared = build(replace(flight, imu=imu), settings)
        for one in () if is_exact else faults:
            prepared = prepared.changed(one.stepping)
        return prepared

    return built if faults else build


def with_span_faults(
    search: TagSearch,
    at_tags: AtTags,
    requests: Requests,
    begin: PreparedFlight | None,
    is_louder: bool,
) -> _Excluded:
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
    excluded = _excluded(search, requests, _Begun(at_tags, begin, is_louder))
    flight = search.flight
    has_gyroscope = flight.imu is not None and flight.imu.w_b_radps is not None
    if not (at_tags.moved.any() and has_gyroscope and flight.observations is not None):
        return excluded
    try:
        instead = _excluded(search, requests, _Begun(search.on_time()))
    except NoSolutionError:
        return excluded
    return max(excluded, instead, key=_less_odds)


class _Begun(NamedTuple):
    """What a flight says with its faults, its problem, and whether phases alone show its noise."""

    at_tags: AtTags
    prepared: PreparedFlight | None = None
    is_louder: bool = False


def _excluded(search: TagSearch, requests: Requests, begun: _Begun) -> _Excluded:
    """Return the same with tags as they are moved."""
    at_tags, begin, is_louder = begun
    faults: tuple[SpanFault, ...] = ()
    build, as_it_is = search.build, (search, at_tags, faults)
    for _ in range(_MOST):
        sought = likeliest_faults(search, at_tags, requests(search, at_tags), begin, is_louder)
        likeliest = sought.faults
        if not likeliest or _is_of_most(likeliest[0], search.flight.imu, at_tags.identified):
            break
        rest = search._replace(build=building(build, (*faults, *likeliest)))
        if not likeliest[0].is_likely:
            return rest, at_tags, (*faults, *likeliest)
        refined = _refined(as_it_is[0], at_tags, faults, sought)
        if refined is None:
            break
        rivals = (one for one in likeliest if one.sensor != refined.sensor)
        likeliest = (refined, *(one._replace(value=0 * one.value) for one in rivals))
        rest = search._replace(build=building(build, (*faults, *likeliest)))
        exact = search._replace(build=building(search.build, likeliest[:1], is_exact=True))
        try:
            after = rest.identified(at_tags.moved)
            if after is None or not _is_no_less_likely((rest, after), (search, at_tags), exact):
                break
        except NoSolutionError:  # then it is not what the flight contradicts
            break
        faults, search, at_tags, begin = (*faults, *likeliest), rest, after, None
        is_louder = False
    return as_it_is if at_tags.identified.exceeds_noise.any() else (search, at_tags, faults)


def _is_no_less_likely(
    after: tuple[TagSearch, AtTags], before: tuple[TagSearch, AtTags], exact: TagSearch
) -> bool:
    """Return whether a flight is no less likely without a fault: beside phases by all of it.

    By the chain as if nothing were left of it (``exact``): what its ends may leave makes a flight
    less likely by its spread alone.

    Raises
    ------
    NoSolutionError
        If its chain has no solution then.
    """
    without, with_it = _nats_by_phases(*after), _nats_by_phases(*before)
    if without is not None and with_it is not None:
        return without >= with_it
    exactly = exact.identified(after[1].moved)
    if exactly is None:
        return False
    return exactly.identified.likelihood >= before[1].identified.likelihood


def _nats_by_phases(search: TagSearch, at_tags: AtTags) -> float | None:
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
    return unit_noise_nats(search, at_tags, flight) - cost / 2


def _less_odds(excluded: _Excluded) -> float:
    """Return how likely a flight is without its faults, less the odds of all contradictions."""
    search, at_tags, faults = excluded
    nats = _nats_by_phases(search, at_tags)
    imu = search.flight.imu
    if nats is None or imu is None:
        return -np.inf
    likely = sum(one.is_likely for one in faults)
    others = bool(at_tags.moved.any()) + len(at_tags.identified.contradicted)
    return nats - likely * limit_nats(imu.t_s) - others * EXCLUDED


def _is_of_most(fault: SpanFault, imu: Imu | None, identified: Identified) -> bool:
    """Return whether a fault would be of most samples, where a unit is louder than any noise."""
    if imu is None or not identified.exceeds_noise.any():
        return False
    is_of_most = fault.shape not in (DRIFT, MIX) and fault.strikes(imu.t_s).mean() > 0.5
    return bool(is_of_most or not fault.is_likely)


def _refined(
    search: TagSearch,
    at_tags: AtTags,
    faults: tuple[SpanFault, ...],
    sought: Likeliest,
) -> SpanFault | None:
    """Return a fault by steps, its ends between samples, and what it leaves of attitudes.

    By the whole problem beside phases of arcs, which the thinned chain has not: None where that has
    no minimum without it, or mixed axes leave more than chance there. Gains about bent states
    mislead: by the chain an error that leaves a hundredth of the odds less takes its place.
    ``faults``: those taken out already.
    """
    flight = with_tags_moved(search.flight, at_tags.moved, middle_of_tags_s(search.flight.imu))

    def without(fault: SpanFault) -> SmoothingProblem:
        problem = building(search.build, (*faults, fault))(flight, search.settings).problem
        return problem if problem.phase is not None else thinned(problem)

    first = sought.errors[0]  # beside phases each minimum takes ten times as long
    if first.shape == DRIFT or without(first).phase is not None:
        best = _stepped(first, without)
        return None if best.fault.shape == MIX and best.is_left else best.fault
    every = [_stepped(one, without) for one in sought.errors]
    best = min(every, key=lambda one: one.cost)
    if every[0].cost < best.cost + 2 * LIKELY:
        best = every[0]
    fault = best.fault
    if best.cost == np.inf or (fault.shape == MIX and best.is_left):
        return None
    if fault.shape == MIX or flight.imu is None:
        return fault
    moved = _stepped(at_samples(fault, flight.imu.t_s, without), without)
    best = moved if moved.cost < np.inf else best
    if fault.shape == TURN and np.isfinite(fault.from_s) != np.isfinite(fault.until_s):
        every.append(_stepped(_other_side(best.fault), without))
    return _averaged(best, [one for one in every if one.fault is not fault])


class _Stepped(NamedTuple):
    """A fault, what it leaves, whether that is more than chance, and attitudes of keyframes."""

    fault: SpanFault
    cost: float = np.inf
    is_left: bool = True
    R_nb: FloatArray = np.empty((0, 3, 3))


def _other_side(fault: SpanFault) -> SpanFault:
    """Return axes that turn once as others before that, not after it, or the other way round."""
    other: dict[str, Any] = {
        "from_s": fault.until_s if fault.from_s == -np.inf else -np.inf,
        "until_s": fault.from_s if fault.until_s == np.inf else np.inf,
    }
    turned_back = fault._replace(begins_s=fault.ends_s, ends_s=fault.begins_s, value=-fault.value)
    return turned_back._replace(**other)


def _averaged(best: _Stepped, others: list[_Stepped]) -> SpanFault:
    """Return the fault that leaves least; attitudes are doubted for others by what these leave.

    Which sensor errs, and on which side of a turn, little tells but gravity (second moments as in
    ``lasting.averaging``).
    """
    fault, doubt = best.fault, best.fault.doubt
    if doubt is None:
        return fault
    like_it = [one for one in others if len(one.R_nb) == len(doubt.t_s)]
    shares = softmax([-one.cost / 2 for one in (best, *like_it)])[1:]
    P = doubt.covariance_rad2
    for share, one in zip(shares, like_it, strict=True):
        apart = log(transpose(best.R_nb) @ one.R_nb)
        P = P + share * apart[:, :, None] * apart[:, None]
    return fault._replace(doubt=doubt._replace(covariance_rad2=P))


def _stepped(fault: SpanFault, without: Without) -> _Stepped:
    """Return a fault by steps, each about the one before."""
    numbers = tuple(map(str, range(len(fault.value))))
    any_ = ANY_MIX if fault.shape == MIX else float(fault.sigma.max()) * _ANY
    part = flight_constant("span fault", numbers, "", any_, reported=False)

    def less(by: FloatArray) -> Change:
        return fault._replace(value=by).undone

    changes = tuple(map(less, np.diag(fault.sigma)))
    stepped = _Stepped(fault)
    for _ in range(_STEPS):
        problem = without(fault)
        solution = solved_with_changes(problem, ChangedBy((part,), changes, fault.sigma))
        if solution is None:
            break
        step = solution.states.constants[-len(numbers) :]
        sigma = np.sqrt(solution.constant_covariance[0].diagonal()[-len(numbers) :])
        doubt = AttitudeDoubt(problem.t_s, attitude_covariance(solution, -len(numbers)))
        value = further(fault.shape, fault.value, step)
        fault = fault._replace(value=value, doubt=doubt)
        R_nb, is_left = solution.states.R_nb, is_misfit(problem, solution.cost)
        stepped = _Stepped(fault, solution.cost, is_left, R_nb)
        if np.all(np.abs(step) < sigma):
            break
    return stepped
