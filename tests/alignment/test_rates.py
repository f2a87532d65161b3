"""Body rates before smoothing: the gyroscope's, or from attitudes."""

import dataclasses

import numpy as np
import pytest

from fgnav.alignment.rates import angular_rates, rough_rates, swing_n_mps
from fgnav.attitude.imu_rotation import imu_rotation
from fgnav.geometry import rotations
from tests.alignment.test_gaps import record

T_S = np.arange(0, 9, 0.1)
TURNING = np.array([[0.3, -0.2, 0.1]])
R_NB = rotations.exp(T_S[:, None] * TURNING)


def test_attitudes_of_an_even_turn_tell_its_rate():
    rates = rough_rates(record(), T_S, R_NB)
    np.testing.assert_allclose(rates, np.tile(TURNING, (len(T_S), 1)), atol=1e-9)


def test_a_gyroscope_is_taken_rather_than_attitudes():
    rates = rough_rates(record(gyro=True), T_S, R_NB)
    np.testing.assert_allclose(rates[:, 0], np.sin(T_S) / 10, atol=1e-9)


def test_rates_are_those_between_attitudes_half_a_second_apart_at_most():
    """Ten a second: four tenths apart, so that their white noise is a quarter of neighbours'."""
    rng, sigma_rad = np.random.default_rng(0), 0.005
    noisy = R_NB @ rotations.exp(sigma_rad * rng.standard_normal((len(T_S), 3)))
    error = angular_rates(T_S, noisy) - TURNING
    expected = np.sqrt(2) * sigma_rad / 0.4
    assert np.sqrt((error[5:-5] ** 2).mean()) == pytest.approx(expected, rel=0.15)


def test_attitudes_further_apart_than_that_tell_rates_by_their_neighbours():
    t_s = np.arange(0.0, 9.0, 1.0)
    R_nb = rotations.exp(t_s[:, None] * TURNING)
    np.testing.assert_allclose(angular_rates(t_s, R_nb), np.tile(TURNING, (9, 1)), atol=1e-9)


def test_one_attitude_tells_no_rate():
    assert not angular_rates(np.zeros(1), np.eye(3)[None]).any()


def test_a_spin_of_more_than_half_a_turn_between_attitudes_is_known_from_its_gyroscope():
    """Six turns a second at ten attitudes a second: what is known of it is taken out first."""
    spin = np.array([2 * np.pi * 6, 0.0, 0.0])
    t_s = np.arange(0, 3, 0.1)
    imu = record(np.arange(0, 3, 0.002), gyro=True)
    imu = dataclasses.replace(imu, w_b_radps=np.tile(spin, (len(imu.t_s), 1)))
    rotation = imu_rotation(imu)
    R_nb = rotations.exp(t_s[:, None] * spin)
    without = record(np.arange(0, 3, 0.002))
    rates = rough_rates(without, t_s, R_nb, rotation)
    np.testing.assert_allclose(rates, np.tile(spin, (len(t_s), 1)), rtol=0, atol=1e-3)
    assert np.abs(rough_rates(without, t_s, R_nb) - spin).max() > 1.0


def test_a_point_beside_the_accelerometer_swings_about_it():
    """Nose ahead of it, turning right: the nose moves right, which is east of a northbound body."""
    R_nb = np.eye(3)[None]
    swing = swing_n_mps(R_nb, np.array([[0.0, 0.0, 0.5]]), np.array([2.0, 0.0, 0.0]))
    np.testing.assert_allclose(swing, [[0.0, 1.0, 0.0]], rtol=0, atol=1e-12)
