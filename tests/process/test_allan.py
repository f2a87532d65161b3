"""Allan deviation: its definition, and the closed forms of white noise and a random walk."""

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.process.allan import (
    allan_deviation,
    longest_run,
    stated_deviation,
)


def test_the_deviation_is_that_of_differences_of_neighbouring_means():
    values = np.random.default_rng(1).standard_normal((200, 2))
    tau_s, deviation = allan_deviation(values, 0.5)
    for tau, own in zip(tau_s, deviation, strict=True):
        m = round(tau / 0.5)
        means = np.array([values[k : k + m].mean(axis=0) for k in range(len(values) - m + 1)])
        expected = np.sqrt(0.5 * ((means[m:] - means[:-m]) ** 2).mean(axis=0))
        np.testing.assert_allclose(own, expected, rtol=1e-9, atol=1e-12)


def test_white_noise_and_a_random_walk_have_their_closed_forms():
    rng, interval_s, density, walk = np.random.default_rng(2), 0.01, 1e-2, 3e-3
    n = 200_000
    white = density / np.sqrt(interval_s) * rng.standard_normal((n, 3))
    bias = np.cumsum(walk * np.sqrt(interval_s) * rng.standard_normal((n, 3)), axis=0)
    tau_s, deviation = allan_deviation(9.81 + white + bias, interval_s)
    ratio = deviation / stated_deviation(tau_s, density, walk)[:, None]
    # Of clusters of a hundredth of the record, means of 100 and more differences: 7 % of 1 sigma.
    sure = tau_s < 0.01 * n * interval_s
    assert np.abs(ratio[sure] - 1).max() < 0.2
    assert tau_s[0] == pytest.approx(interval_s)
    assert tau_s[-1] == pytest.approx(0.1 * n * interval_s)


def test_a_record_of_nine_samples_is_none():
    with pytest.raises(BadInputError, match="needs 10 samples or more, got 9"):
        allan_deviation(np.zeros((9, 1)), 0.1)


def test_the_longest_run_ends_at_gaps():
    t_s = np.concatenate([np.arange(5) * 0.1, 3 + np.arange(8) * 0.1, 9 + np.arange(3) * 0.1])
    assert longest_run(t_s) == slice(5, 13)
    assert longest_run(t_s[:1]) == slice(0, 1)
