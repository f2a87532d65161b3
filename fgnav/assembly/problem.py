"""From a flight to a smoothing problem: keyframes, measurements, motion, and where to start."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fgnav.alignment.array.multipath import lasting_error
from fgnav.alignment.array.shape import initial_shape, shape_at
from fgnav.alignment.gaps import gap_notes, spans
from fgnav.alignment.initial import attitude_prior
from fgnav.alignment.rates import timed_motion
from fgnav.assembly.calibration_request import (
    constants_of,
    late_s,
    mean_rate,
    of_tags,
    with_evidence,
    with_landmark,
)
from fgnav.assembly.heading_open import open_heading, until_motion
from fgnav.assembly.motion import is_predicted, motion_of
from fgnav.assembly.position.by_observations import LastObservations
from fgnav.assembly.position.numbered_arcs import EarlierArcs
from fgnav.assembly.position.phases import antenna_phase
from fgnav.assembly.prepared import Earlier, PreparedFlight
from fgnav.assembly.sensors.baselines import baselines
from fgnav.assembly.sensors.gnss import array_sensors, positions, velocities
from fgnav.assembly.sensors.instruments import Instruments, instruments
from fgnav.assembly.sensors.rest import Rest, moving_antenna, resting_motion
from fgnav.assembly.sensors.standstill import standing
from fgnav.assembly.settings import ProblemSettings
from fgnav.assembly.stages import Aligned, Tracked, aligned, inertial_record, moves_about, tracked
from fgnav.checks import BoolArray, Loss
from fgnav.graph.delayed import VELOCITY_DELAY, TimedMotion, on_clock
from fgnav.graph.factors.antenna_phase import AntennaPhase
from fgnav.graph.factors.baseline import BaselineVector
from fgnav.graph.factors.line_of_sight import LANDMARK, LineOfSight
from fgnav.graph.inertial.multipath import Multipath
from fgnav.graph.types.constants import Constants, FlightConstant
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.sensor import Sensor
from fgnav.graph.types.states import States
from fgnav.integrity.instrument_screen import without_stuck
from fgnav.process.prediction import Turning
from fgnav.types.flight import Flight, Photodetector


def build_problem(
    flight: Flight,
    settings: ProblemSettings,
    earlier: Earlier | None = None,
    last: LastObservations | None = None,
) -> PreparedFlight:
    """Return the smoothing problem of a flight: its GNSS epochs within the inertial record.

    Of a flight that goes on (``earlier``) keyframes of its last half minute provide what
    later ones need of them. Problems of the same observations share them by ``last``.

    Raises
    ------
    NoSolutionError
        Naming the part of the flight that is missing.
    """
    requested = constants_of(settings.calibration, flight, gravity=settings.gravity is not None)
    inertial_record(flight.imu)
    repeated: tuple[Loss, ...] = ()
    if not settings.causal:
        flight, repeated = without_stuck(flight)
    last = last or LastObservations()
    by = last.of(flight, settings)
    if by is not None and not settings.causal:
        flight, requested = initial_shape(flight, requested, lambda: by.fixed)
    before = None if earlier is None else earlier.motion
    stage = aligned(flight, settings, requested, last.of(flight, settings), before)
    track = tracked(flight, stage)
    imu, causal = stage.record.imu, settings.causal
    v_n_mps = moves_about(stage, track, stage.start.R_nb)[1]
    stands = standing(stage.record, track.t_s, track.antenna, causal=causal)
    rest = Rest.of(stands, track.t_s, causal=causal)
    found = instruments(flight, stage, track, v_n_mps, stands)
    antenna = moving_antenna(track.antenna, track.t_s, rest, settings.at_rest)
    track = track._replace(antenna=antenna)
    tags = of_tags(settings.calibration, flight)
    constants = _constants((*requested, *tags), stage, found, flight.photodetector)
    multipath, lasting_notes = _lasting(stage, requested)
    earth = flight.origin.earth_rate_n_radps
    motion, turning, rate_notes = motion_of((stage, track), settings, earth, constants, multipath)
    motion = resting_motion(motion, imu, rest, settings.at_rest)
    back_s = late_s(settings.calibration)
    timed = timed_motion(imu, track.t_s, track.gravity_n_mps2, earth, causal=causal, span_s=back_s)
    phases = antenna_phase(
        track.antenna.phases,
        track.t_s,
        stage.start.R_nb,
        constants,
        causal=causal,
        earlier=None if earlier is None else earlier.arcs,
    )
    phase = phases.phase
    between, baseline_losses = baselines(flight, track.t_s)
    antennas = (*_antennas(flight, stage, track, requested, (multipath, timed)), *between)
    sensors = _bound((antennas, found.sensors), constants, timed)
    problem = Problem(
        t_s=track.t_s,
        start=_start(stage, track, constants, turning, motion.aux),
        motion=motion,
        sensors=sensors,
        constants=constants,
        attitude_known=_measured_attitudes(stage),
        attitude_prior=attitude_prior(flight.initial, stage.start.R_nb[0]),
        phase=phase,
        rate_known=turning is not None,
    )
    opened = replace(problem, phase=_phase_before_heading(phase, stage, track, constants))
    opening = open_heading(opened, stage, track, flight.initial)
    if opening is not None:
        opening = replace(opening, aligned=problem)
    problem = until_motion(problem, stage, track, flight.initial)
    start, antenna = stage.start, track.antenna
    gaps = _gaps(stage, track, sensors)
    return PreparedFlight(
        problem=problem,
        imu=imu,
        earth_rate_n_radps=earth,
        epochs=stage.epochs,
        integers=start.integers,
        losses=(
            *start.losses,
            *stage.losses,
            *antenna.losses,
            *track.losses,
            *repeated,
            *baseline_losses,
            *found.losses,
        ),
        rejections=(*start.rejections, *track.rejections, *phases.rejections),
        notes=(
            *start.notes,
            *lasting_notes,
            *rate_notes,
            *phases.notes,
            *gaps,
            *stage.float_arcs.notes,
        ),
        timed=timed,
        rough=start.rough,
        causal=causal,
        opening=opening,
        rest=rest,
        goes_on=_goes_on(flight, stage, phases.goes_on),
        arcs=phases.arcs,
    )


def _lasting(
    stage: Aligned, requested: tuple[FlightConstant, ...]
) -> tuple[Multipath | None, tuple[str, ...]]:
    """Return what stays of the array's errors; where its shape is asked for it is that."""
    shape_requested = any(one.name.startswith("antenna ") for one in requested)
    return (None, ()) if stage.causal or shape_requested else lasting_error(stage.start)


def _phase_before_heading(
    phase: AntennaPhase | None, stage: Aligned, track: Tracked, constants: Constants
) -> AntennaPhase | None:
    """Return phases before the heading is known: turns wind them up about an open one, too."""
    phases, t_s = track.antenna.phases, track.t_s
    if stage.R_open is None or all(one.of.pole_n is None for one in phases):
        return phase
    before = [t_s[one.row] < stage.heading_known_s for one in phases]
    part = tuple(
        one._replace(row=one.row[rows], epoch=one.epoch[rows])
        for one, rows in zip(phases, before, strict=True)
    )
    return antenna_phase(part, t_s, stage.R_open, constants, causal=True).phase


def _goes_on(flight: Flight, stage: Aligned, arcs: EarlierArcs | None) -> Earlier | None:
    """Return what later keyframes need of these; None while, or where, it is not all summed up."""
    start, others = stage.start, (flight.base, flight.vehicle, flight.photodetector, stage.down)
    if flight.standstill or any(one is not None for one in others):
        return None
    if start.motion is None or not start.motion.step_s or not start.valid.any():
        return None
    return None if flight.observations is not None and arcs is None else Earlier(start.motion, arcs)


def _measured_attitudes(stage: Aligned) -> BoolArray:
    """Return keyframes, (n,), that a window starts by their attitude, not where the motion leads.

    Beside a gyroscope and no array that is the first, and the first after each gap of its record.
    """
    start = stage.start
    if not stage.gyroscope or start.form is not None:
        return start.valid
    after_gap = np.append(True, stage.record.overlaps(start.t_s)[:-1])
    return np.asarray(after_gap & (start.valid | (np.arange(len(after_gap)) == 0)))


def _constants(
    requested: tuple[FlightConstant, ...],
    stage: Aligned,
    found: Instruments,
    photodetector: Photodetector | None,
) -> Constants:
    """Return what is estimated with the flight: asked for, of instruments, of phases, the rate."""
    is_seen = any(LANDMARK in sensor.parameters for sensor in found.sensors)
    parts = with_evidence(requested, sight=is_seen)
    if is_seen and photodetector is not None:
        parts = with_landmark(parts, photodetector.landmark_n_m)
    parts = (*parts, *found.constants)
    if not stage.gyroscope:
        parts = (*parts, mean_rate())
    return Constants((*parts, *stage.float_arcs.constants))


def _antennas(
    flight: Flight,
    stage: Aligned,
    track: Tracked,
    requested: tuple[FlightConstant, ...],
    of: tuple[Multipath | None, TimedMotion],
) -> Iterator[Sensor]:
    """Yield the sensors of antennas."""
    start, antenna, (multipath, timed) = stage.start, track.antenna, of
    rates, earth = stage.rates if stage.gyroscope else None, flight.origin.earth_rate_n_radps
    names = tuple(one.name for one in flight.antennas)
    if start.form is not None:
        shape = shape_at(start.phases, start.form, track.t_s, start.valid, requested, names)
        errors, stretch = (multipath, not stage.gyroscope), stage.float_arcs.stretch
        yield from array_sensors(start.form, shape, names, start.valid, stretch, errors)
    if not antenna.phases:
        yield from positions(series for _, series in antenna.positions)
    is_late = any(one.name == VELOCITY_DELAY for one in requested)
    of_antennas = (series for _, series in antenna.velocities)
    yield from velocities(of_antennas, rates, earth, timed.led if is_late else None)


def _bound(
    of: tuple[tuple[Sensor, ...], tuple[Sensor, ...]], constants: Constants, timed: TimedMotion
) -> tuple[Sensor, ...]:
    """Return sensors of antennas, on their receivers' clock, and others, of a problem."""
    antennas, others = ([one.bound(constants) for one in part if len(one.row)] for part in of)
    late = {"velocity": VELOCITY_DELAY}
    on_time = (on_clock(one, timed, delay=late.get(one.name, "")) for one in antennas)
    return (*on_time, *others)


def _start(
    stage: Aligned, track: Tracked, constants: Constants, turning: Turning | None, width: int
) -> States:
    """Return where the search starts."""
    R_nb = stage.start.R_nb
    p_n_m, v_n_mps = moves_about(stage, track, R_nb)
    aux = np.zeros((len(track.t_s), width))
    bias_b_radps = stage.start.gyroscope_bias_b_radps
    if turning is not None:
        predicted = is_predicted(turning)
        aux[:, 3:6] = np.where(predicted[:, None], turning.rate_b_radps, stage.rates)
        R_nb = np.where(predicted[:, None, None], turning.R_nb, R_nb)
    elif bias_b_radps is not None:
        aux[:, 3:6] = bias_b_radps
    return States(R_nb=R_nb, p_n_m=p_n_m, v_n_mps=v_n_mps, aux=aux, constants=constants.start)


def _gaps(stage: Aligned, track: Tracked, sensors: tuple[Sensor, ...]) -> tuple[str, ...]:
    """Return sentences on where measurements are missing for long."""
    t_s, antenna = stage.start.t_s, track.antenna
    notes = [*gap_notes("inertial samples", stage.record.gaps_s)]
    notes += gap_notes("attitude of single epochs", spans(t_s, ~stage.start.valid))
    for what, measured in (
        ("position", antenna.positions),
        ("velocity", antenna.velocities),
    ):
        if measured:
            missing = ~np.any([series.valid for _, series in measured], axis=0)
            notes += gap_notes(what, spans(t_s, missing))
    for kind in (BaselineVector, LineOfSight):
        rows = [sensor.row for sensor in sensors if sensor.name == kind.name]
        if rows:
            missing = ~np.isin(np.arange(len(t_s)), np.concatenate(rows))
            notes += gap_notes(kind.name, spans(t_s, missing))
    return tuple(notes)
