"""Seconds at rest, in which noises of the inertial unit and of fixes are other ones than in motion.

Vibration is noise of an inertial unit, and a receiver that filters its solution errs less at rest.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fgnav.assembly.position.antenna_motion import AntennaMotion
from fgnav.assembly.position.series import VectorSeries
from fgnav.assembly.sensors.standstill import Standing
from fgnav.checks import FloatArray
from fgnav.graph.types.motion import Motion
from fgnav.types.flight import Imu


def moving_antenna(
    antenna: AntennaMotion, t_s: FloatArray, stands: Standing, factors: Mapping[str, float]
) -> AntennaMotion:
    """Return positions and velocities at keyframes, (n,), with other noise at rest."""
    if not factors:
        return antenna
    at_rest = stands.contains(t_s)

    def scaled(series: VectorSeries, name: str) -> VectorSeries:
        factor = np.where(at_rest, factors.get(name, 1.0), 1.0)
        return replace(series, covariance=series.covariance * factor[:, None, None] ** 2)

    return replace(
        antenna,
        positions=tuple(scaled(series, "position") for series in antenna.positions),
        velocities=tuple(scaled(series, "velocity") for series in antenna.velocities),
    )


def resting_motion(
    motion: Motion, imu: Imu, stands: Standing, factors: Mapping[str, float]
) -> Motion:
    """Return a motion with other white noise of its unit at rest."""
    if not factors:
        return motion
    share = stands.share(motion.t_s)

    def more(name: str, density: float) -> FloatArray:
        factor = factors.get(name, 1.0)
        return np.asarray(share * (factor**2 - 1.0) * density**2)

    return motion.with_added_noise(
        more("accelerometer", imu.accelerometer_noise_mps2_per_sqrt_hz),
        more("gyroscope", imu.gyroscope_noise_radps_per_sqrt_hz or 0.0),
    )
