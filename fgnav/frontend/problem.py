"""From a flight to a smoothing problem: keyframes, measurements, motion, and where to start."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray, Loss
from fgnav.estimate import Rejected
from fgnav.flight import Flight, Imu
from fgnav.frontend.array.shape import initial_shape, shape_at
from fgnav.frontend.attitude.rates import swing_n_mps
from fgnav.frontend.calibration_request import (
    constants_of,
    mean_rate,
    with_common_error,
    with_evidence,
    with_landmark,
)
from fgnav.frontend.causal.stages import causal_aligned, causal_tracked
from fgnav.frontend.gaps import gap_notes, spans
from fgnav.frontend.measurements import Recorded, measurements_of
from fgnav.frontend.motion import motion_of
from fgnav.frontend.sensors.sensed import Sensed, sense
from fgnav.frontend.settings import ProblemSettings
from fgnav.frontend.stages import Aligned, Tracked, aligned, inertial_record, interpolated, tracked
from fgnav.graph.types.constants import Constants, FlightConstant
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.integers.resolver import Integers


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class PreparedFlight:
    """A smoothing problem, and what is to be said of it.

    Attributes
    ----------
    problem : SmoothingProblem
    imu : Imu
    earth_rate_n_radps : ndarray, shape (3,)
    epochs : int
        GNSS epochs of the flight, and times between them that are far apart.
    common_position_m2 : ndarray, shape (n, 3, 3)
        Variance of positions at keyframes that no smoothing reduces.
    common_velocity_m2ps2 : ndarray, shape (n, 3, 3)
        Of the velocity at which such errors move.
    integers : Integers or None
    losses : tuple of Loss
    rejections : tuple of Rejected
    notes : tuple of str
    rough : bool
        Whether the attitudes that the search starts from assume something.
    """

    problem: SmoothingProblem
    imu: Imu
    earth_rate_n_radps: FloatArray
    epochs: int
    common_position_m2: FloatArray
    common_velocity_m2ps2: FloatArray
    integers: Integers | None
    losses: tuple[Loss, ...]
    rejections: tuple[Rejected, ...]
    notes: tuple[str, ...]
    rough: bool = False


def build_problem(flight: Flight, settings: ProblemSettings) -> PreparedFlight:
    """Return the smoothing problem of a flight: its GNSS epochs within the inertial record.

    Raises
    ------
    NoSolutionError
        Naming the part of the flight that is missing.
    """
    asked = constants_of(settings.calibration, flight, gravity=settings.gravity is not None)
    inertial_record(flight)
    if settings.causal:
        stage = causal_aligned(flight, settings)
        track = causal_tracked(flight, stage)
    else:
        flight, asked = initial_shape(flight, asked, settings.resolver)
        stage = aligned(flight, settings, asked)
        track = tracked(flight, stage)
    imu, causal = stage.record.imu, settings.causal
    sensed = sense(flight, imu, stage.down, track.t_s, track.places_n_m, causal=causal)
    common_m2 = track.antenna.common_m2 + track.segments.common_m2
    usual_m2 = common_m2[0] if causal else common_m2.mean(axis=0)
    constants = _constants(flight, asked, sensed, usual_m2, (stage, track))
    motion, rate_notes = motion_of(flight, settings, (stage, track), constants)
    problem = SmoothingProblem(
        t_s=track.t_s,
        start=_start(stage, track, constants, causal=causal),
        motion=motion,
        measurements=measurements_of(_recorded(flight, stage, track, sensed, asked), constants),
        constants=constants,
        attitude_known=stage.start.valid,
    )
    start, antenna, gate = stage.start, track.antenna, track.gate
    gaps = _gaps(stage, track, sensed)
    return PreparedFlight(
        problem=problem,
        imu=imu,
        earth_rate_n_radps=flight.origin.earth_rate_n_radps,
        epochs=stage.epochs,
        common_position_m2=common_m2,
        common_velocity_m2ps2=antenna.drift_m2ps2,
        integers=start.integers,
        losses=(*start.losses, *stage.losses, *antenna.losses, *gate.losses, *sensed.losses),
        rejections=(*start.rejections, *gate.rejections),
        notes=(
            *start.notes,
            *rate_notes,
            *antenna.notes,
            *gaps,
            *stage.float_arcs.notes,
            *track.notes,
        ),
        rough=start.rough,
    )


def _constants(
    flight: Flight,
    asked: tuple[FlightConstant, ...],
    sensed: Sensed,
    usual_m2: FloatArray,
    stages: tuple[Aligned, Tracked],
) -> Constants:
    """Return what is estimated with the flight: asked for, of instruments, of phases, the rate."""
    stage, track = stages
    parts = with_evidence(asked, sight=sensed.sight is not None)
    if sensed.sight is not None and flight.seeker is not None:
        parts = with_landmark(parts, flight.seeker.landmark_n_m)
    parts = (*parts, *sensed.constants)
    parts = with_common_error(parts, usual_m2)
    if not stage.gyroscope:
        parts = (*parts, mean_rate())
    return Constants((*parts, *stage.float_arcs.constants, *track.segments.constants))


def _recorded(
    flight: Flight,
    stage: Aligned,
    track: Tracked,
    sensed: Sensed,
    asked: tuple[FlightConstant, ...],
) -> Recorded:
    start = stage.start
    names = tuple(antenna.name for antenna in flight.antennas)
    return Recorded(
        array=start.form,
        array_valid=start.valid,
        float_stretch=stage.float_arcs.stretch,
        shape=shape_at(start.phases, start.form, track.t_s, start.valid, asked, names),
        antennas=names,
        position=track.segments.position,
        velocity=track.velocity,
        sensed=sensed,
        gravity_n_mps2=track.gravity_n_mps2,
        measured_b_radps=stage.rates if stage.gyroscope else None,
        earth_rate_n_radps=flight.origin.earth_rate_n_radps,
    )


def _start(stage: Aligned, track: Tracked, constants: Constants, *, causal: bool) -> States:
    """Return where the search starts."""
    t_s, R_nb, position = track.t_s, stage.start.R_nb, track.segments.position
    p_n_m = interpolated(t_s, position.value, causal=causal) - R_nb @ position.arm_b_m
    v_n_mps = np.zeros_like(p_n_m) if causal else np.gradient(p_n_m, t_s, axis=0)
    velocity = track.velocity
    if velocity is not None and velocity.valid.any():
        at_antenna = interpolated(t_s, velocity.value, causal=causal)
        v_n_mps = at_antenna - swing_n_mps(R_nb, stage.rates, velocity.arm_b_m)
    aux = np.zeros((len(t_s), 6 if stage.gyroscope else 12))
    if not stage.gyroscope:
        aux[:, 3:6] = stage.rates
    return States(R_nb=R_nb, p_n_m=p_n_m, v_n_mps=v_n_mps, aux=aux, constants=constants.start)


def _gaps(stage: Aligned, track: Tracked, sensed: Sensed) -> tuple[str, ...]:
    """Return sentences on where measurements are missing for long."""
    t_s, gate = stage.start.t_s, track.gate
    notes = [*gap_notes("inertial samples", stage.record.gaps_s)]
    notes += gap_notes("attitude of single epochs", spans(t_s, ~stage.start.valid))
    for what, series in (("position", gate.position), ("velocity", gate.velocity)):
        if series is not None:
            notes += gap_notes(what, spans(t_s, ~series.valid))
    if sensed.sight is not None:
        notes += gap_notes("line of sight", spans(t_s, np.isnan(sensed.sight.e_b[:, 0])))
    return tuple(notes)
