"""A keyframe of a stream as a smoothing problem of two rows: the first is there for its time."""

from itertools import chain

import numpy as np

from fgnav.assembly.calibration_request import (
    calibration_requests,
    mean_rate,
    with_landmark,
)
from fgnav.assembly.position.series import VectorSeries
from fgnav.assembly.sensors.gnss import array_sensors, positions, velocities
from fgnav.assembly.sensors.instruments import gravity_sensor, line_of_sight
from fgnav.assembly.sensors.surroundings import field_sensor, height_sensor
from fgnav.attitude.array import maximum_likelihood
from fgnav.checks import BadInputError, FloatArray
from fgnav.graph.factors.directions import Directions
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.parameters import Parameter, Parameters
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.sensor import Sensor
from fgnav.graph.types.states import States
from fgnav.methods.streaming.measurements import Direction, Measured, Measurements, StreamConfig

_BEFORE_S = 0.1  # of the first keyframe: an interval that nothing uses


def keyframe_problem(
    now: Measurements, config: StreamConfig, before_s: float, p_n_m: FloatArray | None
) -> Problem:
    """Return a keyframe as the second of two rows.

    The first stands for the keyframe before: its time, and where the accelerometer was, (3,); None
    before any.

    Raises
    ------
    BadInputError
        If the first has nothing to start from, or a body without a gyroscope no rate prior.
    """
    if p_n_m is None:
        R_nb, p_n_m, has_attitude, before_s = *_first(now, config), True, now.t_s - _BEFORE_S
    else:
        attitude = _attitude(now)
        R_nb, has_attitude = np.eye(3) if attitude is None else attitude, attitude is not None
    t_s = np.array([before_s, now.t_s])
    n, has_gyroscope = len(t_s), now.imu.w_b_radps is not None
    gravity_n_mps2 = np.tile(config.origin.gravity_n_mps2(p_n_m[None]), (n, 1))
    sensors, of_instruments = _sensors(now, config, t_s, p_n_m)
    constants = _constants(config, of_instruments, gyroscope=has_gyroscope)
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
        motion=_motion(now, config, t_s, gravity_n_mps2, constants),
        sensors=tuple(sensor.bound(constants) for sensor in sensors),
        constants=constants,
        attitude_known=np.full(n, has_attitude),
    )


def _sensors(
    now: Measurements, config: StreamConfig, t_s: FloatArray, p_n_m: FloatArray
) -> tuple[tuple[Sensor, ...], tuple[Parameter, ...]]:
    """Build the sensors of the last row, and the constants of instruments."""
    n, row, rates = len(t_s), np.array([len(t_s) - 1]), None
    sensors: list[Sensor] = []
    if now.array is not None:
        every, none = now.array[np.zeros(n, dtype=np.int64)], np.full(n, -1, dtype=np.int64)
        sensors += array_sensors(every, None, np.arange(n) == n - 1, none, (None, False))
    if now.imu.w_b_radps is not None:
        newest = [np.interp(now.t_s, now.imu.t_s, column) for column in now.imu.w_b_radps.T]
        rates = np.tile(newest, (n, 1))
    arm_b_m = _arm_b_m(now, config)
    sensors += positions(_series(now.position, n, arm_b_m))
    earth = config.origin.earth_rate_n_radps
    sensors += velocities(_series(now.velocity, n, arm_b_m), rates, earth)
    if now.gravity is not None:
        down_n_mps2 = np.tile(config.origin.gravity_n_mps2(p_n_m[None]), (n, 1))
        sensors.append(gravity_sensor(_directions("gravity", now.gravity, n), down_n_mps2))
    if now.sight is not None:
        sensors.append(line_of_sight(_directions("line of sight", now.sight, n)))
    constants: list[Parameter] = []
    if config.barometer is not None:
        height_m = np.full(n, np.nan)
        height_m[row] = np.nan if now.height_m is None else now.height_m
        of = config.barometer, now.imu.position_b_m, config.origin
        height, offset = height_sensor(*of, t_s, np.tile(p_n_m, (n, 1)), height_m)
        sensors.append(height)
        constants.append(offset)
    if config.magnetometer is not None:
        field_b_ut = np.full((n, 3), np.nan)
        field_b_ut[row] = np.nan if now.field_b_ut is None else now.field_b_ut
        field, iron = field_sensor(config.magnetometer, field_b_ut)
        sensors.append(field)
        constants.append(iron)
    return tuple(sensor for sensor in sensors if len(sensor.row)), tuple(constants)


def _constants(
    config: StreamConfig, of_instruments: tuple[Parameter, ...], *, gyroscope: bool
) -> Parameters:
    requested = [request.parameters() for request in calibration_requests(config.calibrate)]
    parts = with_landmark(tuple(chain.from_iterable(requested)), config.landmark_n_m)
    parts = (*parts, *of_instruments)
    return Parameters(parts if gyroscope else (*parts, mean_rate()))


def _motion(
    now: Measurements,
    config: StreamConfig,
    t_s: FloatArray,
    gravity_n_mps2: FloatArray,
    constants: Parameters,
) -> Motion:
    """Return the motion to the keyframe from the one before."""
    n, earth = len(t_s) - 1, config.origin.earth_rate_n_radps
    noise = np.full(n, now.imu.accelerometer_noise_mps2_per_sqrt_hz**2)
    if now.imu.gyroscope_noise_radps_per_sqrt_hz is not None:
        return Inertial(
            t_s=t_s,
            imu=now.imu,
            sub_steps=config.sub_steps,
            gravity_n_mps2=gravity_n_mps2,
            earth_rate_n_radps=earth,
            accelerometer_noise=noise,
            gyroscope_noise=np.full(n, now.imu.gyroscope_noise_radps_per_sqrt_hz**2),
        )
    if config.rate_prior is None:
        raise BadInputError("stream set-up rate_prior: needed without a gyroscope")
    return GyroFree(
        t_s=t_s,
        imu=now.imu,
        sub_steps=config.sub_steps,
        gravity_n_mps2=gravity_n_mps2,
        earth_rate_n_radps=earth,
        poles_per_s=np.tile(config.rate_prior.poles_per_s, (n, 1, 1)),
        variance_rad2ps2=np.tile(config.rate_prior.variance_rad2ps2, (n, 1)),
        accelerometer_noise=noise,
        constants=constants,
    )


def _attitude(now: Measurements) -> FloatArray | None:
    """Return the array's own attitude, (3, 3)."""
    if now.array is None:
        return None
    solution = maximum_likelihood(now.array)
    return solution.R_nb[0] if solution.solved[0] else None


def _first(now: Measurements, config: StreamConfig) -> tuple[FloatArray, FloatArray]:
    """Return where the first keyframe's search starts."""
    R_nb = now.R_nb if now.R_nb is not None else _attitude(now)
    if R_nb is None:
        raise BadInputError("first measurements R_nb: needed where no array has an attitude")
    if now.position is None:
        raise BadInputError("first measurements position: needed to start from")
    return R_nb, now.position.value - R_nb @ _arm_b_m(now, config)


def _arm_b_m(now: Measurements, config: StreamConfig) -> FloatArray:
    """Return the way from the accelerometer to the antenna of positions, (3,)."""
    return config.antenna_b_m - now.imu.position_b_m


def _series(measured: Measured | None, n: int, arm_b_m: FloatArray) -> tuple[VectorSeries, ...]:
    """Return a measurement in the last of n rows, if there is one."""
    if measured is None:
        return ()
    value = np.full((n, 3), np.nan)
    value[-1] = measured.value
    covariance = np.tile(measured.covariance, (n, 1, 1))
    return (VectorSeries(value=value, covariance=covariance, arm_b_m=arm_b_m),)


def _directions(what: str, direction: Direction, n: int) -> Directions:
    """Return a direction in the last of n rows."""
    directions = Directions.of(what, direction.e_b[None], direction.covariance[None])
    return directions.scatter(np.array([n - 1]), n)
