"""Usual noise of sensors, where a flight states none: what identification starts from.

Data sheets of small units (TDK ICM-42688-P and MPU-6050, Bosch BMI160 and BMI270) state 7e-4 to
4e-3 m/s2/sqrt(Hz) and 5e-5 to 1e-4 rad/s/sqrt(Hz); in motion, with vibration, small units have ten
times that and more. Biases and walks: consumer grade of Groves, 2nd edition, 2013, table 4.1 and
section 4.4.1.
"""

from collections.abc import Mapping
from typing import Any

IMU = {
    "accelerometer_noise_mps2_per_sqrt_hz": 1e-2,
    "accelerometer_bias_mps2": 0.3,
    "accelerometer_bias_walk_mps2_per_sqrt_s": 1e-3,
    "gyroscope_noise_radps_per_sqrt_hz": 5e-4,
    "gyroscope_bias_radps": 0.02,
    "gyroscope_bias_walk_radps_per_sqrt_s": 2e-5,
}
# What a receiver's own solution is good for where the file does not say: a single-frequency code
# solution under open sky.
POSITION_SIGMA_M = (3.0, 3.0, 5.0)
VELOCITY_SIGMA_MPS = (0.1, 0.1, 0.1)
# Fixed integers: data sheet of the u-blox ZED-F9P, .01 m, and .4 deg of a heading along 1 m.
BASELINE_SIGMA_M = (0.01, 0.01, 0.02)


def filled(stated: Mapping[str, float | None], usual: Mapping[str, float]) -> dict[str, Any]:
    """Return noise by name, the usual in the place of what is not stated; ``unstated`` with it."""
    values = {name: usual[name] if x is None else x for name, x in stated.items()}
    return values | {"unstated": tuple(name for name, x in stated.items() if x is None)}


def imu_noise(keys: object, *, gyroscope: bool) -> dict[str, Any]:
    """Return a unit's noise of keys with its names, without a gyroscope none of one."""
    stated = {name: getattr(keys, name) for name in IMU}
    none = {n: None for n, x in stated.items() if x is None and n.startswith("gyroscope")}
    absent = {} if gyroscope else none
    return filled({n: x for n, x in stated.items() if n not in absent}, IMU) | absent
