"""A smoothing problem with the noise and the times that its flight asks for."""

from dataclasses import replace
from functools import reduce

from fgnav.checks import NoSolutionError
from fgnav.frontend.prepared import PreparedFlight
from fgnav.frontend.recording import with_noise_of_record
from fgnav.frontend.settings import ProblemSettings
from fgnav.identification.array.displaced import with_antennas_in_place
from fgnav.identification.array.exchanged import exchange_of
from fgnav.identification.array.places import with_reference
from fgnav.identification.findings import Findings, findings
from fgnav.identification.noise.loud_phases import (
    loud_phases,
    loudness_notes,
    with_loud_phases,
)
from fgnav.identification.noise.sample_noise import noise_of_samples
from fgnav.identification.noise.stated import with_factors, with_rest
from fgnav.identification.spans.gross_errors import leaving_out
from fgnav.identification.spans.unit_faults import building
from fgnav.identification.subject import with_satellite_errors
from fgnav.identification.tag_steps import tag_step
from fgnav.identification.time_tags import Build, TagSearch
from fgnav.identification.track.forces import force_consistency
from fgnav.identification.track.tags import with_tags_moved
from fgnav.types.flight import Flight


def by_records(
    flight: Flight, settings: ProblemSettings
) -> tuple[Flight, ProblemSettings, tuple[str, ...]]:
    """Return a flight as its records have it before any problem is built, and what is said of it.

    With noise that inertial samples add, with phases as loud as they are, and with an antenna that
    is elsewhere where its phases put it.
    """
    notes: tuple[str, ...] = ()
    if flight.imu is not None:
        imu, notes = with_noise_of_record(flight.imu)
        flight = replace(flight, imu=imu) if notes else flight
    flight = with_loud_phases(flight, loud_phases(flight))
    flight, settings, places = with_antennas_in_place(flight, settings)
    return flight, settings, (*loudness_notes(flight.gnss_noise), *notes, *places)


def with_identified_noise(
    flight: Flight, settings: ProblemSettings, prepared: PreparedFlight, build: Build
) -> PreparedFlight:
    """Return the problem with noise that is not stated, or contradicted, as identified.

    Clock and delay become constants of the flight where they are not zero or were requested; a
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
    right, notes = _put_right(flight, settings, prepared, build)
    if notes:
        prepared = build(right, settings)
    changes, of_samples = noise_of_samples(right, prepared)

    def built(flight: Flight, settings: ProblemSettings) -> PreparedFlight:
        return reduce(PreparedFlight.changed, changes, build(flight, settings))

    prepared = reduce(PreparedFlight.changed, changes, prepared)
    better = _with_findings(right, settings, prepared, built)
    return replace(better, notes=(*better.notes, *notes, *of_samples))


def _put_right(
    flight: Flight, settings: ProblemSettings, prepared: PreparedFlight, build: Build
) -> tuple[Flight, tuple[str, ...]]:
    """Return a flight without exchanged antennas and without a step of tags, and what was."""
    notes: tuple[str, ...] = ()
    exchange = exchange_of(prepared)
    if exchange is not None:
        notes = (exchange.sentence(flight.antennas),)
        flight = exchange.undone(flight)
    step = tag_step(flight, settings, build)
    if step is not None:
        flight, notes = step.undone(flight), (*notes, step.sentence)
    return flight, notes


def _with_findings(
    flight: Flight, settings: ProblemSettings, prepared: PreparedFlight, build: Build
) -> PreparedFlight:
    """Return the problem with what the flight says of noise, times and set-up."""
    try:
        changes = findings(flight, settings, prepared, build)
    except NoSolutionError as error:
        note = f"Noise is as stated or, where it is not, usual: it could not be tested ({error})."
        return replace(prepared, notes=(*prepared.notes, note), tests=force_consistency(flight))
    if changes is None:
        return prepared
    if changes.is_as_stated:
        for one in changes.faults:
            prepared = prepared.changed(one.stepping)
        return _with_errors_and_notes(prepared, changes)
    return replace(with_findings(flight, settings, changes, build), tests=changes.tests)


def corrected(
    flight: Flight, settings: ProblemSettings, changes: Findings, build: Build
) -> TagSearch:
    """Return a flight with noise and times as identified, and how its problem is built."""
    if changes.cause is not None:
        flight = changes.cause.undone(flight)
    for one in changes.out:
        flight = one.of(flight)
    better = with_tags_moved(flight, changes.moved, changes.middle_s)
    better = with_reference(with_factors(better, changes.factors), changes.reference)
    better = better if changes.turn is None else changes.turn.back(better)
    mended = building(leaving_out(build, changes.gross), changes.faults)
    at_rest = with_rest(settings, changes.factors)
    return TagSearch(better, replace(at_rest, calibration=changes.calibration), mended)


def with_findings(
    flight: Flight, settings: ProblemSettings, changes: Findings, build: Build
) -> PreparedFlight:
    """Return the problem of a flight with noise and times as identified."""
    better = corrected(flight, settings, changes, build)
    prepared = better.build(better.flight, better.settings)
    axes = None if changes.turn is None else changes.turn.axes
    return replace(_with_errors_and_notes(prepared, changes), axes=axes)


def _with_errors_and_notes(prepared: PreparedFlight, changes: Findings) -> PreparedFlight:
    """Return a problem with what is doubted of satellites and sights, and all notes."""
    changed, cause = with_satellite_errors(prepared, changes.errors), changes.cause
    doubts = [one.doubt for one in changes.faults]
    if cause is not None:
        changed = changed.changed(cause.in_doubt)
        doubts += [cause.doubt, None if cause.rivals is None else cause.rivals.doubt]
    return replace(
        changed,
        doubts=tuple(one for one in doubts if one is not None),
        has_cause=cause is not None,
        notes=(*changed.notes, *changes.notes),
        rejections=(*changed.rejections, *changes.rejected),
    )
