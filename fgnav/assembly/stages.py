"""The two stages before a smoothing problem: attitudes at keyframes, then the antenna's motion.

Causal, each keyframe is by what came before it alone.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.alignment.alignment import Alignment, at_keyframes
from fgnav.alignment.array.float_arcs import FloatArcs, with_float_arcs
from fgnav.alignment.array.shape import is_shape_estimated
from fgnav.alignment.array_attitudes import alignment_without_array, array_alignment
from fgnav.alignment.filling import interpolated_attitudes, zero_order_hold
from fgnav.alignment.gaps import (
    LONGEST_GAP_S,
    Bridged,
    bridged,
    keyframe_times,
    time_from_attitude_s,
)
from fgnav.alignment.in_motion.windows import EarlierMotion
from fgnav.alignment.initial import level_start
from fgnav.alignment.matching import SAME_S, nearest
from fgnav.alignment.rates import rough_rates, swing_n_mps
from fgnav.assembly.position.antenna_motion import AntennaMotion, antenna_motion
from fgnav.assembly.position.by_observations import ByObservations
from fgnav.assembly.position.gate import InertialTrack, gated
from fgnav.assembly.settings import ProblemSettings
from fgnav.attitude.imu_rotation import imu_rotation, spun
from fgnav.checks import BoolArray, FloatArray, NoSolutionError, Unused, unused_of
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import log, transpose
from fgnav.graph.types.parameters import Parameter
from fgnav.gravity import GravityDirection, causal_gravity
from fgnav.integrity.imu_screen import screen_imu, screen_imu_causally
from fgnav.types.estimate import Rejected
from fgnav.types.flight import Flight, Imu


class Aligned(NamedTuple):
    """The inertial record, and keyframes with the attitudes of single epochs."""

    record: Bridged
    down: GravityDirection | None
    start: Alignment
    float_arcs: FloatArcs
    rates: FloatArray  # (n, 3), approximate
    epochs: int
    unused: tuple[Unused, ...]
    by: ByObservations | None
    earth_rate_n_radps: FloatArray  # (3,)
    causal: bool = False
    R_open: FloatArray | None = None  # (n, 3, 3): level, the heading not known yet; causal only

    @property
    def gyroscope(self) -> bool:
        """True if rates are measured."""
        return self.record.imu.w_b_radps is not None

    @property
    def heading_known_s(self) -> float:
        """The first keyframe whose past determines the heading, beside a gyroscope; or infinite."""
        if not self.start.valid.any():
            return np.inf
        first_s = float(self.start.t_s[self.start.valid.argmax()])
        return max(first_s, self.start.heading_known_s)

    @property
    def carried_sigma_rad(self) -> FloatArray:
        """1-sigma of attitudes that a gyroscope carried, (n,); 0 of others."""
        of_motion = self.gyroscope and self.start.form is None
        variance = np.einsum("nii->n", self.start.covariance_rad2) / 3
        return np.sqrt(variance) if of_motion else np.zeros(len(variance))

    @property
    def away_s(self) -> FloatArray:
        """Time from each keyframe to the nearest attitude, s, (n,); causal: to the last."""
        return time_from_attitude_s(self.start.t_s, self.start.valid, causal=self.causal)


class Tracked(NamedTuple):
    """Motion of antennas, without measurements that contradict the inertial track."""

    t_s: FloatArray
    places_n_m: FloatArray  # (n, 3), about where the antenna is
    gravity_n_mps2: FloatArray
    antenna: AntennaMotion  # velocities, and positions of fixes, without what is rejected
    rejections: tuple[Rejected, ...]
    unused: tuple[Unused, ...]


def aligned(
    flight: Flight,
    settings: ProblemSettings,
    requested: tuple[Parameter, ...],
    by: ByObservations | None,
    earlier: EarlierMotion | None = None,
) -> Aligned:
    """Return attitudes at keyframes, each from its own epoch.

    Integers may hold along arcs. Causal: each by what came up to it; arcs have the integers that
    epochs so far name, none floats. Of a flight that goes on, ``earlier`` sums up its beginning.

    Raises
    ------
    BadInputError
        If the resolver or the gravity estimator has no causal form.
    NoSolutionError
        If there are fewer than two attitudes, or, causal, none.
    """
    causal = settings.causal
    screened = screen_imu_causally if causal else screen_imu
    if flight.imu is None:
        raise NoSolutionError("motion: between epochs it needs an [imu], the flight has none")
    if len(flight.imu.t_s) < 2:
        raise NoSolutionError(f"motion: the [imu] has {len(flight.imu.t_s)} samples, needs 2")
    imu, faulty = screened(flight.imu)
    record, down = bridged(imu, causal=causal), None
    if settings.gravity is not None:
        down = (causal_gravity(settings.gravity) if causal else settings.gravity)(flight)
    if by is not None and len(flight.antennas) > 1:
        epochs = array_alignment(flight, by.array, causal=causal)
    else:
        epochs = alignment_without_array(flight, down, causal=causal, earlier=earlier)
    start, count, unused = chosen_keyframes(
        flight, record.imu, epochs, causal=causal, earlier=earlier
    )
    float_arcs = FloatArcs.none(len(start.t_s))
    if not (causal or is_shape_estimated(requested)):
        start, float_arcs = with_float_arcs(start, settings.false_alarm)
    return Aligned(
        record=record,
        down=down,
        start=start,
        float_arcs=float_arcs,
        rates=_rates(record.imu, start, causal=causal),
        epochs=count,
        unused=(*faulty, *unused),
        by=by,
        earth_rate_n_radps=flight.origin.earth_rate_n_radps,
        causal=causal,
        R_open=_open_attitudes(flight, record.imu, start) if causal else None,
    )


def _rates(imu: Imu, start: Alignment, *, causal: bool) -> FloatArray:
    """Return approximate body rates at keyframes, (n, 3); causal: zero without a gyroscope."""
    if not causal:
        return rough_rates(imu, start.t_s, start.R_nb, start.rotation)
    if imu.w_b_radps is None:
        return np.zeros((len(start.t_s), 3))
    return interpolate(start.t_s, imu.t_s, imu.w_b_radps, causal=True)


def _open_attitudes(flight: Flight, imu: Imu, start: Alignment) -> FloatArray | None:
    """Return level attitudes, (n, 3, 3), of a flight whose heading is not known at its begin."""
    if start.rotation is None or start.valid[0]:
        return None
    R_nu = level_start(flight, imu, start.rotation, float(start.t_s[0]))
    return spun(start.rotation, start.t_s, np.tile(R_nu, (len(start.t_s), 1, 1)))


def chosen_keyframes(
    flight: Flight,
    imu: Imu,
    epochs: Alignment,
    *,
    causal: bool = False,
    earlier: EarlierMotion | None = None,
) -> tuple[Alignment, int, tuple[Unused, ...]]:
    """Choose epochs, times between them and others as keyframes; count the rest with reasons.

    Others are of what receivers solve beside the track: further fixes, and baselines. Causal: times
    between epochs do not depend on the next, and go on after the last.
    """
    carries = imu.w_b_radps is not None
    start = at_keyframes(epochs, _times_s(flight, imu, epochs, causal=causal, earlier=earlier))
    t_s = start.t_s
    covered = (t_s >= imu.t_s[0]) & (t_s <= imu.t_s[-1])
    good, fewest = np.flatnonzero(covered & start.valid), 1 if causal else 2
    is_carried = carries and start.form is None and covered.sum() >= fewest
    if len(good) < fewest and not is_carried:
        raise NoSolutionError(
            f"attitude: {len(good)} epochs have consistent array phases, or other vectors out of "
            f"line, to start from; needs {fewest} or more: "
            f"{reason_without_attitude(imu, start, covered)}"
        )
    early = covered & (np.arange(len(t_s)) < (0 if carries else good[0]))
    reasons = {
        ("epoch", "not covered by the accelerometer's record"): ~covered,
        ("epoch", "before the first attitude"): early,
        ("array phases of an epoch", "residuals fail the chi-square test"): covered & start.refused,
    }
    unused = unused_of({reason: int(lost.sum()) for reason, lost in reasons.items()})
    start = start[np.flatnonzero(covered & ~early)]
    if len(start.t_s) < 2:
        why = reason_without_attitude(imu, start, covered[covered & ~early])
        raise NoSolutionError(f"attitude: one keyframe, needs 2 or more: {why}")
    if carries and start.rotation is None:
        first_s = float(start.t_s[start.valid.argmax()])
        start = replace(start, rotation=imu_rotation(imu), heading_from_s=first_s)
    fill = zero_order_hold if causal else interpolated_attitudes
    R_nu = fill(start.t_s, start.R_nu, start.valid)
    return replace(start, R_nb=spun(start.rotation, start.t_s, R_nu)), len(t_s), unused


def _times_s(
    flight: Flight,
    imu: Imu,
    epochs: Alignment,
    *,
    causal: bool,
    earlier: EarlierMotion | None,
) -> FloatArray:
    """Return the times of keyframes, (n,), in and beyond the inertial record."""
    epochs_s, usual_s = epochs.t_s, None if earlier is None else earlier.step_s
    turn_rad = _turns_rad(epochs) if imu.w_b_radps is None else None
    times_s = keyframe_times(epochs_s, float(imu.t_s[-1]), turn_rad, causal=causal, usual_s=usual_s)
    further = flight.fixes[1:] if flight.observations is None else ()
    also_s = [np.empty(0), *(one.t_s for one in (*further, *flight.baselines))]
    new_s = np.unique(np.concatenate(also_s))
    new_s = new_s[~nearest(times_s, new_s)[1]]
    times_s = np.union1d(times_s, new_s[np.diff(new_s, prepend=-np.inf) > SAME_S])
    # Nothing is measured between epochs before the first of a record, and a window that begins
    # there is held for one without a heading.
    first_s = epochs_s[epochs_s >= imu.t_s[0]].min(initial=np.inf)
    return np.asarray(times_s[(times_s >= first_s) | np.isin(times_s, epochs_s)])


def _turns_rad(epochs: Alignment) -> FloatArray | None:
    """Return the angles from epoch to epoch of a body without a gyroscope; NaN where unknown."""
    if len(epochs.t_s) < 2:
        return None
    R_nu = epochs.R_nu  # a spin may be half a turn from one epoch to the next
    turn_rad = np.linalg.norm(log(transpose(R_nu[:-1]) @ R_nu[1:]), axis=1)
    turn_rad[~(epochs.valid[1:] & epochs.valid[:-1])] = np.nan
    if epochs.rotation is not None:
        spin_radps = np.linalg.norm(epochs.rotation.rates(epochs.t_s), axis=1)
        turn_rad = np.nan_to_num(turn_rad) + spin_radps[1:] * np.diff(epochs.t_s)
    return np.asarray(turn_rad)


def tracked(flight: Flight, stage: Aligned) -> Tracked:
    """Build the antennas' motion; fixes and velocities are tested against the inertial track.

    Raises
    ------
    NoSolutionError
        If there is no position.
    """
    record, start, causal = stage.record, stage.start, stage.causal
    t_s, rotation = start.t_s, start.rotation
    antenna = antenna_motion(flight, record.imu, start, stage.by)
    position = antenna.position
    if position is None or not position.valid.any():
        raise NoSolutionError("position: neither code observations nor fixes at keyframes")
    # Gravity minds no jumps of 100 m.
    places_n_m = _interpolated(t_s, position.value, causal=causal)
    gravity_n_mps2 = flight.origin.gravity_n_mps2(places_n_m)
    untested = (stage.away_s > LONGEST_GAP_S) | record.overlaps(t_s)
    if causal:
        untested |= ~np.logical_or.accumulate(start.valid)
    inertial = InertialTrack(
        t_s=t_s,
        R_nb=start.R_nb,
        R_nu=start.R_nb if causal else start.R_nu,
        w_b_radps=stage.rates,
        imu=record.imu if causal or rotation is None else rotation.forces(record.imu),
        gravity_n_mps2=gravity_n_mps2,
        untested=untested,
        attitude_sigma_rad=stage.carried_sigma_rad,
        causal=causal,
    )
    return Tracked(t_s, places_n_m, gravity_n_mps2, *gated(inertial, antenna))


def approximate_motion(
    stage: Aligned, track: Tracked, R_nb: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return places and velocities of the accelerometer, (n, 3) each, if its attitudes are R_nb."""
    position = track.antenna.position
    p_n_m = track.places_n_m - R_nb @ (0.0 if position is None else position.arm_b_m)
    v_n_mps = np.zeros_like(p_n_m) if stage.causal else np.gradient(p_n_m, track.t_s, axis=0)
    for velocity in track.antenna.velocities[:1]:
        if not velocity.valid.any():
            continue
        at_antenna = _interpolated(track.t_s, velocity.value, causal=stage.causal)
        v_n_mps = at_antenna - swing_n_mps(R_nb, stage.rates, velocity.arm_b_m)
    return p_n_m, v_n_mps


def _interpolated(t_s: FloatArray, values: FloatArray, *, causal: bool) -> FloatArray:
    """Return values, (n, d), where rows are NaN from their neighbours; causal: the last one's."""
    valid = np.asarray(np.isfinite(values).all(axis=1))
    if causal:
        return zero_order_hold(t_s, values, valid)
    return interpolate(t_s, t_s[valid], values[valid])


def reason_without_attitude(imu: Imu, start: Alignment, covered: BoolArray) -> str:
    """Return the reason why a flight has no initial attitudes."""
    if not covered.any():
        return (
            f"no GNSS epoch lies within the accelerometer's record, {imu.t_s[0]:.3f} to "
            f"{imu.t_s[-1]:.3f} s"
        )
    if start.refused.any():
        return f"array phases contradict each other at {int(start.refused.sum())} epochs"
    if start.unobservable:
        angles = " and ".join(start.unobservable)
        return f"the array leaves {angles} open; a baseline out of line or Doppler determines them"
    if start.form is not None and not start.valid.any():
        return "the integers of the array's phases are not fixed, or too few"
    if start.form is None and not start.valid.any():
        return "with one antenna roll needs Doppler or velocities, or a line of sight"
    return f"{int((covered & start.valid).sum())} within the accelerometer's record"
