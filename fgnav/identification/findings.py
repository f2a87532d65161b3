"""What a flight says of its noise, its times and its set-up that is to replace what it has."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, chdtri

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.frontend.calibration_request import CalibrationRequest, calibration_requests
from fgnav.frontend.prepared import PreparedFlight
from fgnav.frontend.settings import ProblemSettings
from fgnav.graph.innovation.band import throughout
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.array.choice import Turn, chosen_turn, with_boresight
from fgnav.identification.array.places import Places, places_of, with_reference
from fgnav.identification.array.turn import others_tell, request_of, sentence
from fgnav.identification.exclusion import Exclusion
from fgnav.identification.lasting.arm import LEVER_ARM
from fgnav.identification.lasting.choice import Cause, Lasting, likeliest_cause
from fgnav.identification.lasting.lost_samples import LostSamples
from fgnav.identification.late_velocities import with_late_velocities
from fgnav.identification.likelihood.bent_clock import informed_by_problem
from fgnav.identification.likelihood.beside_phases import is_misfit, white_noise_factors
from fgnav.identification.likelihood.satellite_errors import satellite_error_factors, with_errors
from fgnav.identification.likelihood.thinned import thinned
from fgnav.identification.noise.identified import Identified
from fgnav.identification.noise.stated import with_factors
from fgnav.identification.notes import (
    constant_notes,
    exclusion_notes,
    noise_notes,
    satellite_error_notes,
)
from fgnav.identification.spans.gross_errors import GrossError, without_gross_errors
from fgnav.identification.spans.instrument_faults import without_faulty_instrument
from fgnav.identification.spans.span_fault import SpanFault
from fgnav.identification.spans.unit_faults import with_span_faults
from fgnav.identification.time_tags import (
    AtTags,
    Build,
    TagSearch,
    common_likelihoods,
    with_rates_of,
)
from fgnav.identification.track.tags import middle_of_tags_s, with_exact_tags, with_tags_moved
from fgnav.solve.chain import solve_batch
from fgnav.types.estimate import Consistency, Rejected
from fgnav.types.flight import Flight, Imu

FEWEST = 10  # keyframes that measured something: they tell noise to a quarter, fewer to little


class Findings(NamedTuple):
    """What a flight says of its noise and times that is to replace what it has."""

    factors: dict[str, float]
    moved: FloatArray  # (2,), of the unit's tags: s, ppm
    calibration: tuple[CalibrationRequest, ...]
    notes: tuple[str, ...]
    tests: tuple[Consistency, ...] = ()
    middle_s: float = 0.0  # of the record that says so: the offset holds there
    reference: int = 0  # antenna against which the array's others are
    turn: Turn | None = None
    faults: tuple[SpanFault, ...] = ()
    errors: Mapping[str, float] = MappingProxyType({})  # of satellites, as factors
    cause: Cause | None = None
    out: tuple[Exclusion, ...] = ()  # of instruments
    gross: tuple[GrossError, ...] = ()  # of fixes
    is_as_stated: bool = False  # all but those errors, and what is not likely

    @property
    def rejected(self) -> tuple[Rejected, ...]:
        """What is left out."""
        return _rejections(self.out, self.gross)

    def decided_by(self, until_s: float) -> "Findings | None":
        """Return the same without what is not likely at a record's end; None if nothing is left."""
        if self.is_as_stated and not self.errors:
            return None
        faults = tuple(one.up_to(until_s) for one in self.faults if one.is_likely)
        cause = self.cause if self.cause is not None and self.cause.is_likely else None
        ended = {one.sentence: one.up_to(until_s).sentence for one in self.faults}
        notes = tuple(ended.get(note, note) for note in self.notes)
        return self._replace(faults=faults, cause=cause, notes=notes)


def findings(
    flight: Flight, settings: ProblemSettings, prepared: PreparedFlight, build: Build
) -> Findings | None:
    """Return what a flight says of its noise and times; None where that is what it has.

    Parameters as in ``with_identified_noise``.

    Raises
    ------
    NoSolutionError
        If the chain about which it is to be identified has no solution.
    """
    if prepared.integers is None and prepared.imu.w_b_radps is None:
        return None
    subject = _subject(flight, settings, prepared, build)
    search, places, cause = subject.search, subject.places, subject.cause
    problem = subject.prepared.problem
    if _measured(problem) < FEWEST:
        return None
    at_tags = search.likeliest(subject.prepared)
    if at_tags is None:  # the motion's noise stands for accelerations of unknown direction, too
        raise NoSolutionError("nothing tells the heading")
    search, at_tags, gross = without_gross_errors(search.informed(at_tags), at_tags, _requests)
    search, at_tags = with_late_velocities(search, at_tags)
    search, turn, at_tags, out = _in_agreement(search, at_tags, problem)
    is_mended = bool(turn or out or gross)
    by_chain, at_tags = at_tags, _beside_phases(search, at_tags, subject, is_mended)
    begun = None if is_mended or not _has_stated(subject, search, at_tags) else subject.prepared
    is_louder = at_tags.identified.factors != by_chain.identified.factors  # no chain tells it
    search, after, faults = with_span_faults(search, at_tags, _requests, begun, is_louder)
    if any(one.is_likely for one in faults):
        at_tags = _beside_phases(search, after, subject, is_mended=True)
    identified = at_tags.identified
    requests = informed_by_problem(search, at_tags, _requests(search, at_tags))
    tests = (*places.tests, *_tests(subject.search.flight.imu, identified))
    is_same = _is_as_stated(at_tags, requests, settings.calibration)
    is_mended = bool(out or gross or any(one.is_likely for one in faults))
    is_mended |= cause is not None
    is_as_stated = is_same and not (tests or is_mended)
    if is_as_stated and not (subject.errors or faults or cause):
        return None
    turned = () if turn is None else (sentence(turn.vector, turn.axes),)
    return Findings(
        factors=identified.factors,
        moved=at_tags.moved,
        calibration=requests,
        notes=(
            *places.notes,
            *(() if cause is None else cause.sentences),
            *exclusion_notes(_rejections(out, gross)),
            *turned,
            *(one.sentence for one in faults if one.is_likely),
            *_notes(subject, at_tags, requests),
        ),
        tests=tests,
        middle_s=middle_of_tags_s(subject.search.flight.imu),
        reference=places.reference,
        turn=turn,
        faults=faults,
        errors=subject.errors,
        cause=cause,
        out=out,
        gross=gross,
        is_as_stated=is_as_stated,
    )


def _rejections(out: tuple[Exclusion, ...], gross: tuple[GrossError, ...]) -> tuple[Rejected, ...]:
    """Return what is left out of instruments and of fixes, in order of time each."""
    of_instruments = (rejected for one in out for rejected in one.rejected)
    return (*of_instruments, *(one.rejected for one in gross))


class _Subject(NamedTuple):
    """A flight to be identified: with exact tags, places of antennas and errors of satellites."""

    search: TagSearch
    prepared: PreparedFlight
    places: Places
    errors: dict[str, float]
    cause: Cause | None


def _subject(
    flight: Flight, settings: ProblemSettings, prepared: PreparedFlight, build: Build
) -> _Subject:
    exact = with_exact_tags(flight)
    if exact is not flight:  # the clock is tested whatever its doubt
        flight, prepared = exact, build(exact, settings)
    places = places_of(flight, settings.calibration, prepared)
    if places.requests:
        settings = replace(settings, calibration=(*settings.calibration, *places.requests))
        flight = with_reference(flight, places.reference)
        prepared = build(flight, settings)
    phase = prepared.problem.phase  # against a base errors of satellites are other ones
    errors = {} if phase is None or flight.base is not None else satellite_error_factors(phase)
    prepared = _with_minimum(with_satellite_errors(prepared, errors))

    def built(flight: Flight, settings: ProblemSettings) -> PreparedFlight:
        return with_satellite_errors(build(flight, settings), errors)

    as_stated = _Subject(TagSearch(flight, settings, built), prepared, places, errors, None)
    cause = _likeliest_cause(as_stated.search, prepared)
    if cause is None:
        return as_stated
    settings = replace(settings, calibration=(*settings.calibration, *cause.requests))
    if cause.is_likely:
        flight = cause.undone(flight)

    def with_cause(flight: Flight, settings: ProblemSettings) -> PreparedFlight:
        return built(flight, settings).changed(cause.in_doubt)

    search = TagSearch(flight, settings, with_cause)
    subject = _Subject(search, with_cause(flight, settings), places, errors, cause)
    return subject if _is_likelier(subject, as_stated) else as_stated


def _with_minimum(prepared: PreparedFlight) -> PreparedFlight:
    """Return a problem beside phases with its minimum, if its variants' are near.

    They are not where more is left than chance: from states bent to a wrong problem the way to the
    right one's is longer than from an array's attitudes, or has no end.
    """
    problem = prepared.problem
    if problem.phase is None:  # thinned it costs little
        return prepared
    try:
        solution = solve_batch(problem)
    except NoSolutionError:
        return prepared
    is_near = not is_misfit(problem, solution.cost)
    return replace(prepared, minimum=solution.states) if is_near else prepared


def _is_likelier(subject: _Subject, as_stated: _Subject) -> bool:
    """Return whether samples are lost, where noise and clock may be others as well.

    As many whole numbers as they are fit whatever else is not as stated. Of other causes, and
    beside phases, what is stated decides.
    """
    cause, problem = subject.cause, as_stated.prepared.problem
    if not isinstance(cause, LostSamples) or problem.phase is not None:
        return True
    lost, none = common_likelihoods(
        (subject.search, subject.prepared), (as_stated.search, as_stated.prepared)
    )
    return none == -np.inf or lost - none > cause.odds


def _likeliest_cause(search: TagSearch, prepared: PreparedFlight) -> Cause | None:
    """Return a landmark, axes of a detector or of the unit, or tags, that are not as stated."""
    flight, settings = search.flight, search.settings

    def problem(prepared: PreparedFlight) -> SmoothingProblem:
        """Return the whole problem beside phases of arcs, which no thinned one has."""
        has_phases = prepared.problem.phase is not None
        return prepared.from_minimum if has_phases else thinned(prepared.problem)

    def with_noise(factors: dict[str, float]) -> SmoothingProblem:
        return problem(search.build(with_factors(flight, factors), settings))

    def estimating(request: CalibrationRequest) -> SmoothingProblem:
        alike = with_rates_of(settings, prepared.problem)
        more = replace(alike, calibration=(*settings.calibration, request))
        return problem(search.build(flight, more))

    has_velocities = flight.fixes is not None and flight.fixes.v_n_mps is not None
    words = ("lever-arm", "velocity-delay") if has_velocities else ("lever-arm",)
    requested = [one.kind for one in settings.calibration]
    others = calibration_requests([word for word in words if word not in requested])
    middle_s = middle_of_tags_s(flight.imu)
    return likeliest_cause(problem(prepared), middle_s, with_noise, estimating, others)


def _notes(
    subject: _Subject, at_tags: AtTags, requests: tuple[CalibrationRequest, ...]
) -> tuple[str, ...]:
    """Return what is to be said of noise, of errors of satellites, and of constants."""
    flight, identified, cause = subject.search.flight, at_tags.identified, subject.cause
    if isinstance(cause, Lasting) and cause.error.kind == LEVER_ARM:
        identified = replace(identified, arm=None)  # said already, by phases
    return (
        *noise_notes(flight.imu, identified),
        *satellite_error_notes(flight.gnss_noise, subject.errors),
        *constant_notes(identified, at_tags.moved, requests),
    )


def with_satellite_errors(prepared: PreparedFlight, factors: Mapping[str, float]) -> PreparedFlight:
    """Return the problem with factors on errors of satellites."""

    def changed(problem: SmoothingProblem) -> SmoothingProblem:
        phase = problem.phase
        return problem if phase is None else replace(problem, phase=with_errors(phase, factors))

    return prepared.changed(changed) if factors else prepared


def _measured(problem: SmoothingProblem) -> int:
    """Return how many keyframes anything is measured at."""
    measured = np.zeros(len(problem.t_s), dtype=np.bool_)
    for one in problem.measurements:
        measured[one.row] = True
    return int(measured.sum())


def _in_agreement(
    search: TagSearch, at_tags: AtTags, problem: SmoothingProblem
) -> tuple[TagSearch, Turn | None, AtTags, tuple[Exclusion, ...]]:
    """Return a flight in one set of axes, or without an instrument's fault where that is likelier.

    And then in one set of axes as well.
    """
    in_axes = _in_body_axes(search, at_tags, problem)
    rest = without_faulty_instrument(search, at_tags, in_axes[2], _requests)
    if rest is None:
        return *in_axes, ()
    return *_in_body_axes(rest.search, rest.at_tags, problem), (rest.out,)


def _in_body_axes(
    search: TagSearch, at_tags: AtTags, problem: SmoothingProblem
) -> tuple[TagSearch, Turn | None, AtTags]:
    """Return a flight whose array, unit and detector stand in one set of axes, or are estimated."""
    turn, after = chosen_turn(search, at_tags, arbitrated=others_tell(problem))
    if turn is None:
        return search, None, after
    detector = with_boresight(search, at_tags, after)
    if detector is None:
        return _turned_back(search, turn), turn, after
    return detector[0], None, detector[1]


def _turned_back(search: TagSearch, turn: Turn) -> TagSearch:
    """Return a flight with a turn taken back, what remains of it estimated."""
    request, settings = request_of(turn.vector, turn.axes), search.settings
    settings = replace(settings, calibration=(*settings.calibration, request))
    return search._replace(flight=turn.back(search.flight), settings=settings)


def _is_as_stated(
    at_tags: AtTags,
    requests: tuple[CalibrationRequest, ...],
    stated: tuple[CalibrationRequest, ...],
) -> bool:
    is_changed = at_tags.identified.used.any() or at_tags.moved.any()
    return requests == stated and not is_changed


def _requests(search: TagSearch, at_tags: AtTags) -> tuple[CalibrationRequest, ...]:
    """Return what is to be estimated: as requested, in turn, then what proved not to be zero."""
    requested, identified = search.settings.calibration, at_tags.identified
    moved = at_tags.moved
    kinds = {one.kind: one for one in requested}
    times, is_raw = identified.times, search.flight.observations is not None
    significant = times.significant
    wanted = {
        "lever-arm": identified.arm is not None and identified.arm.significant,
        "clock": not is_raw and bool(moved.any() or significant[:2].any()),
        "velocity-delay": bool(significant[2]),
    }
    for kind, needed in wanted.items():
        if needed and kind not in kinds:
            kinds[kind] = calibration_requests([kind])[0]
    if "clock" in kinds and moved.any():
        both = np.add(kinds["clock"].moved, moved)
        kinds["clock"] = replace(kinds["clock"], moved=(float(both[0]), float(both[1])))
    if "velocity-delay" in kinds and significant[2]:
        kinds["velocity-delay"] = replace(kinds["velocity-delay"], start=float(times.value[2]))
    as_requested = [kinds[one.kind] if one.kind in wanted else one for one in requested]
    words = [one.kind for one in requested]
    return (*as_requested, *(one for kind, one in kinds.items() if kind not in words))


def _has_stated(subject: _Subject, search: TagSearch, at_tags: AtTags) -> bool:
    """Return whether tags and what is to be estimated are as they were."""
    return _requests(search, at_tags) == subject.search.settings.calibration and not (
        at_tags.moved.any()
    )


def _beside_phases(
    search: TagSearch, at_tags: AtTags, subject: _Subject, is_mended: bool
) -> AtTags:
    """Return what is identified, with the unit as loud as the phases of arcs show it, if any.

    ``is_mended``: whether the subject's own problem is another by now.
    """
    identified, moved = at_tags.identified, at_tags.moved
    problem, requests = subject.prepared.from_minimum, _requests(search, at_tags)
    if problem.phase is None:
        return at_tags
    flight, settings = search.flight, replace(search.settings, calibration=requests)
    at_moved = with_tags_moved(flight, moved, middle_of_tags_s(flight.imu))

    def changed(
        factors: dict[str, float], settings: ProblemSettings = settings
    ) -> SmoothingProblem:
        louder = with_factors(at_moved, identified.scaled(factors).factors)
        return search.build(louder, settings).problem

    is_same = _is_as_stated(at_tags, requests, subject.search.settings.calibration)
    begin = problem if is_same and not is_mended else changed({})
    alike = partial(changed, settings=with_rates_of(settings, begin))
    return AtTags(identified.scaled(white_noise_factors(begin, alike)), moved)


def _tests(imu: Imu | None, identified: Identified) -> tuple[Consistency, ...]:
    """Return how far the inertial unit is from what it states, where that is no noise any more.

    Its innovations are those of all other sensors, which such a noise explains away: NIS is by the
    stated one, the square of the factor between both.
    """
    if imu is None:
        return ()
    t_s = imu.t_s
    freedom = 3 * len(t_s)
    return tuple(
        Consistency(
            what=name,
            count=len(t_s),
            freedom=freedom,
            nis=factor**2,
            beyond_99=float(chdtrc(3, chdtri(3, 0.01) / factor**2)),
            contradictions=(throughout(t_s, freedom, factor**2),),
        )
        for name, factor in identified.beyond_noise.items()
    )
