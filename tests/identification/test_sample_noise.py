"""A unit that is louder than stated for some seconds: by its own samples, and the flight's."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.methods.smoother import Smoother
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.flights import right_flight

FROM_S, UNTIL_S, SIZE_MPS2 = 5.7, 8.9, 0.5
NOTE = "samples are louder than its noise from"


@pytest.fixture(scope="module")
def right():
    return right_flight("fixes", 957_100_000)


def with_noise(flight):
    imu, rng = flight.imu, np.random.default_rng(957_100_001)
    inside = (imu.t_s >= FROM_S) & (imu.t_s < UNTIL_S)
    noise = inside[:, None] * SIZE_MPS2 * rng.normal(size=imu.f_b_mps2.shape)
    return replace(flight, imu=replace(imu, f_b_mps2=imu.f_b_mps2 + noise))


def density(flight):
    """Return times amid intervals, and the density of the specific force's noise, (n - 1,)."""
    motion = Smoother().prepare(flight).problem.motion
    return (motion.t_s[1:] + motion.t_s[:-1]) / 2, motion.accelerometer_noise


def test_noise_is_that_of_the_samples_where_these_are_with_noise(right):
    t_s, found = density(with_noise(right))
    inside = (t_s > FROM_S + 0.5) & (t_s < UNTIL_S - 0.5)
    white = SIZE_MPS2**2 * np.median(np.diff(right.imu.t_s))
    assert 0.5 < np.median(found[inside]) / white < 2.5  # the loudest of three half seconds
    outside = (t_s < FROM_S - 1.0) | (t_s > UNTIL_S + 1.0)
    stated = right.imu.accelerometer_noise_mps2_per_sqrt_hz**2
    np.testing.assert_allclose(found[outside], stated)


def test_a_gyroscope_that_is_louder_all_along_is_as_loud_as_may_be():
    """Its fixes do not tell: by another draw attitude NEES was 36.6 and nothing was said."""
    flight, rng = right_flight("fixes", 8501), np.random.default_rng(957_100_002)
    w_b_radps = flight.imu.w_b_radps + 0.03 * rng.normal(size=flight.imu.w_b_radps.shape)
    noisy = replace(flight, imu=replace(flight.imu, w_b_radps=w_b_radps))
    prepared = Smoother().prepare(noisy)
    factor = np.sqrt(prepared.problem.motion.gyroscope_noise)
    factor /= flight.imu.gyroscope_noise_radps_per_sqrt_hz
    assert np.ptp(factor) < 1e-9
    assert 1.5 < factor[0] < 4.4  # if all of it is white 4.4
    assert any(NOTE in note for note in prepared.notes)


def test_a_right_flight_is_as_loud_as_stated_and_nothing_is_said(right):
    stated = right.imu.accelerometer_noise_mps2_per_sqrt_hz**2
    np.testing.assert_allclose(density(right)[1], stated)
    assert not any(NOTE in note for note in Smoother().prepare(right).notes)


def test_attitudes_beside_a_louder_second_are_honest():
    """As stated, or as loud all along as the flight shows: 20.6 of 3."""
    squares = []
    for number in (8303, 8305, 8307):
        flight = right_flight("fixes", number)
        estimate = Smoother()(with_noise(flight))
        assert any(NOTE in note for note in estimate.notes)
        squares.append(nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2))
    assert np.mean(squares) < 5.0
