"""Usual noise of sensors, where a flight states none: what identification starts from.

Data sheets of small units (TDK ICM-42688-P and MPU-6050, Bosch BMI160 and BMI270) state 7e-4 to
4e-3 m/s2/sqrt(Hz) and 5e-5 to 1e-4 rad/s/sqrt(Hz); in motion, with vibration, small units have ten
times that and more. Biases and walks: consumer grade of Groves, 2nd edition, 2013, table 4.1 and
section 4.4.1.
"""

from dataclasses import replace
from typing import Any

from fgnav.types.flight import GnssNoise

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


def imu_noise(stated: dict[str, float | None], *, gyroscope: bool) -> dict[str, Any]:
    """Return a unit's noise, the usual in the place of what is not stated; ``unstated`` with it.

    Parameters
    ----------
    stated : dict
        By the names of ``Imu``; None of what is not stated.
    gyroscope : bool
        Whether the unit has one.
    """
    filled: dict[str, Any] = {}
    for name, value in stated.items():
        none = name.startswith("gyroscope") and not gyroscope
        filled[name] = IMU[name] if value is None and not none else value
    missing = [name for name, value in stated.items() if value is None and filled[name] is not None]
    return filled | {"unstated": tuple(missing)}


def gnss_noise(stated: dict[str, float | None]) -> GnssNoise:
    """Return noise of links, the usual in the place of what is not stated.

    Parameters
    ----------
    stated : dict
        By the names of ``GnssNoise``.
    """
    given = {name: value for name, value in stated.items() if value is not None}
    unstated = tuple(name for name in stated if name not in given)
    usual: dict[str, Any] = {**given, "unstated": unstated}
    return replace(GnssNoise(), **usual)
