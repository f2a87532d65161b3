"""A smoothing problem with the noise and the times that its flight asks for."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, chdtri

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.frontend.calibration_request import (
    CalibrationRequest,
    calibration_requests,
    of_time,
    of_vehicle,
)
from fgnav.frontend.prepared import PreparedFlight
from fgnav.frontend.settings import ProblemSettings
from fgnav.graph.delayed import CLOCK_OFFSET, CLOCK_RATE
from fgnav.graph.turned import UNIT_TURN
from fgnav.graph.types.constants import FlightConstant
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.array.choice import Told, Turn, chosen_turn
from fgnav.identification.array.places import places_of, with_reference
from fgnav.identification.array.turn import others_tell, request_of, sentence, tested_turn
from fgnav.identification.identify import Identified, identify
from fgnav.identification.likelihood.beside_phases import white_noise_factors
from fgnav.identification.likelihood.satellite_errors import (
    satellite_error_factors,
    with_errors,
)
from fgnav.identification.notes import constant_notes, noise_notes, satellite_error_notes
from fgnav.identification.stated import with_factors
from fgnav.identification.tested_constants import SIGMAS
from fgnav.identification.track.candidates import clock_candidates, over_common_span
from fgnav.identification.track.forces import force_consistency
from fgnav.identification.track.tags import (
    is_far,
    middle_of_tags_s,
    with_exact_tags,
    with_tags_moved,
)
from fgnav.identification.track.windows import EXCLUDED
from fgnav.types.estimate import Consistency, Contradiction
from fgnav.types.flight import Flight

_FEWEST = 30  # keyframes that measured something: fewer tell no noise
_CLOCK_STEPS = 5  # at most: each leaves half or less of what is left
Build = Callable[[Flight, ProblemSettings], PreparedFlight]


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
    errors: Mapping[str, float] = MappingProxyType({})  # of satellites, as factors
    is_as_it_was: bool = False  # all but those errors


def with_identified_noise(
    flight: Flight, settings: ProblemSettings, prepared: PreparedFlight, build: Build
) -> PreparedFlight:
    """Return the problem with noise that is not stated, or contradicted, as identified.

    Clock and delay become constants of the flight where they are not zero or were asked for; a
    clock that is far off is corrected in the unit's tags first.

    Parameters
    ----------
    flight : Flight
    settings : ProblemSettings
        Not causal.
    prepared : PreparedFlight
        With the noise as the flight has it.
    build : callable
        From a flight to its problem.
    """
    try:
        found = findings(flight, settings, prepared, build)
    except NoSolutionError as error:
        note = f"Noise is as stated or, where it is not, usual: it could not be tested ({error})."
        tests = () if prepared.opening is None else force_consistency(flight)
        return replace(prepared, notes=(*prepared.notes, note), tests=tests)
    if found is None:
        return prepared
    if found.is_as_it_was:
        return _said(prepared, found)
    return replace(with_findings(flight, settings, found, build), tests=found.tests)


def with_findings(
    flight: Flight, settings: ProblemSettings, found: Findings, build: Build
) -> PreparedFlight:
    """Return the problem of a flight with noise and times as found."""
    better = with_factors(with_tags_moved(flight, found.moved, found.middle_s), found.factors)
    better = with_reference(better, found.reference)
    better = better if found.turn is None else found.turn.back(better)
    changed = build(better, replace(settings, calibration=found.calibration))
    axes = None if found.turn is None else found.turn.axes
    return replace(_said(changed, found), axes=axes)


def _said(prepared: PreparedFlight, found: Findings) -> PreparedFlight:
    """Return a problem with the errors of satellites as found, and what is to be said of all."""
    changed = _erring(prepared, found.errors)
    return replace(changed, notes=(*changed.notes, *found.notes))


def _erring(prepared: PreparedFlight, errors: Mapping[str, float]) -> PreparedFlight:
    def changed(problem: SmoothingProblem) -> SmoothingProblem:
        phase = problem.phase
        return problem if phase is None else replace(problem, phase=with_errors(phase, errors))

    return prepared.changed(changed) if errors else prepared


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
    exact = with_exact_tags(flight)
    if exact is not flight:  # the clock is tested whatever its doubt
        flight, prepared = exact, build(exact, settings)
    stated = settings.calibration
    places = places_of(flight, stated, prepared)
    if places.requests:
        settings = replace(settings, calibration=(*stated, *places.requests))
        flight = with_reference(flight, places.reference)
        prepared = build(flight, settings)
    errors = _satellite_errors(flight, prepared.problem)
    prepared = _erring(prepared, errors)

    def erring(flight: Flight, settings: ProblemSettings) -> PreparedFlight:
        return _erring(build(flight, settings), errors)

    problem = prepared.problem
    if _measured(problem) < _FEWEST:
        return None
    told = _likeliest(flight, settings, prepared, build, clock_candidates(flight))
    if told is None:  # the motion's noise stands for accelerations of unknown direction, too
        raise NoSolutionError("nothing tells the heading")

    turn, (found, moved) = _turn(flight, settings, problem, told, build)
    if turn is not None:
        request = request_of(turn.found, turn.axes)
        settings = replace(settings, calibration=(*settings.calibration, request))
        flight = turn.back(flight)
    requests = _requests(flight, settings.calibration, found, moved)
    if problem.phase is not None:
        is_as_it_was = not (found.used.any() or moved.any()) and requests == settings.calibration
        begin = problem if is_as_it_was and turn is None else None
        found = _beside_phases(flight, settings, found, (moved, requests), erring, begin)
    tests = (*places.tests, *_tests(flight, found))
    is_as_it_was = not (found.used.any() or moved.any() or tests) and requests == stated
    if is_as_it_was and not errors:
        return None
    said = () if turn is None else (sentence(turn.found, turn.axes),)
    noise = (*noise_notes(flight, found), *satellite_error_notes(flight.gnss_noise, errors))
    return Findings(
        factors=found.factors,
        moved=moved,
        calibration=requests,
        notes=(*places.notes, *said, *noise, *constant_notes(found, moved, requests)),
        tests=tests,
        middle_s=middle_of_tags_s(flight),
        reference=places.reference,
        turn=turn,
        errors=errors,
        is_as_it_was=is_as_it_was,
    )


def _measured(problem: SmoothingProblem) -> int:
    """Return how many keyframes anything is measured at."""
    measured = np.zeros(len(problem.t_s), dtype=np.bool_)
    for one in problem.measurements:
        measured[one.row] = True
    return int(measured.sum())


def _turn(
    flight: Flight,
    settings: ProblemSettings,
    problem: SmoothingProblem,
    told: Told,
    build: Build,
) -> tuple[Turn | None, Told]:
    """Return a turn of the array against the unit, and what the flight says with it taken back."""

    def again(flight: Flight, moved: FloatArray, turn: str) -> Told | None:
        try:
            return _identified(flight, settings, None, build, moved, turn)
        except NoSolutionError:
            return None

    return chosen_turn(flight, told, again, arbitrated=others_tell(problem))


def _satellite_errors(flight: Flight, problem: SmoothingProblem) -> dict[str, float]:
    """Return factors on errors of satellites; against a base they are other ones."""
    if problem.phase is None or flight.base is not None:
        return {}
    return satellite_error_factors(problem.phase)


def _tests(flight: Flight, found: Identified) -> tuple[Consistency, ...]:
    """Return how far the inertial unit is from what it states, where that is no noise any more.

    Its innovations are those of all other sensors, which such a noise explains away: NIS is by the
    stated one, the square of the factor between both.
    """
    if flight.imu is None:
        return ()
    t_s, tests = flight.imu.t_s, []
    for name, factor in found.beyond_noise.items():
        nis, freedom = factor**2, 3 * len(t_s)
        span = Contradiction(
            from_s=float(t_s[0]), until_s=float(t_s[-1]), freedom=freedom, nis=nis, throughout=True
        )
        beyond = float(chdtrc(3, chdtri(3, 0.01) / nis))
        tests.append(
            Consistency(
                what=name,
                count=len(t_s),
                freedom=freedom,
                nis=nis,
                beyond_99=beyond,
                contradictions=(span,),
            )
        )
    return tuple(tests)


def _beside_phases(
    flight: Flight,
    settings: ProblemSettings,
    found: Identified,
    of_time: tuple[FloatArray, tuple[CalibrationRequest, ...]],
    build: Build,
    begin: SmoothingProblem | None,
) -> Identified:
    """Return what is found, with the unit as loud as the phases of arcs show it."""
    moved, requests = of_time
    settings = replace(settings, calibration=requests)

    def changed(factors: dict[str, float]) -> SmoothingProblem:
        noise = found.scaled(factors).factors
        better = with_factors(with_tags_moved(flight, moved, middle_of_tags_s(flight)), noise)
        return build(better, settings).problem

    return found.scaled(white_noise_factors(changed({}) if begin is None else begin, changed))


def _likeliest(
    flight: Flight,
    settings: ProblemSettings,
    prepared: PreparedFlight,
    build: Build,
    late_s: tuple[float, ...],
) -> Told | None:
    """Return what the flight says with the unit's times raised as fits best, and by what.

    Of several clocks the likeliest over the same measurements, but the stated one, the first, as
    long as no other excludes it.
    """
    if len(late_s) > 1:
        common = over_common_span(flight, late_s)
        told = {one: _if_it_tells(common, settings, build, one) for one in late_s}
        likely = {one: at.likelihood for one, at in told.items() if at is not None}
        if not likely:
            return None
        stated = likely.get(late_s[0], -np.inf)
        best = max(likely, key=lambda one: likely[one])
        late_s = (best if likely[best] > stated + EXCLUDED else late_s[0],)
    start = None if late_s[0] else prepared
    return _identified(flight, settings, start, build, np.array([late_s[0], 0.0]))


def _if_it_tells(
    flight: Flight, settings: ProblemSettings, build: Build, late_s: float
) -> Identified | None:
    """Return what a flight says at a clock; None without a solution or a heading."""
    try:
        told = _identified(flight, settings, None, build, np.array([late_s, 0.0]))
    except NoSolutionError:
        return None
    return None if told is None else told[0]


def _identified(
    flight: Flight,
    settings: ProblemSettings,
    prepared: PreparedFlight | None,
    build: Build,
    moved: FloatArray,
    turn: str = UNIT_TURN,
) -> Told | None:
    """Return what a flight says with the unit's tags moved, and by what they are in the end.

    None with a heading that nothing tells.
    """
    middle_s = middle_of_tags_s(flight)
    moved_flight = with_tags_moved(flight, moved, middle_s)
    prepared = build(moved_flight, settings) if prepared is None else prepared
    if prepared.opening is not None and prepared.opening.until_s == np.inf:
        return None
    extra = (*_extra(flight, settings), *tested_turn(prepared.problem, turn))
    found = identify(moved_flight, prepared.problem, prepared.timed, extra)
    if not is_far(flight, found.times):
        return found, moved
    try:
        off, at_off = _tags_off(flight, settings, build, (found, moved), extra)
    except NoSolutionError:
        return found.on_time(), moved
    either = found.times.are_one_or_the_other  # late velocities are as likely with these tags
    if not either and not _is_late(flight, settings, build, (moved, off), extra):
        return found.on_time(), moved
    if flight.observations is None:
        return at_off, off
    return at_off.on_time(), off + at_off.times.value[:2]  # nothing is left to estimate


def _tags_off(
    flight: Flight,
    settings: ProblemSettings,
    build: Build,
    told: Told,
    extra: tuple[FlightConstant, ...],
) -> tuple[FloatArray, Identified]:
    """Return by what tags are moved, by steps until one is within its sigma, and what is so told.

    A step takes variances of the rate at the times of the tags before, and falls short.
    """
    found, off = told
    factors = found.factors
    for _ in range(_CLOCK_STEPS):
        off = off + found.times.value[:2]
        moved_flight = with_tags_moved(flight, off, middle_of_tags_s(flight))
        again = build(moved_flight, settings)
        found = identify(moved_flight, again.problem, again.timed, extra, factors)
        if (np.abs(found.times.value[:2]) <= found.times.sigma[:2]).all():
            break
    return off, found


def _is_late(
    flight: Flight,
    settings: ProblemSettings,
    build: Build,
    moved: tuple[FloatArray, FloatArray],
    extra: tuple[FlightConstant, ...],
) -> bool:
    """Return whether a flight is likelier with the second tags than with the first.

    The step that led to them takes all else of a chain as it is, the rates' variances as well,
    which are of the times of the first tags: a body that turns alike all along seems to tell them.
    """
    common = over_common_span(flight, tuple(float(by[0]) for by in moved))
    others = tuple(one for one in extra if one.name not in (CLOCK_OFFSET, CLOCK_RATE))

    def likelihood(by: FloatArray) -> float:
        at = with_tags_moved(common, by, middle_of_tags_s(flight))
        try:
            prepared = build(at, settings)
            return identify(at, prepared.problem, prepared.timed, others).likelihood
        except NoSolutionError:
            return -np.inf

    first, second = (likelihood(by) for by in moved)
    return second > first + SIGMAS**2 / 2


def _extra(flight: Flight, settings: ProblemSettings) -> tuple[FlightConstant, ...]:
    """Return constants that are tested though nobody asked for them."""
    asked = [one.kind for one in settings.calibration]
    words = [] if flight.fixes is None or flight.fixes.v_n_mps is None else ["velocity-delay"]
    if flight.observations is not None:
        words = []
    times = calibration_requests([w for w in ("clock", *words) if w not in asked])
    arm = calibration_requests([w for w in ("lever-arm",) if w not in asked])
    return (
        *(constant for word in times for constant in of_time(word)),
        *(of_vehicle(word) for word in arm),
    )


def _requests(
    flight: Flight, asked: tuple[CalibrationRequest, ...], found: Identified, moved: np.ndarray
) -> tuple[CalibrationRequest, ...]:
    """Return what is asked for, with what was found not to be zero."""
    kinds = {one.kind: one for one in asked}
    times = found.times
    significant = times.significant
    wanted = {
        "lever-arm": found.arm is not None and found.arm.significant,
        "clock": flight.observations is None and bool(moved.any() or significant[:2].any()),
        "velocity-delay": bool(significant[2]),
    }
    for kind, needed in wanted.items():
        if needed and kind not in kinds:
            kinds[kind] = calibration_requests([kind])[0]
    if "clock" in kinds and moved.any():
        kinds["clock"] = replace(kinds["clock"], moved=(float(moved[0]), float(moved[1])))
    if "velocity-delay" in kinds and significant[2]:
        kinds["velocity-delay"] = replace(kinds["velocity-delay"], start=float(times.value[2]))
    others = [one for one in asked if one.kind not in wanted]
    return (*others, *(kinds[kind] for kind in wanted if kind in kinds))
