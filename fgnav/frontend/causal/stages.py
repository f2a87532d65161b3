"""The stages before a smoothing problem for a filter: each keyframe by what came before it alone.

What is certain only later is left out: no integers along arcs, no positions by phase, no float
arcs.
"""

from dataclasses import replace

import numpy as np

from fgnav.attitude.array import maximum_likelihood
from fgnav.attitude.flight_vectors import measured_vectors, track_of, with_velocity
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.attitude.vector_pairs import wahba
from fgnav.checks import BoolArray, FloatArray, Loss, NoSolutionError
from fgnav.flight import Flight, Imu
from fgnav.frontend.array.float_arcs import FloatArcs
from fgnav.frontend.array.pivot import pivot_views
from fgnav.frontend.attitude.alignment import Alignment, at_keyframes, completed_by
from fgnav.frontend.attitude.filling import zero_order_hold
from fgnav.frontend.attitude.vector_alignment import VECTOR_SIGMA_RAD
from fgnav.frontend.causal.array import causal_array, causal_track
from fgnav.frontend.gaps import LONGEST_GAP_S, bridged, keyframe_times
from fgnav.frontend.matching import nearest, unused
from fgnav.frontend.position.antenna_motion import AntennaMotion, motion_of_fixes
from fgnav.frontend.position.antenna_motion import completed_by as moved_by
from fgnav.frontend.position.gate import InertialTrack, gated
from fgnav.frontend.position.segments import Segments
from fgnav.frontend.position.series import VectorSeries
from fgnav.frontend.settings import ProblemSettings
from fgnav.frontend.stages import (
    Aligned,
    Tracked,
    inertial_record,
    interpolated,
    reason_without_attitude,
)
from fgnav.gravity import causal_gravity
from fgnav.rotations import log, transpose


def causal_aligned(flight: Flight, settings: ProblemSettings) -> Aligned:
    """Return attitudes at keyframes, each from its own epoch, integers and all.

    Raises
    ------
    BadInputError
        If the resolver or the gravity estimator has no causal form.
    NoSolutionError
        If no epoch has an attitude.
    """
    record = bridged(inertial_record(flight), causal=True)
    imu = record.imu
    down = None if settings.gravity is None else causal_gravity(settings.gravity)(flight)
    epochs = _of_arrays(flight, settings) if _has_array(flight) else _of_vectors(flight)
    start, count, losses = _keyframes(imu, epochs)
    stretch = np.full(len(start.t_s), -1, dtype=np.int64)
    rates = np.zeros((len(start.t_s), 3)) if imu.w_b_radps is None else _latest_rates(imu, start)
    no_arcs = FloatArcs(stretch=stretch, count=0)
    return Aligned(record, down, start, no_arcs, rates, count, losses, causal=True)


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


def _keyframes(imu: Imu, epochs: Alignment) -> tuple[Alignment, int, tuple[Loss, ...]]:
    """Choose epochs, and times between and after them, as keyframes; count the rest."""
    turn_rad = None
    if imu.w_b_radps is None and len(epochs.t_s) > 1:
        turn_rad = np.linalg.norm(log(transpose(epochs.R_nb[:-1]) @ epochs.R_nb[1:]), axis=1)
        turn_rad[~(epochs.valid[1:] & epochs.valid[:-1])] = np.nan
    times_s = keyframe_times(epochs.t_s, float(imu.t_s[-1]), turn_rad, causal=True)
    start = at_keyframes(epochs, times_s)
    covered = (start.t_s >= imu.t_s[0]) & (start.t_s <= imu.t_s[-1])
    good = np.flatnonzero(covered & start.valid)
    if not len(good):
        why = reason_without_attitude(imu, start, covered)
        raise NoSolutionError(f"attitude: no epoch has one to start from: {why}")
    early = covered & (np.arange(len(start.t_s)) < good[0])
    reasons = {
        ("epoch", "not covered by the accelerometer's record"): ~covered,
        ("epoch", "before the first attitude"): early,
        ("array phases of an epoch", "residuals fail the chi-square test"): covered & start.refused,
    }
    losses = tuple(
        Loss(what=what, reason=reason, count=int(lost.sum()))
        for (what, reason), lost in reasons.items()
        if lost.any()
    )
    start = start[np.flatnonzero(covered & ~early)]
    if len(start.t_s) < 2:
        why = reason_without_attitude(imu, start, covered[covered & ~early])
        raise NoSolutionError(f"attitude: one keyframe, needs 2 or more: {why}")
    R_nb = zero_order_hold(start.t_s, start.R_nb, start.valid)
    return replace(start, R_nb=R_nb), len(times_s), losses


def _latest_rates(imu: Imu, start: Alignment) -> FloatArray:
    """Return the gyroscope's newest sample at each keyframe, (n, 3)."""
    if imu.w_b_radps is None:
        return np.zeros((len(start.t_s), 3))
    return np.asarray(
        imu.w_b_radps[(np.searchsorted(imu.t_s, start.t_s, side="right") - 1).clip(0)]
    )


def causal_tracked(flight: Flight, stage: Aligned) -> Tracked:
    """Return positions and velocities of an antenna by code and Doppler, or by fixes."""
    start, record = stage.start, stage.record
    antenna = _antennas(flight, stage)
    if antenna.position is None or not antenna.position.valid.any():
        raise NoSolutionError("position: neither code observations nor fixes at keyframes")
    places_n_m = interpolated(start.t_s, antenna.position.value, causal=True)
    gravity_n_mps2 = flight.origin.gravity_n_mps2(places_n_m)
    track = InertialTrack(
        t_s=start.t_s,
        R_nb=start.R_nb,
        R_nu=start.R_nb,
        w_b_radps=stage.rates,
        imu=record.imu,
        gravity_n_mps2=gravity_n_mps2,
        blind=(stage.away_s > LONGEST_GAP_S) | record.overlaps(start.t_s),
        causal=True,
    )
    gate = gated(track, (antenna.position, antenna.velocity), antenna.name)
    position = gate.position or antenna.position
    segments = Segments(position=position, constants=(), common_m2=np.zeros_like(antenna.common_m2))
    return Tracked(
        start.t_s, antenna, places_n_m, gravity_n_mps2, gate, segments, gate.velocity, ()
    )


def _antennas(flight: Flight, stage: Aligned) -> AntennaMotion:
    """Return how the reference antenna moved, or while it tracks nothing another one.

    Velocities of another only with a gyroscope: nothing else tells how it swings about the first.
    """
    whole, *others = pivot_views(flight, causal=True)
    antenna = _antenna(whole.flight, stage)
    for view in others:
        try:
            other = _antenna(view.flight, stage)
        except NoSolutionError:
            continue
        if not stage.gyroscope:
            other = replace(other, velocity=None)
        antenna = moved_by(antenna, other, stage.start, stage.rates)
    return antenna


def _antenna(flight: Flight, stage: Aligned) -> AntennaMotion:
    """Return positions whose noise is the receiver's; what stays with satellites is common."""
    t_s, imu = stage.start.t_s, stage.record.imu
    if flight.observations is None:
        return motion_of_fixes(flight, imu, t_s)
    code, antenna = causal_track(flight), flight.antennas[0]
    arm_b_m = antenna.position_b_m - imu.position_b_m
    row, same = nearest(code.t_s, t_s)
    # Of times between epochs what stays with satellites is that of the epoch before.
    row = np.where(same, row, (np.searchsorted(code.t_s, t_s) - 1).clip(0))

    def series(value: FloatArray, covariance: FloatArray) -> VectorSeries:
        value = np.where(same[:, None], value[row], np.nan)
        return VectorSeries(value=value, covariance=covariance[row], arm_b_m=arm_b_m)

    velocity = None
    if code.v_n_mps is not None and code.velocity_covariance_m2ps2 is not None:
        velocity = series(code.v_n_mps, code.velocity_covariance_m2ps2)
    common_m2 = (code.position_covariance_m2 - code.position_noise_m2)[row]
    drift_per_s = code.drift_per_s[row]
    return AntennaMotion(
        name=antenna.name,
        position=series(code.p_n_m, code.position_noise_m2),
        velocity=velocity,
        arcs_m2=np.zeros_like(common_m2),
        common_m2=common_m2,
        drift_m2ps2=drift_per_s @ common_m2 @ transpose(drift_per_s),
        losses=(*code.losses, *unused("code solution", len(code.t_s), same)),
    )
