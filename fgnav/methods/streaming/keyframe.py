"""A keyframe of a stream as a smoothing problem of two rows: the first is there for its time."""

from typing import NamedTuple

import numpy as np

from fgnav.attitude.array import maximum_likelihood
from fgnav.checks import BadInputError, FloatArray
from fgnav.frontend.calibration_request import (
    calibration_requests,
    mean_rate,
    of_vehicle,
    with_landmark,
)
from fgnav.frontend.position.series import VectorSeries
from fgnav.frontend.sensor_factors import Recorded, sensors_of
from fgnav.frontend.sensors.sensed import Sensed
from fgnav.frontend.sensors.surroundings import Heights, MagneticField, field_of, heights_of
from fgnav.graph.factors.directions import Directions
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import States
from fgnav.methods.streaming.measurements import Direction, Measured, Measurements, StreamSetUp

_BEFORE_S = 0.1  # of the first keyframe: an interval that nothing uses


class Before(NamedTuple):
    """The keyframe before: its time, and where the accelerometer was, (3,)."""

    t_s: float
    p_n_m: FloatArray


def keyframe_problem(now: Measurements, set_up: StreamSetUp, before: Before | None) -> Problem:
    """Return a keyframe as the second of two rows; ``before`` is None of the first.

    Raises
    ------
    BadInputError
        If the first has nothing to start from, or a body without a gyroscope no rate prior.
    """
    if before is None:
        R_nb, p_n_m, has_attitude = *_first(now, set_up), True
    else:
        attitude, p_n_m = _attitude(now), before.p_n_m
        R_nb, has_attitude = np.eye(3) if attitude is None else attitude, attitude is not None
    t_s = np.array([now.t_s - _BEFORE_S if before is None else before.t_s, now.t_s])
    n, has_gyroscope = len(t_s), now.imu.w_b_radps is not None
    gravity_n_mps2 = np.tile(set_up.origin.gravity_n_mps2(p_n_m[None]), (n, 1))
    sensed = _sensed(now, set_up, t_s, p_n_m)
    constants = _constants(set_up, sensed, gyroscope=has_gyroscope)
    v_n_mps = np.zeros(3) if now.velocity is None else now.velocity.value
    return Problem(
        t_s=t_s,
        start=States(
            R_nb=np.tile(R_nb, (n, 1, 1)),
            p_n_m=np.tile(p_n_m, (n, 1)),
            v_n_mps=np.tile(v_n_mps, (n, 1)),
            aux=np.zeros((n, 6 if has_gyroscope else 12)),
            constants=constants.start,
        ),
        motion=_motion(now, set_up, t_s, gravity_n_mps2, constants),
        sensors=sensors_of(_recorded(now, set_up, sensed, gravity_n_mps2), constants),
        constants=constants,
        attitude_known=np.full(n, has_attitude),
    )


def _constants(set_up: StreamSetUp, sensed: Sensed, *, gyroscope: bool) -> Constants:
    parts = tuple(of_vehicle(word) for word in calibration_requests(set_up.estimate))
    if set_up.landmark_n_m is not None:
        parts = with_landmark(parts, set_up.landmark_n_m)
    parts = (*parts, *sensed.constants)
    return Constants(parts if gyroscope else (*parts, mean_rate()))


def _sensed(now: Measurements, set_up: StreamSetUp, t_s: FloatArray, p_n_m: FloatArray) -> Sensed:
    """Return what instruments measured, in the last of the rows."""
    n = len(t_s)
    heights, field = _surroundings(now, set_up, t_s, p_n_m)
    return Sensed(
        sight=_directions("line of sight", now.sight, n),
        gravity=_directions("gravity", now.gravity, n),
        heights=heights,
        field=field,
    )


def _surroundings(
    now: Measurements, set_up: StreamSetUp, t_s: FloatArray, p_n_m: FloatArray
) -> tuple[Heights | None, MagneticField | None]:
    """Return samples of barometer and magnetometer, in the last of the rows."""
    barometer, magnetometer, n = set_up.barometer, set_up.magnetometer, len(t_s)
    heights, field = None, None
    if barometer is not None:
        height_m = np.full(n, np.nan)
        height_m[-1] = np.nan if now.height_m is None else now.height_m
        places_n_m, at_b_m = np.tile(p_n_m, (n, 1)), now.imu.position_b_m
        heights = heights_of(barometer, at_b_m, set_up.origin, t_s, places_n_m, height_m)
    if magnetometer is not None:
        field_b_ut = np.full((n, 3), np.nan)
        field_b_ut[-1] = np.nan if now.field_b_ut is None else now.field_b_ut
        field = field_of(magnetometer, field_b_ut)
    return heights, field


def _motion(
    now: Measurements,
    set_up: StreamSetUp,
    t_s: FloatArray,
    gravity_n_mps2: FloatArray,
    constants: Constants,
) -> Motion:
    """Return the motion to the keyframe from the one before."""
    n, earth = len(t_s) - 1, set_up.origin.earth_rate_n_radps
    noise = np.full(n, now.imu.accelerometer_noise_mps2_per_sqrt_hz**2)
    if now.imu.gyroscope_noise_radps_per_sqrt_hz is not None:
        return Inertial(
            t_s=t_s,
            imu=now.imu,
            sub_steps=set_up.sub_steps,
            gravity_n_mps2=gravity_n_mps2,
            earth_rate_n_radps=earth,
            accelerometer_noise=noise,
            gyroscope_noise=np.full(n, now.imu.gyroscope_noise_radps_per_sqrt_hz**2),
        )
    if set_up.rate_prior is None:
        raise BadInputError("stream set-up rate_prior: needed without a gyroscope")
    return GyroFree(
        t_s=t_s,
        imu=now.imu,
        sub_steps=set_up.sub_steps,
        gravity_n_mps2=gravity_n_mps2,
        earth_rate_n_radps=earth,
        poles_per_s=np.tile(set_up.rate_prior.poles_per_s, (n, 1, 1)),
        variance_rad2ps2=np.tile(set_up.rate_prior.variance_rad2ps2, (n, 1)),
        accelerometer_noise=noise,
        rate_column=constants.column("mean rate"),
        constants=constants,
    )


def _recorded(
    now: Measurements, set_up: StreamSetUp, sensed: Sensed, gravity_n_mps2: FloatArray
) -> Recorded:
    """Return what the last of n rows measured."""
    n, rates = len(gravity_n_mps2), None
    valid = np.zeros(n, dtype=np.bool_)
    valid[-1] = now.array is not None
    if now.imu.w_b_radps is not None:
        newest = [np.interp(now.t_s, now.imu.t_s, column) for column in now.imu.w_b_radps.T]
        rates = np.tile(newest, (n, 1))
    position, velocity = (
        _series(one, n, _arm_b_m(now, set_up)) for one in (now.position, now.velocity)
    )
    return Recorded(
        array=None if now.array is None else now.array[np.zeros(n, dtype=np.int64)],
        array_valid=valid,
        float_stretch=np.full(n, -1, dtype=np.int64),
        shape=None,
        antennas=(),
        positions=() if position is None else (position,),
        velocities=() if velocity is None else (velocity,),
        sensed=sensed,
        gravity_n_mps2=gravity_n_mps2,
        measured_b_radps=rates,
        earth_rate_n_radps=set_up.origin.earth_rate_n_radps,
    )


def _attitude(now: Measurements) -> FloatArray | None:
    """Return the array's own attitude, (3, 3)."""
    if now.array is None:
        return None
    solution = maximum_likelihood(now.array)
    return solution.R_nb[0] if solution.solved[0] else None


def _first(now: Measurements, set_up: StreamSetUp) -> tuple[FloatArray, FloatArray]:
    """Return where the first keyframe's search starts."""
    R_nb = now.R_nb if now.R_nb is not None else _attitude(now)
    if R_nb is None:
        raise BadInputError("first measurements R_nb: needed where no array has an attitude")
    if now.position is None:
        raise BadInputError("first measurements position: needed to start from")
    return R_nb, now.position.value - R_nb @ _arm_b_m(now, set_up)


def _arm_b_m(now: Measurements, set_up: StreamSetUp) -> FloatArray:
    """Return the way from the accelerometer to the antenna of positions, (3,)."""
    return set_up.antenna_b_m - now.imu.position_b_m


def _series(measured: Measured | None, n: int, arm_b_m: FloatArray) -> VectorSeries | None:
    """Return a measurement in the last of n rows."""
    if measured is None:
        return None
    value = np.full((n, 3), np.nan)
    value[-1] = measured.value
    return VectorSeries(
        value=value, covariance=np.tile(measured.covariance, (n, 1, 1)), arm_b_m=arm_b_m
    )


def _directions(what: str, direction: Direction | None, n: int) -> Directions | None:
    """Return a direction in the last of n rows."""
    if direction is None:
        return None
    one = Directions.of(what, direction.e_b[None], direction.covariance[None])
    return one.scatter(np.array([n - 1]), n)
