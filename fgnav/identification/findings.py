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
from fgnav.identification.array.turn import others_tell, request_of, sentence
from fgnav.identification.exclusion import Exclusion
from fgnav.identification.lasting.arm import LEVER_ARM
from fgnav.identification.lasting.choice import Cause, Lasting
from fgnav.identification.late_velocities import with_late_velocities
from fgnav.identification.likelihood.bent_clock import determinant_of, informed_requests
from fgnav.identification.likelihood.beside_phases import white_noise
from fgnav.identification.noise.identified import Identified
from fgnav.identification.noise.stated import with_factors, with_rest
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
from fgnav.identification.subject import Subject, subject_of
from fgnav.identification.time_tags import (
    AtTags,
    Build,
    TagSearch,
    with_rates_of,
)
from fgnav.identification.track.tags import middle_of_tags_s, with_tags_moved
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
    subject = subject_of(flight, settings, prepared, build)
    search, places, cause = subject.search, subject.places, subject.cause
    problem = subject.prepared.problem
    if _measured(problem) < FEWEST:
        return None
    at_tags = search.likeliest(subject.prepared, subject.scores.clock_nats)
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
    requests = _informed_by_problem(search, at_tags, _requests(search, at_tags))
    tests = (*places.tests, *_tests(subject.search.flight.imu, identified))
    is_same = _is_as_stated(at_tags, requests, settings.calibration)
    is_mended = bool(out or gross or any(one.is_likely for one in faults))
    is_mended |= cause is not None and cause.is_likely
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
            *(() if cause is None else _of_cause(cause)),
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


def _of_cause(cause: Cause) -> tuple[str, ...]:
    """Return what is to be said of what is off all along, and of what else it may be."""
    if cause.rivals is None or not cause.is_likely:
        return cause.sentences
    return (*cause.sentences, cause.rivals.sentence)


def _rejections(out: tuple[Exclusion, ...], gross: tuple[GrossError, ...]) -> tuple[Rejected, ...]:
    """Return what is left out of instruments and of fixes, in order of time each."""
    of_instruments = (rejected for one in out for rejected in one.rejected)
    return (*of_instruments, *(one.rejected for one in gross))


def _notes(
    subject: Subject, at_tags: AtTags, requests: tuple[CalibrationRequest, ...]
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
    is_turned = in_axes[1] is not None or in_axes[0] is not search
    rest = without_faulty_instrument(search, at_tags, in_axes[2], _requests, is_turned=is_turned)
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


def _informed_by_problem(
    search: TagSearch, at_tags: AtTags, requests: tuple[CalibrationRequest, ...]
) -> tuple[CalibrationRequest, ...]:
    """Return requests with what the determinant of the whole problem says of a clock's.

    A thinned chain's differs: it has fewer measurements for the states to bend to.
    """
    identified = at_tags.identified
    determinant = identified.times.determinant
    is_requested = any(one.kind == "clock" for one in requests)
    if not is_requested or determinant is None:
        return requests
    begun = informed_requests(requests, determinant)
    flight = with_tags_moved(search.flight, at_tags.moved, middle_of_tags_s(search.flight.imu))
    settings = replace(with_rest(search.settings, identified.factors), calibration=begun)
    prepared = search.build(with_factors(flight, identified.factors), settings)
    return informed_requests(begun, determinant_of(prepared) or determinant)


def _has_stated(subject: Subject, search: TagSearch, at_tags: AtTags) -> bool:
    """Return whether tags and what is to be estimated are as they were."""
    return _requests(search, at_tags) == subject.search.settings.calibration and not (
        at_tags.moved.any()
    )


def _beside_phases(search: TagSearch, at_tags: AtTags, subject: Subject, is_mended: bool) -> AtTags:
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
    is_stated = is_same and not is_mended
    begin = problem if is_stated else changed({})
    alike = partial(changed, settings=with_rates_of(settings, begin))
    scored = subject.scores.noise if is_stated else None
    noise = white_noise(begin, alike, scored)
    return AtTags(identified.scaled(noise.factors, noise.sigmas), moved)


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
