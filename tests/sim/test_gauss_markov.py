"""Gauss-Markov noise: its variance, its memory, and the flat Allan deviation of a sum of them."""

import numpy as np
import pytest

from fgnav_sim.gauss_markov import flicker, gauss_markov
from tests.sim.statistics import allan_deviation


@pytest.mark.parametrize(("time_constant_s", "step_s"), [(20.0, 1.0), (5.0, 0.1)])
def test_variance_is_one_and_autocorrelation_falls_with_the_time_constant(time_constant_s, step_s):
    steps = round(3 * time_constant_s / step_s)
    x = gauss_markov(time_constant_s, step_s, (2 * steps, 4000), rng=np.random.default_rng(1))
    assert np.mean(x**2, axis=1) == pytest.approx(1.0, abs=0.12)  # from the first sample on
    for lag in (1, steps // 6, steps // 3):
        correlation = np.mean(x[lag:] * x[:-lag])
        assert correlation == pytest.approx(np.exp(-lag * step_s / time_constant_s), abs=0.01)


def test_flicker_has_a_flat_allan_deviation_of_the_size_that_the_standard_says():
    x = flicker(2.0, 0.1, (100_000, 6), rng=np.random.default_rng(1))
    expected = 2.0 * np.sqrt(2 * np.log(2) / np.pi)
    for averaging_s in (1.0, 10.0, 100.0):
        assert allan_deviation(x, 0.1, averaging_s) == pytest.approx(expected, rel=0.06)
