"""From a flight to keyframes: what each GNSS epoch measured, and where to start."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Loss, NoSolutionError
from fgnav.flight import Flight, Imu
from fgnav.gravity import GravityEstimator
from fgnav.integers.resolver import Integers, Resolver
from fgnav.methods.smoother import instruments
from fgnav.methods.smoother.keyframes import ArrayForm, Keyframes, Timed
from fgnav.methods.smoother.preintegration import (
    RATE_SPAN_S,
    Preintegrator,
    angular_acceleration_density,
    angular_rates,
    increments,
)
from fgnav.methods.smoother.starts import Start, start_of
from fgnav.rotations import exp, log, skew, transpose

_UNKNOWN_RATE_RADPS = 30.0  # 1-sigma of the first body rate: five turns a second
_LONGEST_GAP_S = 0.5  # of the accelerometer's record, bridged by interpolation


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What the user may choose; see ``Smoother``."""

    resolver: Resolver
    gravity: GravityEstimator | None
    angular_acceleration_density: float | None
    sub_steps: int
    false_alarm: float


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Collected:
    """Keyframes of a flight, and what is to be said of them.

    Attributes
    ----------
    keyframes : Keyframes
    epochs : int
        GNSS epochs of the flight.
    common_position_m2 : ndarray, shape (n, 3, 3)
        Variance of positions at keyframes that no smoothing reduces.
    integers : Integers or None
    losses : tuple of Loss
    notes : tuple of str
    """

    keyframes: Keyframes
    epochs: int
    common_position_m2: FloatArray
    integers: Integers | None
    losses: tuple[Loss, ...]
    notes: tuple[str, ...]


def collect(flight: Flight, settings: Settings) -> Collected:
    """Return the keyframes of a flight: its GNSS epochs within the accelerometer's record.

    Raises
    ------
    NoSolutionError
        Naming the part of the flight that is missing.
    """
    imu = flight.imu
    if imu is None:
        raise NoSolutionError("motion: between epochs it needs an [imu], the flight has none")
    start = start_of(flight, settings.resolver, settings.false_alarm)
    keep, losses = _keyframes(imu, start)
    t_s, told = start.t_s[keep], start.told[keep]
    R_nb = _filled(t_s, start.R_nb[keep], told)
    covariance_rad2 = start.covariance_rad2[keep][told]
    antenna = instruments.antenna_motion(flight, imu, t_s)
    rates = _rates(imu, t_s, R_nb, covariance_rad2)
    velocity = _at_accelerometer(antenna.velocity, R_nb, rates)
    p_n_m, v_n_mps = _start(t_s, R_nb, antenna.position, velocity)
    slot, slot_sigma = _slot(imu, rates)
    sight, sight_losses = instruments.sight(flight, imu, t_s, p_n_m)
    gravity, gravity_losses = instruments.gravity(flight, settings.gravity, t_s)
    gravity_n_mps2 = flight.origin.gravity_n_mps2(p_n_m)
    keyframes = Keyframes(
        t_s=t_s,
        array=ArrayForm.of(start.form[keep] if start.form is not None else None, told),
        R_nb=R_nb,
        p_n_m=p_n_m,
        v_n_mps=v_n_mps,
        slot=slot,
        slot_sigma=slot_sigma,
        position=antenna.position,
        velocity=velocity,
        gravity=gravity,
        gravity_n_mps2=gravity_n_mps2,
        sight=sight,
        landmark_n_m=None if sight is None or flight.seeker is None else flight.seeker.landmark_n_m,
        preintegrate=Preintegrator(
            imu=imu,
            increments=increments(imu, t_s, settings.sub_steps),
            gravity_n_mps2=gravity_n_mps2,
            earth_rate_n_radps=flight.origin.earth_rate_n_radps,
            angular_acceleration_density=_density(
                imu, settings, t_s[told], R_nb[told], covariance_rad2
            ),
        ),
    )
    parts = (start.losses, losses, antenna.losses)
    return Collected(
        keyframes=keyframes,
        epochs=len(start.t_s),
        common_position_m2=antenna.common_m2,
        integers=start.integers,
        losses=tuple(sum((*parts, sight_losses, gravity_losses), ())),
        notes=start.notes,
    )


def _keyframes(imu: Imu, start: Start) -> tuple[IntArray, tuple[Loss, ...]]:
    """Choose the epochs that become keyframes; count the rest with their reasons."""
    t_s = start.t_s
    gaps = np.flatnonzero(np.diff(imu.t_s) > _LONGEST_GAP_S)
    if len(gaps):
        at_s = imu.t_s[gaps[0]]
        raise NoSolutionError(
            f"motion: the accelerometer has {len(gaps)} gaps above {_LONGEST_GAP_S} s, "
            f"the first after t_s = {at_s:.3f}"
        )
    covered = (t_s >= imu.t_s[0]) & (t_s <= imu.t_s[-1])
    good = np.flatnonzero(covered & start.told)
    if len(good) < 2:
        raise NoSolutionError(
            f"attitude: {len(good)} epochs have consistent array phases, or other vectors out of "
            "line, to start from; needs 2 or more"
        )
    early = covered & (np.arange(len(t_s)) < good[0])
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
    return np.flatnonzero(covered & ~early), losses


def _filled(t_s: FloatArray, R_nb: FloatArray, told: BoolArray) -> FloatArray:
    """Turn evenly between neighbours where an epoch has no attitude; hold the last one."""
    known = np.flatnonzero(told)
    place = np.interp(t_s, t_s[known], np.arange(len(known)))
    before = np.floor(place).astype(np.int64)
    after = np.minimum(before + 1, len(known) - 1)
    first, last = R_nb[known[before]], R_nb[known[after]]
    share = (place - before)[:, None]
    return np.asarray(first @ exp(share * log(transpose(first) @ last)))


def _start(
    t_s: FloatArray, R_nb: FloatArray, position: Timed | None, velocity: Timed | None
) -> tuple[FloatArray, FloatArray]:
    """Return where positions and velocities of the accelerometer start, (n, 3) each."""
    if position is None or not np.isfinite(position.value).any():
        raise NoSolutionError("position: neither code observations nor fixes at keyframes")
    p_n_m = _interpolated(t_s, position.value) - R_nb @ position.arm_b_m
    if velocity is not None and np.isfinite(velocity.value).any():
        return p_n_m, _interpolated(t_s, velocity.value)
    return p_n_m, np.gradient(p_n_m, t_s, axis=0)


def _interpolated(t_s: FloatArray, values: FloatArray) -> FloatArray:
    known = np.isfinite(values).all(axis=1)
    columns = [np.interp(t_s, t_s[known], column[known]) for column in values.T]
    return np.stack(columns, axis=1)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Rates:
    """Body rates at keyframes, (n, 3), as good as they are before smoothing; their covariance."""

    w_b_radps: FloatArray
    covariance_rad2ps2: FloatArray


def _rates(imu: Imu, t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray) -> _Rates:
    """Return what the gyroscope says, or else the array's attitudes."""
    if imu.w_b_radps is not None and imu.gyroscope_bias_radps is not None:
        measured = [np.interp(t_s, imu.t_s, column) for column in imu.w_b_radps.T]
        covariance = np.eye(3) * imu.gyroscope_bias_radps**2
        return _Rates(w_b_radps=np.stack(measured, axis=1), covariance_rad2ps2=covariance)
    covariance = 2 * covariance_rad2.mean(axis=0) / RATE_SPAN_S**2
    return _Rates(w_b_radps=angular_rates(t_s, R_nb), covariance_rad2ps2=covariance)


def _at_accelerometer(velocity: Timed | None, R_nb: FloatArray, rates: _Rates) -> Timed | None:
    """Take the antenna's swing about the accelerometer off its velocity, and say how well.

    The rates are those before smoothing: a few cm/s with a metre of lever arm, well below Doppler.
    """
    if velocity is None or not velocity.arm_b_m.any():
        return velocity
    arm = skew(velocity.arm_b_m[None])[0]
    swing_n_mps = np.einsum("nij,nj->ni", R_nb, np.cross(rates.w_b_radps, velocity.arm_b_m))
    doubt = R_nb @ (arm @ rates.covariance_rad2ps2 @ arm.T) @ transpose(R_nb)
    return Timed(
        value=velocity.value - swing_n_mps,
        covariance=velocity.covariance + doubt,
        arm_b_m=np.zeros(3),
    )


def _slot(imu: Imu, rates: _Rates) -> tuple[FloatArray, FloatArray]:
    """Return the bias slot's start, (n, 6), and its prior, (6,); see ``preintegration``."""
    slot, sigma = np.zeros((len(rates.w_b_radps), 6)), imu.gyroscope_bias_radps
    if sigma is None:
        slot[:, 3:] = -rates.w_b_radps
        sigma = _UNKNOWN_RATE_RADPS
    return slot, np.repeat([imu.accelerometer_bias_mps2, sigma], 3)


def _density(
    imu: Imu, settings: Settings, t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray
) -> FloatArray:
    """Return the angular acceleration density about the body axes, (3,)."""
    if imu.w_b_radps is not None:
        return np.zeros(3)
    if settings.angular_acceleration_density is not None:
        return np.full(3, settings.angular_acceleration_density)
    return angular_acceleration_density(t_s, R_nb, covariance_rad2)
