"""Accelerometer and gyroscope: the true point values, bias with its walk, white noise."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.flight import Imu
from fgnav_sim.scenario import ImuTable, Scenario

_BLOCK = 50_000  # samples whose motion is held in memory at a time


def sense(sensor: ImuTable, scenario: Scenario, *, rng: np.random.Generator) -> Imu:
    """Return what an inertial unit measures: point values at its sample times.

    The gyroscope draws from a generator of its own, so that the accelerometer's noise does not
    depend on whether there is one.
    """
    t_s, origin = scenario.epochs_s(sensor.rate_hz), scenario.origin.frame
    accelerometer_rng, gyroscope_rng = rng.spawn(2)
    lever_b_m = np.array(sensor.position_b_m)
    f_b_mps2, w_b_radps = np.empty((len(t_s), 3)), np.empty((len(t_s), 3))
    for first in range(0, len(t_s), _BLOCK):
        block = slice(first, first + _BLOCK)
        state = scenario.motion(t_s[block])
        f_b_mps2[block] = state.specific_force_b_mps2(origin, lever_b_m, scenario.gravity)
        w_b_radps[block] = state.inertial_rate_b_radps(origin)
    f_b_mps2 += _error(
        len(t_s),
        sensor.rate_hz,
        sensor.accelerometer_bias_mps2,
        sensor.accelerometer_bias_walk_mps2_per_sqrt_s,
        sensor.accelerometer_noise_mps2_per_sqrt_hz,
        rng=accelerometer_rng,
    )
    bias = sensor.gyroscope_bias_radps
    walk = sensor.gyroscope_bias_walk_radps_per_sqrt_s
    density = sensor.gyroscope_noise_radps_per_sqrt_hz
    has_gyroscope = not (bias is None or walk is None or density is None)
    if not (bias is None or walk is None or density is None):
        w_b_radps += _error(len(t_s), sensor.rate_hz, bias, walk, density, rng=gyroscope_rng)
    return Imu(
        t_s=t_s,
        f_b_mps2=f_b_mps2,
        w_b_radps=w_b_radps if has_gyroscope else None,
        position_b_m=lever_b_m,
        accelerometer_noise_mps2_per_sqrt_hz=sensor.accelerometer_noise_mps2_per_sqrt_hz,
        accelerometer_bias_mps2=sensor.accelerometer_bias_mps2,
        accelerometer_bias_walk_mps2_per_sqrt_s=sensor.accelerometer_bias_walk_mps2_per_sqrt_s,
        gyroscope_noise_radps_per_sqrt_hz=density,
        gyroscope_bias_radps=bias,
        gyroscope_bias_walk_radps_per_sqrt_s=walk,
    )


def _error(
    k: int, rate_hz: float, bias: float, walk: float, density: float, *, rng: np.random.Generator
) -> FloatArray:
    """Return bias, its random walk and white noise of ``k`` samples, (k, 3)."""
    constant = bias * rng.standard_normal(3)
    steps = walk / np.sqrt(rate_hz) * rng.standard_normal((k, 3))
    steps[0] = 0.0
    white = density * np.sqrt(rate_hz) * rng.standard_normal((k, 3))
    return np.asarray(constant + np.cumsum(steps, axis=0) + white)
