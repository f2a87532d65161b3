"""A sensor behind a low pass, one that drifts, tags that step: the likely fault wins."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from fgnav.frontend.problem import build_problem
from fgnav.identification.spans.errors import DRIFT
from fgnav.identification.tag_steps import tag_step
from fgnav.methods.smoother import Smoother
from tests.identification.identified import SETTINGS, estimate_by, found_in
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.dirty import dirty
from tests.robustness.drawn.flights import KINDS, right_flight

RATES = (("fixes", 0.16, 0.0061), ("instruments", 0.083, 0.0032), ("raw", 0.16, 0.0021))


def of_seed(seed):
    right = right_flight(KINDS[seed // 12 % len(KINDS)], seed // 12)
    return right, dirty(right, seed)[0]


def late_s(found, sensor="accelerometer"):
    """Return by how much a sensor is late."""
    assert found.cause.is_likely
    assert found.cause.error.kind == f"late {sensor}"
    return found.cause.error.off[0]


def behind_a_low_pass(flight, time_s, samples="f_b_mps2"):
    imu = flight.imu
    x = getattr(imu, samples)
    keep = np.exp(-np.median(np.diff(imu.t_s)) / time_s)
    late, _ = lfilter([1 - keep], [1, -keep], x, axis=0, zi=keep * x[:1])
    return replace(flight, imu=replace(imu, **{samples: late}))


def test_forces_behind_a_low_pass_are_taken_as_early_as_they_are_late():
    """Else clock and velocities were off, the magnetometer was left out, or nothing was said."""
    _, flight = of_seed(99200249)
    found = found_in(flight)
    interval_s = np.median(np.diff(flight.imu.t_s))
    delay_s = interval_s / np.expm1(interval_s / 0.037)  # of the filter at low frequencies
    assert abs(late_s(found) - delay_s) < 4 * 0.0027  # its sigma, as of late velocities
    assert not found.moved.any()
    assert found.calibration == ()
    assert any("forces are late" in note for note in found.notes)
    assert not estimate_by(found, flight).rejections


def test_attitudes_with_forces_behind_a_low_pass_are_as_honest_as_without_it():
    """Of the first flights with a gyroscope and instruments: 28.7 and 94.9 as stated."""
    squares = []
    for number in (8300002, 8300007):
        right = right_flight("instruments", number)
        estimate = Smoother()(behind_a_low_pass(right, 0.037))
        squares.append(nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2))
    assert np.mean(squares) < 5.0  # 4.1; without the low pass 4.2


@pytest.mark.parametrize(("kind", "time_s", "sigma_s"), RATES)
def test_rates_behind_a_low_pass_are_taken_as_early_as_they_are_late(kind, time_s, sigma_s):
    """Else axes were turned, NEES 21.6, or the flight was refused."""
    right = right_flight(kind, 947300000)
    flight = behind_a_low_pass(right, time_s, "w_b_radps")
    found = found_in(flight)
    assert abs(late_s(found, "gyroscope") - 0.02 / np.expm1(0.02 / time_s)) < 4 * sigma_s
    assert not found.moved.any()
    assert any("rates are late" in note for note in found.notes)
    estimate = estimate_by(found, flight)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 5.0


@pytest.mark.parametrize(("seed", "is_steady"), [(99200420, False), (99200427, True)])
def test_a_drift_of_the_accelerometer_is_no_noise(seed, is_steady):
    """Of .9 and 10 m/s2 in 12 s: a search begun from loud noise ended at loud noise."""
    right, flight = of_seed(seed)
    found = found_in(flight)
    assert set(found.factors) == (set() if is_steady else {"accelerometer bias"})  # a walk
    likely = [one for one in found.faults if one.is_likely]
    assert [(one.sensor, one.shape) for one in likely] == [("accelerometer", DRIFT)] * is_steady
    for one in likely:
        rates = (flight.imu.f_b_mps2 - right.imu.f_b_mps2)[-1] / np.ptp(flight.imu.t_s)
        np.testing.assert_allclose(one.value, rates, atol=0.04)
    estimate = estimate_by(found, flight)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 5.0  # 3.1 and 2.6


def test_tags_that_step_are_put_back():
    right, flight = of_seed(99200524)
    step = tag_step(flight, SETTINGS, build_problem)
    assert step is not None
    np.testing.assert_allclose(step.undone(flight).imu.t_s, right.imu.t_s, atol=1e-9)


def test_neither_a_right_record_nor_lost_samples_are_a_step():
    right = right_flight("array", 99200524 // 12)
    t_s = right.imu.t_s
    lost = replace(right, imu=right.imu[~((t_s > 5.9) & (t_s < 6.1))])
    for flight in (right, lost):
        assert tag_step(flight, SETTINGS, build_problem) is None


def test_phases_tell_a_low_pass_to_a_millisecond():
    """Doppler told one of .13 s to 20 ms, and the clock had the rest: attitude NEES 42, now 7.2."""
    right = right_flight("raw", 97002)
    found = found_in(behind_a_low_pass(right, 0.06))
    delay_s = 0.02 / np.expm1(0.02 / 0.06)
    assert abs(late_s(found) - delay_s) < 4 * 0.0014  # its sigma
    assert not found.moved.any()


def test_forces_of_an_accelerometer_alone_are_late_and_its_clock_is_right():
    """An array: the clock had it; NEES 7.5 and 26 (951000005, 930000420)."""
    right = right_flight("array", 97003)
    found = found_in(behind_a_low_pass(right, 0.07))
    assert abs(late_s(found) - 0.02 / np.expm1(0.02 / 0.07)) < 4 * 0.0005  # its sigma
    assert not found.moved.any()
    assert not found.factors


def test_of_an_accelerometer_alone_a_short_delay_is_as_well_a_clock():
    """Of 3.9 ms nothing was said: NEES 18 (951000007)."""
    found = found_in(behind_a_low_pass(right_flight("array", 97003), 0.011))
    assert found.cause.is_likely
    assert abs(found.cause.moved[0] + 0.02 / np.expm1(0.02 / 0.011)) < 4 * 0.0005  # its sigma


def test_a_delay_that_is_hardly_likely_is_in_the_sigmas():
    """Of 21 ms beside fixes eight nats are left: NEES 22 unnoticed (930000502)."""
    found = found_in(behind_a_low_pass(right_flight("fixes", 77500041), 0.021))
    assert found.cause is not None
    assert not found.cause.is_likely
    in_the_mean = found.cause.doubt.covariance_rad2.mean(axis=0)
    assert np.linalg.eigvalsh(in_the_mean).max() > np.radians(0.2) ** 2
