import numpy as np
import pytest

from fgnav.integrity.imu_recording import between_fresh, is_repeated, with_noise_of_record
from tests.imu import imu_of

RATE_HZ, NOISE = 50.0, 2e-3
T_S = np.arange(0, 60, 1 / RATE_HZ)
SIGMA = NOISE * np.sqrt(RATE_HZ)  # of a sample
HOLD = np.arange(len(T_S)) // 4 * 4
SWING = np.sin(3 * T_S)[:, None] * [3.0, 1.0, 0.5]


@pytest.fixture
def white():
    return np.random.default_rng(33_000).normal(scale=SIGMA, size=(len(T_S), 3))


def _imu(f_b_mps2):
    return imu_of(T_S, f_b_mps2, accelerometer=(NOISE, 3e-2, 1e-4))


def _density(f_b_mps2):
    """Return the density that a record of specific force has, and what is said of it."""
    imu, notes = with_noise_of_record(_imu(f_b_mps2))
    return imu.accelerometer_noise_mps2_per_sqrt_hz, notes


def test_held_white_noise_is_as_loud_for_longer(white):
    found, (note,) = _density(white[HOLD])
    np.testing.assert_allclose(found, NOISE * np.sqrt(4), rtol=0.005)
    assert "samples are held for 0.08 s" in note
    means = white[HOLD][: len(T_S) // 200 * 200].reshape(-1, 200, 3).mean(axis=1)  # of 4 s
    np.testing.assert_allclose(means.std() * np.sqrt(4.0), found, rtol=0.25)


def test_a_cubic_between_held_samples_errs_as_stated():
    every = np.arange(len(T_S)) // 10 * 10
    held = SWING[every]
    mended = between_fresh(_imu(held), "f_b_mps2", is_repeated(held))
    off = mended.f_b_mps2[50:-50] - SWING[: len(mended.t_s)][50:-50]
    found, _ = _density(held)
    of_cubic = np.sqrt((found**2 / 0.2) - NOISE**2 * RATE_HZ)
    worst = np.sqrt((off**2).mean(axis=0)).max()
    assert worst < of_cubic < 4 * worst


def test_rounding_adds_a_twelfth_of_the_square_of_a_step(white):
    step = 0.2  # of a motion that changes it from sample to sample
    quick = np.round((white + 300 * SWING) / step) * step
    found, (note,) = _density(quick)
    changes = np.count_nonzero(np.diff(quick, axis=0), axis=0).min() / len(T_S)
    assert changes > 0.9
    np.testing.assert_allclose(found**2, NOISE**2 + step**2 / 12 / RATE_HZ, rtol=0.1)
    assert "values are recorded in steps of 0.2" in note


def test_a_rounded_value_that_stays_errs_for_as_long():
    step = 0.5
    slow = np.round(np.sin(0.3 * T_S)[:, None] * [3.0, 1.0, 1.0] / step) * step
    found, _ = _density(slow)
    assert found**2 > NOISE**2 + 5 * step**2 / 12 / RATE_HZ


def test_a_record_of_noise_alone_is_as_it_is(white):
    imu = _imu(white + SWING)
    assert with_noise_of_record(imu) == (imu, ())
    assert _density(np.round((white + SWING) / SIGMA) * SIGMA) == (NOISE, ())  # finer than noise
