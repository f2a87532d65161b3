"""A flight whose noise and times are to be identified: what is off in it all along is put right."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.frontend.calibration_request import CalibrationRequest, calibration_requests
from fgnav.frontend.prepared import PreparedFlight
from fgnav.frontend.settings import ProblemSettings
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.identification.array.places import Places, places_of, with_reference
from fgnav.identification.lasting.choice import Cause, Variants, likely_causes, promises_of
from fgnav.identification.lasting.clock import CLOCK
from fgnav.identification.lasting.lost_samples import LostSamples, prolonged
from fgnav.identification.likelihood.beside_phases import Scored, is_misfit
from fgnav.identification.likelihood.changed_samples import Promise
from fgnav.identification.likelihood.satellite_errors import satellite_error_factors, with_errors
from fgnav.identification.likelihood.thinned import thinned
from fgnav.identification.noise.stated import with_factors, with_rest
from fgnav.identification.time_tags import Build, TagSearch, common_likelihoods, with_rates_of
from fgnav.identification.track.tags import middle_of_tags_s, with_exact_tags
from fgnav.solve.chain import solve_batch
from fgnav.types.flight import Flight


class Scores(NamedTuple):
    """What a problem's minimum tells of it, so that it need not be sought again.

    Attributes
    ----------
    promises : mapping of str to Promise
        What steps of constants promise; none where that is not known.
    noise : Scored or None
        Of the unit, beside phases of arcs.
    """

    promises: Mapping[str, Promise] = MappingProxyType({})
    noise: Scored | None = None

    @property
    def clock_nats(self) -> float:
        """What a step of the unit's clock promises; infinite where that is not known."""
        return self.promises[CLOCK].nats if CLOCK in self.promises else np.inf


class Subject(NamedTuple):
    """A flight to be identified: with exact tags, places of antennas and errors of satellites.

    ``scores``: of a problem that starts at its minimum, which is as stated.
    """

    search: TagSearch
    prepared: PreparedFlight
    places: Places
    errors: dict[str, float]
    cause: Cause | None
    scores: Scores = Scores()


def subject_of(
    flight: Flight, settings: ProblemSettings, prepared: PreparedFlight, build: Build
) -> Subject:
    """Return a flight with exact tags, places of antennas, and without what is off all along.

    Parameters as of ``findings``.
    """
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
    prepared, at = _at_minimum(with_satellite_errors(prepared, errors))
    scores = Scores() if at is None else _scores(*at, flight)

    def built(flight: Flight, settings: ProblemSettings) -> PreparedFlight:
        return with_satellite_errors(build(flight, settings), errors)

    as_stated = Subject(TagSearch(flight, settings, built), prepared, places, errors, None)
    causes: tuple[Cause, ...] = ()
    if at is not None and (at[1].converged or settings.causes_anywhere):
        causes = _likely_causes(as_stated.search, prepared, at, scores.promises)
    for cause in causes:
        if not cause.is_likely:
            as_stated = as_stated._replace(cause=cause)
            break
        subject = _with_cause(as_stated, cause, built)
        if _is_likelier(subject, as_stated):
            return subject
    return as_stated if prepared.minimum is None else as_stated._replace(scores=scores)


def _with_cause(as_stated: Subject, cause: Cause, built: Build) -> Subject:
    """Return a flight without its cause."""
    flight, settings = as_stated.search.flight, as_stated.search.settings
    settings = replace(settings, calibration=(*settings.calibration, *cause.requests))
    if isinstance(cause, LostSamples):
        cause = prolonged(cause, _compared(built(cause.undone(flight), settings)))
    flight = cause.undone(flight)

    def with_cause(flight: Flight, settings: ProblemSettings) -> PreparedFlight:
        return built(flight, settings).changed(cause.in_doubt)

    search, prepared = TagSearch(flight, settings, with_cause), with_cause(flight, settings)
    return as_stated._replace(search=search, prepared=prepared, cause=cause)


def _compared(prepared: PreparedFlight) -> SmoothingProblem:
    """Return the whole problem beside phases of arcs, which no thinned one has."""
    problem = prepared.from_minimum
    return problem if problem.phase is not None else thinned(problem)


def _at_minimum(
    prepared: PreparedFlight,
) -> tuple[PreparedFlight, tuple[SmoothingProblem, Solution] | None]:
    """Return a problem with its minimum beside phases; where causes are compared, and its minimum.

    A minimum is passed on if its variants' are near. They are not where more is left than chance:
    from states bent to a wrong problem the way to the right one's is longer than from an array's
    attitudes, or has no end.
    """
    problem = _compared(prepared)
    try:
        stated = solve_batch(problem)
    except NoSolutionError:
        return prepared, None
    if problem.phase is not None and not is_misfit(problem, stated.cost):
        prepared = replace(prepared, minimum=stated.states)
        problem = prepared.from_minimum
    return prepared, (problem, stated)


def _scores(problem: SmoothingProblem, stated: Solution, flight: Flight) -> Scores:
    """Return what a minimum tells."""
    promises = promises_of(problem, stated, middle_of_tags_s(flight.imu))
    return Scores(promises, None if problem.phase is None else Scored.of(problem, stated))


def _is_likelier(subject: Subject, as_stated: Subject) -> bool:
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


def _likely_causes(
    search: TagSearch,
    prepared: PreparedFlight,
    at: tuple[SmoothingProblem, Solution],
    promises: Mapping[str, Promise],
) -> tuple[Cause, ...]:
    """Return a landmark, axes of a detector or of the unit, or tags, that are not as stated."""
    flight, settings = search.flight, search.settings

    def variant(flight: Flight, settings: ProblemSettings) -> SmoothingProblem:
        return _compared(search.build(flight, settings))

    def with_noise(factors: dict[str, float]) -> SmoothingProblem:
        return variant(with_factors(flight, factors), settings)

    def in_motion(factors: dict[str, float]) -> SmoothingProblem:
        return variant(with_factors(flight, factors), with_rest(settings, factors))

    def estimating(request: CalibrationRequest, factors: dict[str, float]) -> SmoothingProblem:
        alike = with_rates_of(with_rest(settings, factors), prepared.problem)
        alike = replace(alike, calibration=(*settings.calibration, request))
        return variant(with_factors(flight, factors), alike)

    has_velocities = flight.fixes is not None and flight.fixes.v_n_mps is not None
    words = ("lever-arm", "velocity-delay") if has_velocities else ("lever-arm",)
    requested = [one.kind for one in settings.calibration]
    others = calibration_requests([word for word in words if word not in requested])
    rest = None if flight.observations is not None else prepared.rest
    rests = rest is not None and bool(rest.share(at[0].t_s).any())
    variants = Variants(with_noise, in_motion if rests else None, estimating, others)
    return likely_causes(at, middle_of_tags_s(flight.imu), promises, variants, flight)


def with_satellite_errors(prepared: PreparedFlight, factors: Mapping[str, float]) -> PreparedFlight:
    """Return the problem with factors on errors of satellites."""

    def changed(problem: SmoothingProblem) -> SmoothingProblem:
        phase = problem.phase
        return problem if phase is None else replace(problem, phase=with_errors(phase, factors))

    return prepared.changed(changed) if factors else prepared
