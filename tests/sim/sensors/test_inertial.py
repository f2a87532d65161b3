"""Noise of the inertial sensors has the size that the scenario states."""

import numpy as np
import pytest

from fgnav_sim.motion import Motion, Sine, Straight
from fgnav_sim.scenario import ImuTable, Scenario
from fgnav_sim.sensors.inertial import saturated, sense
from fgnav_sim.simulate import simulate
from tests.sim.statistics import allan_deviation

GYROSCOPE = {
    "gyroscope_noise_radps_per_sqrt_hz": 1e-4,
    "gyroscope_bias_radps": 1e-3,
    "gyroscope_bias_walk_radps_per_sqrt_s": 1e-5,
}
SWING = Motion(roll=Sine(amplitude_deg=20.0), pitch=Sine(amplitude_deg=20.0))


def truth(sensor, scenario):
    state = scenario.motion(scenario.epochs_s(sensor.rate_hz))
    lever_b_m = np.array(sensor.position_b_m)
    return state.specific_force_b_mps2(scenario.origin.frame, lever_b_m, scenario.gravity)


def test_biases_spread_by_their_sigma_and_walk_with_the_root_of_time():
    scenario = Scenario(duration_s=100.0, motion=SWING)
    sensor = ImuTable(
        rate_hz=10.0,
        accelerometer_noise_mps2_per_sqrt_hz=1e-9,
        accelerometer_bias_mps2=0.03,
        accelerometer_bias_walk_mps2_per_sqrt_s=1e-3,
    )
    expected = truth(sensor, scenario)
    errors = np.stack(
        [
            sense(sensor, scenario, rng=np.random.default_rng(k)).f_b_mps2 - expected
            for k in range(300)
        ]
    )
    assert np.std(errors[:, 0]) == pytest.approx(0.03, rel=0.08)
    assert np.std(errors[:, -1] - errors[:, 0]) == pytest.approx(1e-3 * np.sqrt(99.9), rel=0.08)


def test_a_gyroscope_measures_the_rate_against_inertial_space():
    scenario = Scenario(duration_s=100.0, motion=SWING)
    imu = sense(ImuTable(rate_hz=50.0, **GYROSCOPE), scenario, rng=np.random.default_rng(1))
    expected = scenario.motion(imu.t_s).inertial_rate_b_radps(scenario.origin.frame)
    error = imu.w_b_radps - expected
    assert np.abs(error.mean(axis=0)).max() < 4e-3  # 4 sigma of the bias
    assert np.std(error - error.mean(axis=0)) == pytest.approx(1e-4 * np.sqrt(50.0), rel=0.05)


def test_a_gyroscope_leaves_the_accelerometer_as_it_was():
    scenario = Scenario(duration_s=5.0, motion=SWING)
    alone = sense(ImuTable(), scenario, rng=np.random.default_rng(1))
    both = sense(ImuTable(**GYROSCOPE), scenario, rng=np.random.default_rng(1))
    assert alone.w_b_radps is None
    assert np.array_equal(alone.f_b_mps2, both.f_b_mps2)


def test_an_accelerometer_off_the_origin_feels_the_spin():
    spin = Motion(roll=Sine(amplitude_deg=90.0))
    scenario = Scenario(duration_s=10.0, motion=spin)
    off = ImuTable(position_b_m=(0.0, 0.5, 0.0))
    at_origin = sense(ImuTable(), scenario, rng=np.random.default_rng(1))
    beside = sense(off, scenario, rng=np.random.default_rng(1))
    w = scenario.motion(beside.t_s).inertial_rate_b_radps(scenario.origin.frame)
    pull = beside.f_b_mps2 - at_origin.f_b_mps2
    centripetal = -0.5 * (w[:, 0] ** 2 + w[:, 2] ** 2)
    assert np.allclose(
        pull[:, 1], centripetal, rtol=0, atol=2e-6
    )  # gravity's gradient is 3e-6 / s2


STILL = Scenario(duration_s=20_000.0, motion=Motion(path=Straight(speed_mps=0.0)))


def specified(averaging_s, density, instability, walk):
    """Return the Allan deviation of a specification: IEEE Std 952-1997, annex C."""
    return np.sqrt(
        density**2 / averaging_s
        + 2 * np.log(2) / np.pi * instability**2
        + walk**2 * averaging_s / 3
    )


def test_the_allan_deviations_of_both_triads_are_those_specified():
    figures = {"accelerometer": (2e-3, 2e-3, 2e-4), "gyroscope": (3e-4, 1e-4, 3e-5)}
    (white, instability, walk), (white_g, instability_g, walk_g) = figures.values()
    sensor = ImuTable(
        rate_hz=10.0,
        accelerometer_noise_mps2_per_sqrt_hz=white,
        accelerometer_bias_mps2=1e-9,
        accelerometer_bias_walk_mps2_per_sqrt_s=walk,
        accelerometer_bias_instability_mps2=instability,
        gyroscope_noise_radps_per_sqrt_hz=white_g,
        gyroscope_bias_radps=1e-9,
        gyroscope_bias_walk_radps_per_sqrt_s=walk_g,
        gyroscope_bias_instability_radps=instability_g,
    )
    imu = sense(sensor, STILL, rng=np.random.default_rng(1))
    for samples, figure in zip((imu.f_b_mps2, imu.w_b_radps), figures.values(), strict=True):
        for averaging_s in (1.0, 10.0, 100.0):
            expected = specified(averaging_s, *figure)
            assert allan_deviation(samples, 0.1, averaging_s) == pytest.approx(expected, rel=0.1)


def test_scale_and_misalignment_multiply_what_is_there():
    quiet = {
        "accelerometer_noise_mps2_per_sqrt_hz": 1e-12,
        "accelerometer_bias_mps2": 1e-12,
        "accelerometer_bias_walk_mps2_per_sqrt_s": 1e-12,
    }
    scenario = Scenario(duration_s=10.0, motion=SWING)
    sensor = ImuTable(**quiet, accelerometer_scale=2e-3, accelerometer_misalignment_rad=5e-4)
    expected = truth(sensor, scenario)
    matrices = []
    for seed in range(300):
        imu = sense(sensor, scenario, rng=np.random.default_rng(seed))
        matrix, residual, _, _ = np.linalg.lstsq(expected, imu.f_b_mps2 - expected, rcond=None)
        assert residual.max(initial=0.0) < 1e-12
        matrices.append(matrix.T)
    size = np.std(matrices, axis=0)
    own = np.eye(3, dtype=bool)
    assert size[own] == pytest.approx(2e-3, rel=0.15)
    assert size[~own] == pytest.approx(5e-4, rel=0.15)


def test_samples_beyond_the_range_are_cut_and_counted():
    sensor = ImuTable(accelerometer_range_mps2=9.0, gyroscope_range_radps=0.2, **GYROSCOPE)
    scenario = Scenario(duration_s=10.0, motion=SWING, imu=sensor)
    flight = simulate(scenario, np.random.default_rng(1))
    assert np.abs(flight.imu.f_b_mps2).max() == 9.0
    assert np.abs(flight.imu.w_b_radps).max() == 0.2
    free = Scenario(duration_s=10.0, motion=SWING, imu=ImuTable(**GYROSCOPE))
    uncut = simulate(free, np.random.default_rng(1)).imu
    assert np.array_equal(np.clip(uncut.f_b_mps2, -9.0, 9.0), flight.imu.f_b_mps2)
    unused = {loss.what: loss for loss in flight.unused}
    beyond = int((np.abs(uncut.f_b_mps2) >= 9.0).any(axis=1).sum())
    assert unused["accelerometer sample"].count == beyond > 0
    assert unused["accelerometer sample"].reason == "saturated at 9 m/s2"
    assert unused["gyroscope sample"].count > 0
    assert saturated(ImuTable(accelerometer_range_mps2=1e3), uncut) == ()
