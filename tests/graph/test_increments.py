"""Samples between keyframes: exact on cubics, as good as a spline on a spin, and causal."""

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry.cubic_spline import cubic_spline
from fgnav.graph.inertial.increments import increments
from tests.imu import imu_of


def _middles(t_s, steps):
    return np.concatenate(
        [
            t_s[k] + (np.arange(steps.first[k + 1] - steps.first[k]) + 0.5) * steps.step_s[k]
            for k in range(len(t_s) - 1)
        ]
    )


def _spin(t_s):
    angle = 4 * np.pi * t_s
    return 9.81 * np.stack([np.sin(angle), np.cos(angle), np.sin(angle + 1)], axis=1)


def test_specific_force_of_a_spin_at_two_hertz_is_right_to_a_ten_thousandth():
    samples_s, t_s = np.arange(401) / 100, np.arange(41) / 10
    steps = increments(imu_of(samples_s, _spin(samples_s)), t_s)
    middle_s = _middles(t_s, steps)
    error = np.abs(steps.f_b_mps2 - _spin(middle_s)).max()
    by_spline = np.abs(cubic_spline(samples_s, _spin(samples_s), middle_s) - _spin(middle_s)).max()
    assert error < by_spline + 1e-4


def test_cubics_are_met_exactly_between_samples_that_are_not_even():
    rng = np.random.default_rng(1)
    samples_s = np.arange(200) / 50 + rng.uniform(-3e-3, 3e-3, 200)
    t_s = samples_s[[0, 20, 27, 50, 130, 199]]  # one usable cubic from the start of the first on

    def cubic(x):
        return np.stack([x**3 - x, 2 * x**2 + 1, 3 - x], axis=1)

    steps = increments(imu_of(samples_s, cubic(samples_s), cubic(samples_s)), t_s, 2)
    middle_s = _middles(t_s, steps)
    np.testing.assert_allclose(steps.f_b_mps2, cubic(middle_s), rtol=0, atol=1e-9)
    assert steps.w_b_radps is not None
    np.testing.assert_allclose(steps.w_b_radps, cubic(middle_s), rtol=0, atol=1e-9)


def test_intervals_do_not_know_what_was_measured_after_them():
    rng = np.random.default_rng(2)
    samples_s = np.sort(rng.uniform(0, 5, 400))
    f, w = rng.standard_normal((2, 400, 3))
    t_s = np.linspace(0.03, 4.9, 40)
    whole = increments(imu_of(samples_s, f, w), t_s)
    for k in (1, 7, 30):
        early = samples_s <= t_s[k]
        cut = increments(imu_of(samples_s[early], f[early], w[early]), t_s[: k + 1])
        assert cut.w_b_radps is not None
        assert whole.w_b_radps is not None
        n = int(cut.first[-1])
        np.testing.assert_array_equal(cut.first, whole.first[: k + 1])
        np.testing.assert_allclose(cut.f_b_mps2, whole.f_b_mps2[:n], rtol=0, atol=1e-12)
        np.testing.assert_allclose(cut.w_b_radps, whole.w_b_radps[:n], rtol=0, atol=1e-12)


def test_past_the_last_sample_a_line_goes_on_for_one_period_and_then_holds():
    samples_s = np.arange(11) / 10
    f = np.outer(samples_s, [1.0, -2.0, 0.0])
    steps = increments(imu_of(samples_s, f), np.array([0.0, 1.0, 2.0]), 4)
    late = steps.f_b_mps2[steps.first[1] :]
    middle_s = 1.0 + (np.arange(len(late)) + 0.5) * steps.step_s[1]
    expected = np.outer(middle_s.clip(None, 1.1), [1.0, -2.0, 0.0])
    np.testing.assert_allclose(late, expected, rtol=0, atol=1e-12)


def test_a_gap_in_the_samples_is_crossed_by_a_straight_line():
    samples_s = np.concatenate([np.arange(100) / 100, 2.0 + np.arange(100) / 100])
    f = np.repeat(np.where(samples_s < 1.5, 1.0, 3.0)[:, None], 3, axis=1)
    f += 0.01 * np.random.default_rng(3).standard_normal(f.shape)
    steps = increments(imu_of(samples_s, f), np.array([0.0, 0.5, 2.5]), 1)
    crossing = steps.f_b_mps2[steps.first[1] :]
    assert crossing.min() > 0.95
    assert crossing.max() < 3.05


def test_steps_fill_their_interval_by_equal_parts_of_a_sample():
    samples_s = np.arange(101) / 100
    steps = increments(imu_of(samples_s, np.zeros((101, 3))), np.array([0.0, 0.1, 0.15, 0.152]), 3)
    np.testing.assert_array_equal(np.diff(steps.first), [30, 15, 1])
    np.testing.assert_allclose(steps.step_s * np.diff(steps.first), [0.1, 0.05, 0.002], rtol=1e-12)
    assert steps.w_b_radps is None


def test_no_sub_steps_are_refused():
    with pytest.raises(BadInputError, match="sub_steps: must be 1 or more, got 0"):
        increments(imu_of(np.arange(5.0), np.zeros((5, 3))), np.arange(3.0), 0)
