"""The stages before a smoothing problem for a filter: each keyframe by what came before it alone.

What is certain only later is left out: no integers along arcs, no float arcs.
"""

from dataclasses import replace

import numpy as np

from fgnav.attitude.array import maximum_likelihood
from fgnav.attitude.flight_vectors import measured_vectors, track_of, with_velocity
from fgnav.attitude.own_rotation import own_rotation, spun
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.attitude.vector_pairs import wahba
from fgnav.checks import BoolArray, FloatArray, Loss, NoSolutionError
from fgnav.frontend.array.float_arcs import FloatArcs
from fgnav.frontend.array.pivot import pivot_views
from fgnav.frontend.attitude.alignment import Alignment, at_keyframes, completed_by, of_motion
from fgnav.frontend.attitude.filling import zero_order_hold
from fgnav.frontend.attitude.in_motion import EarlierMotion
from fgnav.frontend.attitude.initial import level_start
from fgnav.frontend.attitude.vector_alignment import VECTOR_SIGMA_RAD
from fgnav.frontend.causal.array import causal_array
from fgnav.frontend.faulty_samples import without_stuck_so_far
from fgnav.frontend.gaps import bridged, keyframe_times
from fgnav.frontend.matching import nearest
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

    Of a flight that goes on, ``earlier`` is what its beginning told.

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
        return _of_arrays(flight, settings)
    imu = flight.imu
    if imu is None or imu.w_b_radps is None or flight.seeker is not None:
        return _of_vectors(flight)
    return of_motion(flight, imu, causal=True, earlier=earlier)


def _has_array(flight: Flight) -> bool:
    return flight.observations is not None and len(flight.antennas) > 1


def _of_arrays(flight: Flight, settings: ProblemSettings) -> Alignment:
    """Return attitudes of the array, by another reference where the first tracks nothing."""
    whole, *others = pivot_views(flight, causal=True)
    start = _of_array(whole.flight, settings)
    for view in others:
        try:
            start = completed_by(start, _of_array(view.flight, settings), view.rows)
        except NoSolutionError:  # then these epochs stay without
            continue
    return start


def _of_array(flight: Flight, settings: ProblemSettings) -> Alignment:
    array = causal_array(flight, settings.resolver, settings.false_alarm)
    attitude, form = array.attitude, array.form
    is_open = attitude.solved & attitude.open_axis_b.any(axis=1)
    if is_open.any():  # an angle that one baseline leaves open, by other vectors
        attitude = maximum_likelihood(_with_vectors(flight, form, array.differences.t_s, is_open))
    differences = array.differences
    return Alignment(
        t_s=differences.t_s,
        R_nb=attitude.R_nb,
        covariance_rad2=attitude.covariance_rad2,
        valid=attitude.solved & ~array.refused & ~attitude.open_axis_b.any(axis=1),
        form=form,
        integers=array.integers,
        refused=array.refused,
        losses=(*differences.losses, *array.integers.losses),
        rejections=(),
        notes=(),
        unobservable=attitude.unobservable(),
        phases=(differences, array.ranges_m),
    )


def _with_vectors(
    flight: Flight, form: RotationQuadratic, t_s: FloatArray, wanted: BoolArray
) -> RotationQuadratic:
    """Return forms with what other vectors say of epochs that need it."""
    track = track_of(flight, causal=True)
    pairs, _ = measured_vectors(flight, track, causal=True)
    row, same = nearest(track.t_s, t_s)
    for v_n, v_b in zip(np.moveaxis(pairs.v_n, 1, 0), np.moveaxis(pairs.v_b, 1, 0), strict=True):
        there = same & wanted & np.isfinite(v_n[row]).all(axis=1)
        there &= np.isfinite(v_b[row]).all(axis=1)
        size = np.where(there, np.linalg.norm(v_b[row], axis=1), 1.0)
        form = form + RotationQuadratic.of_vector_pairs(
            np.where(there[:, None], v_n[row], 0.0),
            np.where(there[:, None], v_b[row], np.nan),
            (VECTOR_SIGMA_RAD * size)[:, None, None] ** 2 * np.eye(3),
        )
    return form


def _of_vectors(flight: Flight) -> Alignment:
    """Return attitudes of epochs without an array: specific force, line of sight, velocity."""
    track = track_of(flight, causal=True)
    pairs, losses = measured_vectors(flight, track, causal=True)
    attitude = wahba(with_velocity(pairs, track).directions())
    known, n = attitude.rank == 2, len(track.t_s)
    return Alignment(
        t_s=track.t_s,
        R_nb=np.where(known[:, None, None], attitude.R_nb, np.eye(3)),
        covariance_rad2=np.tile(VECTOR_SIGMA_RAD**2 * np.eye(3), (n, 1, 1)),
        valid=known,
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
