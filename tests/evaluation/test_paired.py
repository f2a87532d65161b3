"""Paired statistics: intervals that cover what they promise, and the flight as the unit."""

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.evaluation.paired import paired, pooled


def test_intervals_cover_the_true_ratio_as_often_as_they_say():
    rng = np.random.default_rng(20_001)
    flights, trials = 30, 200
    covered = 0
    for _ in range(trials):
        difficulty = rng.lognormal(0.0, 0.5, flights)  # common to both methods
        first = difficulty * 0.8 * rng.lognormal(0.0, 0.1, flights)
        second = difficulty * rng.lognormal(0.0, 0.1, flights)
        ratio = paired(first, second, rng).ratio
        covered += ratio.low <= 0.8 <= ratio.high
    assert covered / trials == pytest.approx(0.95, abs=0.046)  # three sigmas of a binomial


def test_pairing_sees_what_pooling_does_not():
    rng = np.random.default_rng(3)
    difficulty = rng.lognormal(0.0, 1.0, 20)
    first, second = 0.95 * difficulty, difficulty * rng.lognormal(0.0, 0.01, 20)
    held = paired(first, second, rng)
    a, b = (pooled(x, rng, squared=True) for x in (first, second))
    assert held.is_significant
    assert a.low < b.high
    assert b.low < a.high  # intervals of each alone overlap


def test_equal_methods_are_not_told_apart():
    rng = np.random.default_rng(4)
    values = rng.lognormal(size=12)
    held = paired(values, values.copy(), rng)
    assert (held.ratio.value, held.p_value, held.is_significant) == (1.0, 1.0, False)


def test_chance_is_called_a_gain_in_one_of_twenty_at_most():
    rng = np.random.default_rng(20_002)
    significant = 0
    for _ in range(200):
        a, b = rng.lognormal(size=(2, 15))
        significant += paired(a, b, rng).is_significant
    assert significant <= 20  # 5 % of 200, and three sigmas of a binomial


def test_flights_of_one_method_only_are_counted_not_used():
    first = np.array([1.0, np.nan, 3.0, 4.0, np.nan])
    second = np.array([1.0, 2.0, np.nan, 8.0, np.nan])
    held = paired(first, second, np.random.default_rng(0))
    assert (held.flights, held.unpaired) == (2, 2)
    assert held.ratio.value == pytest.approx(np.sqrt(17 / 65))
    assert np.isnan(held.ratio.low)  # two flights tell no interval


def test_two_lists_of_other_flights_are_refused():
    with pytest.raises(BadInputError, match="same flights"):
        paired(np.ones(3), np.ones(4), np.random.default_rng(0))
