"""Fixes that are off from one time to another: gross errors, which no white noise explains.

A receiver that fixes wrong integers, or sees mirrored signals, states its sigma as before and is
off by decimetres for an epoch or for seconds. Taken for noise, such fixes make all positions as
unsure as they are, and those in the middle of a span show in no residual at all: its ends do.

An offset u of a fix's position or velocity over a span of keyframes, a single one at least, gains
``s' N^-1 s / 2`` of log likelihood (``likelihood.span_offsets``) on the chain of all keyframes that
measured, at fixes' noise as stated. Asked are those whose noise is louder than stated, or is not
stated. It is taken for true where the gain is more than the odds of any contradiction for each
keyframe, and as many again as there are spans, times the overdispersion of the flight, and more
than an error of the inertial unit gains in the same window; and all of them together where they
are likelier than the louder noise. What a fix says there is left out, and the flight is identified
anew, until no such span is left [1]_.

References
----------
.. [1] Teunissen: Distributional theory for the DIA method, Journal of Geodesy 92, 2018; Baarda:
   A testing procedure for use in geodetic networks, 1968: one after the other, the greatest first.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.frontend.calibration_request import CalibrationRequest
from fgnav.frontend.matching import SAME_S
from fgnav.frontend.prepared import PreparedFlight
from fgnav.frontend.sensors.rest import AT_REST
from fgnav.frontend.settings import ProblemSettings
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.measurement import Measurement
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.likelihood.span_offsets import measurements_against_unit
from fgnav.identification.likelihood.thinned import Some, thinned
from fgnav.identification.noise.identified import Identified
from fgnav.identification.noise.stated import with_factors, with_rest
from fgnav.identification.noise.thinned_flight import ThinnedFlight
from fgnav.identification.time_tags import AtTags, Build, TagSearch
from fgnav.identification.track.tags import middle_of_tags_s, with_tags_moved
from fgnav.identification.track.windows import EXCLUDED
from fgnav.solve.chain import solve_batch
from fgnav.types.estimate import Rejected
from fgnav.types.flight import Fixes, Flight

_TIMES = 2  # that noise is identified without them
_ROUNDS = 8  # at the same noise: of each window one gross error at a time
_UNITS = {"position": "m", "velocity": "m/s"}
Requests = Callable[[TagSearch, AtTags], tuple[CalibrationRequest, ...]]


class GrossError(NamedTuple):
    """What is off of a receiver's fixes, and from when to when, both fixes included."""

    what: str  # "position", "velocity"
    antenna: str
    from_s: float
    until_s: float
    size: float  # m or m/s

    @property
    def rejected(self) -> Rejected:
        """As it is listed."""
        off = f"{self.size:.2g} {_UNITS[self.what]}"
        return Rejected(
            what=self.what,
            link=self.antenna,
            from_s=self.from_s,
            until_s=self.until_s,
            reason=f"{off} off what all else measures: left out",
        )


def leaving_out(build: Build, errors: tuple[GrossError, ...]) -> Build:
    """Return what builds the problem of a flight without gross errors."""

    def built(flight: Flight, settings: ProblemSettings) -> PreparedFlight:
        return build(flight, settings).changed(lambda problem: _without(problem, errors))

    return built if errors else build


def without_gross_errors(
    search: TagSearch, at_tags: AtTags, requests: Requests
) -> tuple[TagSearch, AtTags, tuple[GrossError, ...]]:
    """Return a search without gross errors of fixes, what the flight says then, and the errors.

    Parameters
    ----------
    search : TagSearch
    at_tags : AtTags
        What the flight says: with a gyroscope, by which fixes hang together.
    requests : callable
        What is to be estimated with a flight.
    """
    errors: tuple[GrossError, ...] = ()
    build, fixes = search.build, search.flight.fixes
    if fixes is None or search.flight.observations is not None:
        return search, at_tags, errors
    for _ in range(_TIMES):
        identified = at_tags.identified
        kinds = _suspect_kinds(identified)
        is_off = bool(at_tags.moved.any() or identified.times.significant.any())
        if identified.exceeds_noise.any() or not (kinds or is_off):
            break
        try:
            more = _gross_errors(search, at_tags, requests(search, at_tags), kinds)
            more = more or (_instead(search, at_tags) if is_off else ())
            if not more:
                break
            rest = search._replace(build=leaving_out(build, (*errors, *more)))
            after = rest.likeliest(rest.build(rest.flight, rest.settings))
        except NoSolutionError:  # then it is not what the flight contradicts
            break
        if after is None:
            break
        search, at_tags, errors = rest, after, (*errors, *more)
    return search, at_tags, tuple(sorted(errors, key=lambda one: one.from_s))


def _gross_errors(
    search: TagSearch,
    at_tags: AtTags,
    requests: tuple[CalibrationRequest, ...],
    kinds: frozenset[str],
) -> tuple[GrossError, ...]:
    """Return gross errors that do not overlap, of kinds of measurements.

    Raises
    ------
    NoSolutionError
        If the chain has no minimum.
    """
    flight, fixes, identified = search.flight, search.flight.fixes, at_tags.identified
    if fixes is None or not kinds:
        return ()
    flight = with_tags_moved(flight, at_tags.moved, middle_of_tags_s(flight.imu))
    settings = replace(search.settings, calibration=requests)
    factors = _of_right_fixes(identified)
    prepared = search.build(with_factors(flight, factors), with_rest(settings, factors))
    likely = _one_after_the_other(thinned(prepared.problem, apart_s=0.0), kinds, fixes, EXCLUDED)
    if not likely:
        return ()
    dense = ThinnedFlight.of(flight, search.build(flight, settings), (), apart_s=0.0)
    by_noise = dense.likelihood_at(identified.factors) - dense.likelihood_at(factors)
    by_errors = sum(one.nats for one in likely)
    return tuple(one.error for one in likely) if by_errors > by_noise else ()


def _instead(search: TagSearch, at_tags: AtTags) -> tuple[GrossError, ...]:
    """Return gross errors with which clock and velocities are in time, where that is likelier.

    An offset that is the same all along a span is one event, however many fixes have it.

    Raises
    ------
    NoSolutionError
        If the chain has no minimum.
    """
    fixes, identified = search.flight.fixes, at_tags.identified
    if fixes is None:
        return ()
    contradicted = identified.contradicted
    factors = {one: by for one, by in identified.factors.items() if one not in contradicted}
    flight, settings = with_factors(search.flight, factors), with_rest(search.settings, factors)
    chain = thinned(search.build(flight, settings).problem)
    each_nats = 1.0 / len(chain.t_s)  # of spans as likely the shorter: they end, of n, after n
    likely = _one_after_the_other(chain, frozenset(_UNITS), fixes, each_nats)
    if not likely or sum(one.nats for one in likely) <= search.gained(at_tags, factors):
        return ()
    return tuple(one.error for one in likely)


def _one_after_the_other(
    chain: SmoothingProblem, kinds: frozenset[str], fixes: Fixes, each_nats: float
) -> tuple["_Likely", ...]:
    """Return gross errors of a chain, the greatest first, then of what is left."""
    likely: tuple[_Likely, ...] = ()
    for _ in range(_ROUNDS):
        rest = _without(chain, tuple(one.error for one in likely))
        more = _likely(rest, kinds, fixes.antenna, each_nats)
        if not more:
            break
        likely = (*likely, *more)
    return likely


class _Likely(NamedTuple):
    """A gross error, and by how much it is likelier than none."""

    error: GrossError
    nats: float


def _suspect_kinds(identified: Identified) -> frozenset[str]:
    """Return what of fixes is louder than stated, or is not stated: there is what to explain."""
    used = zip(identified.names, identified.factor, identified.used, identified.stated, strict=True)
    suspect = (
        name.removesuffix(AT_REST)
        for name, factor, is_used, is_stated in used
        if is_used and (factor > 1.0 or not is_stated)
    )
    return frozenset(suspect) & _UNITS.keys()


def _of_right_fixes(identified: Identified) -> dict[str, float]:
    """Return factors on noise where fixes are as stated but for gross errors."""
    return {
        name: factor
        for name, factor in identified.factors.items()
        if factor < 1.0
        or name.removesuffix(AT_REST) not in _UNITS
        or name not in identified.contradicted
    }


def _likely(
    chain: SmoothingProblem, kinds: frozenset[str], antenna: str, each_nats: float
) -> tuple[_Likely, ...]:
    """Return gross errors of a chain, the greatest of each window; none without a gyroscope.

    ``each_nats``: the odds against each keyframe of a span, beside those against the span.
    """
    if not isinstance(chain.motion, Inertial):
        return ()
    solution = solve_batch(chain, begin=solve_batch(chain).states)
    measured = tuple(one for one in chain.measurements if one.name in kinds)
    part = replace(chain, measurements=measured)
    pairs, spread = measurements_against_unit(part, solution, each_nats)
    chosen = float(np.log(len(kinds) * _spans(len(chain.t_s), len(pairs))))
    taken: dict[int, _Likely] = {}
    for k in sorted(range(len(pairs)), key=lambda k: -pairs[k][0].gain):
        one, of_unit = pairs[k]
        limit = max(each_nats * (one.end - one.begin), EXCLUDED) + chosen
        # Of windows that overlap the other is asked again, by what is left.
        if one.gain > max(spread * limit, of_unit.gain) and not {k - 1, k + 1} & taken.keys():
            size = float(np.linalg.norm(one.value))
            last = one.end - (one.end < len(chain.t_s) - 1)  # the record's last is in its interval
            from_s, until_s = float(chain.t_s[one.begin]), float(chain.t_s[last])
            error = GrossError(one.sensor, antenna, from_s, until_s, size)
            taken[k] = _Likely(error, one.gain - limit)
    return tuple(taken.values())


def _spans(keyframes: int, windows: int) -> float:
    """Return the number of spans in all windows."""
    within = keyframes / windows
    return windows * within * (within + 1) / 2


def _without(problem: SmoothingProblem, errors: tuple[GrossError, ...]) -> SmoothingProblem:
    measurements = (_right(problem.t_s, one, errors) for one in problem.measurements)
    return replace(problem, measurements=tuple(one for one in measurements if len(one.row)))


def _right(t_s: FloatArray, one: Measurement, errors: tuple[GrossError, ...]) -> Measurement:
    """Return a measurement without its gross errors."""
    at_s, is_right = t_s[one.row], np.ones(len(one.row), dtype=np.bool_)
    for error in errors:
        if error.what == one.name:
            is_right &= (at_s < error.from_s - SAME_S) | (at_s > error.until_s + SAME_S)
    if is_right.all():
        return one
    which = np.flatnonzero(is_right)
    return Some(one, which, row=one.row[which])
