"""Accelerometer and gyroscope: the true point values, and the errors of real triads."""

from typing import Any

import numpy as np

from fgnav.checks import FloatArray, Unused
from fgnav.types.flight import Imu
from fgnav.types.instruments import USUAL_IMU_NOISE
from fgnav_sim.gauss_markov import flicker
from fgnav_sim.scenario import ImuTable, Scenario

_BLOCK = 50_000  # samples whose motion is held in memory at a time


def sense(sensor: ImuTable, scenario: Scenario, *, rng: np.random.Generator) -> Imu:
    """Return the samples of an IMU: point values at its sample times.

    The gyroscope draws from a generator of its own, so that the accelerometer's noise does not
    depend on whether there is one. Estimators are told white noise, bias and walk, no more.
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
    measured_b_radps = None
    if sensor.gyroscope_noise_radps_per_sqrt_hz is not None:
        measured_b_radps = _measured(sensor, "gyroscope", "radps", w_b_radps, rng=gyroscope_rng)
    return Imu(
        t_s=t_s,
        f_b_mps2=_measured(sensor, "accelerometer", "mps2", f_b_mps2, rng=accelerometer_rng),
        w_b_radps=measured_b_radps,
        position_b_m=lever_b_m,
        **{name: getattr(sensor, name) for name in USUAL_IMU_NOISE},
    )


def saturated(sensor: ImuTable, imu: Imu) -> tuple[Unused, ...]:
    """Count the samples of each triad that were cut at the end of its range."""
    ranges = (
        ("accelerometer", imu.f_b_mps2, sensor.accelerometer_range_mps2, "m/s2"),
        ("gyroscope", imu.w_b_radps, sensor.gyroscope_range_radps, "rad/s"),
    )
    unused = []
    for name, values, limit, unit in ranges:
        if values is not None and limit is not None:
            cut = int((np.abs(values) >= limit).any(axis=1).sum())
            reason = f"saturated at {limit:g} {unit}"
            unused.append(Unused(what=f"{name} sample", reason=reason, count=cut))
    return tuple(loss for loss in unused if loss.count)


def _measured(
    sensor: ImuTable, name: str, unit: str, true: FloatArray, *, rng: np.random.Generator
) -> FloatArray:
    """Return samples of an accelerometer (mps2) or gyroscope (radps) of true values, (k, 3).

    Three sensors that ought to be alike and at right angles.
    """

    def figure(key: str) -> Any:  # noqa: ANN401  # by name
        return getattr(sensor, f"{name}_{key}")

    rate_hz, scale, misalignment_rad = sensor.rate_hz, figure("scale"), figure("misalignment_rad")
    instability, limit = figure(f"bias_instability_{unit}"), figure(f"range_{unit}")
    matrix_rng, flicker_rng = rng.spawn(2)
    constant = figure(f"bias_{unit}") * rng.standard_normal(3)
    walk = figure(f"bias_walk_{unit}_per_sqrt_s")
    steps = walk / np.sqrt(rate_hz) * rng.standard_normal(true.shape)
    steps[0] = 0.0
    density = figure(f"noise_{unit}_per_sqrt_hz")
    white = density * np.sqrt(rate_hz) * rng.standard_normal(true.shape)
    measured = true
    if scale or misalignment_rad:
        lean = misalignment_rad * matrix_rng.standard_normal((3, 3))
        gain = 1 + scale * matrix_rng.standard_normal(3)
        measured = true @ np.where(np.eye(3, dtype=bool), gain, lean).T
    measured = measured + (constant + np.cumsum(steps, axis=0) + white)
    if instability:
        measured += flicker(instability, 1 / rate_hz, true.shape, rng=flicker_rng)
    limit = np.inf if limit is None else limit
    return np.asarray(np.clip(measured, -limit, limit))
