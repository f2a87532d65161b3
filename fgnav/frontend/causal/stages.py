"""The stages before a smoothing problem for a filter: each keyframe by what came before it alone.

What is certain only later is left out: arcs have the integers that epochs so far name, none floats.
"""

from dataclasses import replace

import numpy as np

from fgnav.attitude.flight_vectors import measured_vectors, track_of, with_velocity
from fgnav.attitude.own_rotation import own_rotation, spun
from fgnav.attitude.vector_pairs import wahba
from fgnav.checks import FloatArray, Loss, NoSolutionError
from fgnav.frontend.array.float_arcs import FloatArcs
from fgnav.frontend.attitude.alignment import Alignment, at_keyframes, of_arrays, of_motion
from fgnav.frontend.attitude.filling import zero_order_hold
from fgnav.frontend.attitude.in_motion import EarlierMotion
from fgnav.frontend.attitude.initial import level_start
from fgnav.frontend.attitude.vector_alignment import VECTOR_SIGMA_RAD
from fgnav.frontend.faulty_samples import without_stuck_so_far
from fgnav.frontend.gaps import bridged, keyframe_times
from fgnav.frontend.settings import ProblemSettings
from fgnav.frontend.stages import (
    Aligned,
    inertial_record,
    kept,
    reason_without_attitude,
)
from fgnav.geometry.rotations import log, transpose
from fgnav.gravity import causal_gravity
from fgnav.types.flight import Flight, Imu


def causal_aligned(
    flight: Flight, settings: ProblemSettings, earlier: EarlierMotion | None = None
) -> Aligned:
    """Return attitudes at keyframes, each from its own epoch, integers and all.

    Of a flight that goes on, ``earlier`` sums up its beginning.

    Raises
    ------
    BadInputError
        If the resolver or the gravity estimator has no causal form.
    NoSolutionError
        If no epoch has an attitude.
    """
    imu, faulty = without_stuck_so_far(inertial_record(flight))
    record = bridged(imu, causal=True)
    imu = record.imu
    down = None if settings.gravity is None else causal_gravity(settings.gravity)(flight)
    start, count, losses = _keyframes(imu, _epochs(flight, settings, earlier), earlier)
    R_open = None
    if start.own is not None and not start.valid[0]:
        R_nu = level_start(flight, imu, start.own, float(start.t_s[0]))
        R_open = spun(start.own, start.t_s, np.tile(R_nu, (len(start.t_s), 1, 1)))
    stretch = np.full(len(start.t_s), -1, dtype=np.int64)
    rates = np.zeros((len(start.t_s), 3)) if imu.w_b_radps is None else _latest_rates(imu, start)
    no_arcs, losses = FloatArcs(stretch=stretch, count=0), (*faulty, *losses)
    return Aligned(record, down, start, no_arcs, rates, count, losses, causal=True, R_open=R_open)


def _epochs(flight: Flight, settings: ProblemSettings, earlier: EarlierMotion | None) -> Alignment:
    """Return attitudes by the array, by motion beside a gyroscope, or by other vectors."""
    if _has_array(flight):
        return of_arrays(flight, settings.resolver, settings.false_alarm, causal=True)
    imu = flight.imu
    if imu is None or imu.w_b_radps is None or flight.seeker is not None:
        return _of_vectors(flight)
    return of_motion(flight, imu, causal=True, earlier=earlier)


def _has_array(flight: Flight) -> bool:
    return flight.observations is not None and len(flight.antennas) > 1


def _of_vectors(flight: Flight) -> Alignment:
    """Return attitudes of epochs without an array: specific force, line of sight, velocity."""
    track = track_of(flight, causal=True)
    pairs, losses = measured_vectors(flight, track, causal=True)
    attitude = wahba(with_velocity(pairs, track).directions())
    determined, n = attitude.rank == 2, len(track.t_s)
    return Alignment(
        t_s=track.t_s,
        R_nb=np.where(determined[:, None, None], attitude.R_nb, np.eye(3)),
        covariance_rad2=np.tile(VECTOR_SIGMA_RAD**2 * np.eye(3), (n, 1, 1)),
        valid=determined,
        form=None,
        integers=None,
        refused=np.zeros(n, dtype=np.bool_),
        losses=losses,
        rejections=(),
        notes=(),
        rough=True,
    )


def _keyframes(
    imu: Imu, epochs: Alignment, earlier: EarlierMotion | None
) -> tuple[Alignment, int, tuple[Loss, ...]]:
    """Choose epochs, and times between and after them, as keyframes; count the rest."""
    turn_rad = None
    if imu.w_b_radps is None and len(epochs.t_s) > 1:
        turn_rad = np.linalg.norm(log(transpose(epochs.R_nb[:-1]) @ epochs.R_nb[1:]), axis=1)
        turn_rad[~(epochs.valid[1:] & epochs.valid[:-1])] = np.nan
    usual_s = None if earlier is None else earlier.step_s
    times_s = keyframe_times(epochs.t_s, float(imu.t_s[-1]), turn_rad, causal=True, usual_s=usual_s)
    start = at_keyframes(epochs, times_s)
    covered = (start.t_s >= imu.t_s[0]) & (start.t_s <= imu.t_s[-1])
    good = np.flatnonzero(covered & start.valid)
    carries = imu.w_b_radps is not None  # attitudes to epochs without one
    if not len(good) and not (carries and start.form is None and covered.any()):
        why = reason_without_attitude(imu, start, covered)
        raise NoSolutionError(f"attitude: no epoch has one to start from: {why}")
    early = covered & (np.arange(len(start.t_s)) < (0 if carries else good[0]))
    start, losses = kept(start, covered, early)
    if len(start.t_s) < 2:
        why = reason_without_attitude(imu, start, covered[covered & ~early])
        raise NoSolutionError(f"attitude: one keyframe, needs 2 or more: {why}")
    if carries and start.own is None:
        first_s = float(start.t_s[start.valid.argmax()])
        start = replace(start, own=own_rotation(imu), heading_from_s=first_s)
    R_nu = zero_order_hold(start.t_s, start.R_nu, start.valid)
    return replace(start, R_nb=spun(start.own, start.t_s, R_nu)), len(times_s), losses


def _latest_rates(imu: Imu, start: Alignment) -> FloatArray:
    """Return the gyroscope's newest sample at each keyframe, (n, 3)."""
    if imu.w_b_radps is None:
        return np.zeros((len(start.t_s), 3))
    return np.asarray(
        imu.w_b_radps[(np.searchsorted(imu.t_s, start.t_s, side="right") - 1).clip(0)]
    )
