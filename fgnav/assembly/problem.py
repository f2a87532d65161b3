"""From a flight to a smoothing problem: keyframes, measurements, motion, and where to start."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from fgnav.alignment.array.multipath import correlated_error
from fgnav.alignment.array.shape import array_shape, initial_shape, is_shape_estimated
from fgnav.alignment.gaps import gap_notes, spans
from fgnav.alignment.initial import attitude_prior
from fgnav.alignment.rates import timed_motion
from fgnav.assembly.calibration_request import (
    constants_of,
    mean_rate,
    propagation_span_s,
    timestamp_offset,
    with_landmark,
)
from fgnav.assembly.heading_open import open_heading, until_motion
from fgnav.assembly.motion import is_predicted, motion_of
from fgnav.assembly.position.by_observations import LastObservations
from fgnav.assembly.position.numbered_arcs import EarlierArcs
from fgnav.assembly.position.phases import antenna_phase
from fgnav.assembly.prepared import Earlier, PreparedFlight
from fgnav.assembly.sensors.gnss import array_sensors, positions, velocities
from fgnav.assembly.sensors.instruments import Instruments, instruments
from fgnav.assembly.sensors.rest import moving_antenna, resting_motion
from fgnav.assembly.sensors.standstill import standing
from fgnav.assembly.settings import ProblemSettings
from fgnav.assembly.stages import (
    Aligned,
    Tracked,
    aligned,
    approximate_motion,
    tracked,
)
from fgnav.checks import BoolArray, Unused
from fgnav.graph.delayed import VELOCITY_DELAY, TimedMotion, on_clock
from fgnav.graph.factors.baseline import BaselineVector
from fgnav.graph.factors.line_of_sight import LineOfSight
from fgnav.graph.factors.velocity import Velocity
from fgnav.graph.inertial.multipath import Multipath
from fgnav.graph.types.parameters import Parameter, Parameters
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.sensor import Sensor
from fgnav.graph.types.states import States
from fgnav.integrity.instrument_screen import screen_instruments
from fgnav.process.prediction import Turning
from fgnav.types.flight import Flight


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
    repeated: tuple[Unused, ...] = ()
    if not settings.causal:
        flight, repeated = screen_instruments(flight)
    last = last or LastObservations()
    by = last.of(flight, settings)
    if by is not None and not settings.causal:
        flight, requested = initial_shape(flight, requested, lambda: by.fixed)
    motion_before = None if earlier is None else earlier.motion
    stage = aligned(flight, settings, requested, last.of(flight, settings), motion_before)
    track = tracked(flight, stage)
    stands = standing(stage.record, track.t_s, track.antenna, causal=stage.causal)
    others = instruments(flight, stage, track, stands)
    antenna = moving_antenna(track.antenna, track.t_s, stands, settings.at_rest)
    track = track._replace(antenna=antenna)
    requested = (*requested, *timestamp_offset(settings.calibration, flight))
    constants = _constants(flight, requested, stage, others)
    # Where antennas are off their places that looks like multipath.
    is_looked_for = not (stage.causal or is_shape_estimated(requested))
    multipath, multipath_notes = correlated_error(stage.start) if is_looked_for else (None, ())
    motion, prediction, rate_notes = motion_of((stage, track), settings, constants, multipath)
    motion = resting_motion(motion, stage.record.imu, stands, settings.at_rest)
    causal, span_s = stage.causal, propagation_span_s(settings.calibration)
    earth = stage.earth_rate_n_radps
    kinematics = stage.record.imu, track.t_s, track.gravity_n_mps2, earth
    timed = timed_motion(*kinematics, causal=causal, span_s=span_s)
    before = None if earlier is None else earlier.arcs
    observed, R_nb = track.antenna.phases, stage.start.R_nb
    phases = antenna_phase(observed, track.t_s, R_nb, constants, causal=causal, earlier=before)
    antennas = _antennas(flight, stage, track, requested, (multipath, timed))
    sensors = _bound((*antennas, *others.sensors), constants, timed)
    problem = Problem(
        t_s=track.t_s,
        start=_start(stage, track, constants, prediction, motion.aux),
        motion=motion,
        sensors=sensors,
        constants=constants,
        attitude_known=_measured_attitudes(stage),
        attitude_prior=attitude_prior(flight.initial, R_nb[0]),
        phase=phases.phase,
        rate_known=prediction is not None,
    )
    reports = (stage.start, stage, track.antenna, track, others, phases, stage.float_arcs)
    notes = (*multipath_notes, *rate_notes, *_gaps(stage, track, sensors))
    return PreparedFlight(
        problem=until_motion(problem, stage, track, flight.initial),
        opening=open_heading(problem, stage, track, flight.initial),
        imu=stage.record.imu,
        epochs=stage.epochs,
        integers=stage.start.integers,
        unused=(*_all(reports, "unused"), *repeated),
        rejections=_all(reports, "rejections"),
        notes=(*_all(reports, "notes"), *notes),
        observed=observed,
        timed=timed,
        rough=stage.start.rough,
        causal=causal,
        standing=stands,
        goes_on=_goes_on(flight, stage, phases.goes_on),
        arcs=phases.arcs,
    )


def _all(parts: tuple[object, ...], name: str) -> tuple[Any, ...]:
    """Concatenate the reports of the problem's parts."""
    return tuple(item for stage in parts for item in getattr(stage, name, ()))


def _goes_on(flight: Flight, stage: Aligned, arcs: EarlierArcs | None) -> Earlier | None:
    """Return the summary that later keyframes need; None while it is incomplete."""
    start, others = stage.start, (flight.base, flight.vehicle, flight.photodetector, stage.down)
    if flight.standstill or any(other is not None for other in others):
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
    flight: Flight, requested: tuple[Parameter, ...], stage: Aligned, others: Instruments
) -> Parameters:
    """List the constants: calibration, instruments, phases and the mean rate."""
    photodetector = flight.photodetector if others.is_landmark_seen else None
    landmark_n_m = None if photodetector is None else photodetector.landmark_n_m
    parts = (*with_landmark(requested, landmark_n_m), *others.constants)
    parts = parts if stage.gyroscope else (*parts, mean_rate())
    return Parameters((*parts, *stage.float_arcs.constants))


def _antennas(
    flight: Flight,
    stage: Aligned,
    track: Tracked,
    requested: tuple[Parameter, ...],
    of: tuple[Multipath | None, TimedMotion],
) -> Iterator[Sensor]:
    """Yield the sensors of antennas."""
    start, antenna, (multipath, timed) = stage.start, track.antenna, of
    rates, earth = stage.rates if stage.gyroscope else None, stage.earth_rate_n_radps
    names = tuple(antenna.name for antenna in flight.antennas)
    if start.form is not None:
        shape = array_shape(start, requested, names)
        errors, stretch = (multipath, not stage.gyroscope), stage.float_arcs.stretch
        yield from array_sensors(start.form, shape, start.valid, stretch, errors)
    if not antenna.phases:
        yield from positions(antenna.positions)
    is_late = any(request.name == VELOCITY_DELAY for request in requested)
    yield from velocities(antenna.velocities, rates, earth, timed.led if is_late else None)


def _bound(
    sensors: tuple[Sensor, ...], constants: Parameters, timed: TimedMotion
) -> tuple[Sensor, ...]:
    """Return sensors of a problem, those of receivers on their clock."""
    delays = {Velocity.name: VELOCITY_DELAY}
    of_problem = (sensor.bound(constants) for sensor in sensors if len(sensor.row))
    return tuple(
        on_clock(sensor, timed, delay=delays.get(sensor.name, ""))
        if getattr(sensor, "timed_by_receiver", False)
        else sensor
        for sensor in of_problem
    )


def _start(
    stage: Aligned, track: Tracked, constants: Parameters, prediction: Turning | None, width: int
) -> States:
    """Return where the search starts."""
    R_nb = stage.start.R_nb
    p_n_m, v_n_mps = approximate_motion(stage, track, R_nb)
    aux = np.zeros((len(track.t_s), width))
    bias_b_radps = stage.start.gyroscope_bias_b_radps
    if prediction is not None:
        predicted = is_predicted(prediction)
        aux[:, 3:6] = np.where(predicted[:, None], prediction.rate_b_radps, stage.rates)
        R_nb = np.where(predicted[:, None, None], prediction.R_nb, R_nb)
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
            missing = ~np.any([series.valid for series in measured], axis=0)
            notes += gap_notes(what, spans(t_s, missing))
    for kind in (BaselineVector, LineOfSight):
        rows = [sensor.row for sensor in sensors if sensor.name == kind.name]
        if rows:
            missing = ~np.isin(np.arange(len(t_s)), np.concatenate(rows))
            notes += gap_notes(kind.name, spans(t_s, missing))
    return tuple(notes)
