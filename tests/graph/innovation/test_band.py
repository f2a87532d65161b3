"""Innovations of right noise stay within their band; those of wrong noise are found, and when."""

import numpy as np
import pytest

from fgnav.graph.correlation import correlated
from fgnav.graph.innovation.band import beyond_s, contradictions

K, D = 300, 3  # samples of 30 s, degrees of freedom of each
T_S = np.arange(K) / 10.0
FREEDOM = np.full(K, D)


def squares(rng, sigma=1.0):
    return (sigma * rng.normal(size=(D, K))) ** 2


def first_order(rng, a, k, d):
    """Return a first-order autoregressive series of unit variance, (k, d)."""
    r = rng.normal(size=(k, d))
    r[1:] *= np.sqrt(1 - a * a)
    for i in range(1, k):
        r[i] += a * r[i - 1]
    return r


def test_right_noise_is_hardly_ever_contradicted():
    rng = np.random.default_rng(30_000)
    alarms = sum(bool(contradictions(T_S, squares(rng).sum(axis=0), FREEDOM)) for _ in range(2000))
    assert alarms <= 3  # of 0.4 expected at most: 1e-4 by each test


def test_a_span_of_louder_noise_is_found_to_the_second():
    rng = np.random.default_rng(30_001)
    sigma = np.where((T_S >= 10) & (T_S < 15), 4.0, 1.0)
    (found,) = contradictions(T_S, squares(rng, sigma).sum(axis=0), FREEDOM)
    assert not found.throughout
    assert found.from_s == pytest.approx(10.0, abs=0.1)
    assert found.until_s == pytest.approx(14.9, abs=0.1)
    assert found.nis == pytest.approx(16.0, rel=0.3)
    assert found.freedom == 150


def test_noise_that_is_louder_all_along_is_one_span():
    rng = np.random.default_rng(30_002)
    (found,) = contradictions(T_S, squares(rng, 3.0).sum(axis=0), FREEDOM)
    assert found.throughout
    assert (found.from_s, found.until_s) == (0.0, T_S[-1])


def test_noise_that_is_louder_all_along_is_one_span_though_a_second_is_louder_still():
    rng = np.random.default_rng(30_004)
    sigma = np.where((T_S >= 10) & (T_S < 11), 4.0, 2.2)
    (found,) = contradictions(T_S, squares(rng, sigma).sum(axis=0), FREEDOM)
    assert found.throughout
    assert found.nis == pytest.approx(5.2, rel=0.2)


def test_one_sample_far_off_is_found():
    rng = np.random.default_rng(30_003)
    squared = squares(rng).sum(axis=0)
    squared[123] = 1e4
    (found,) = contradictions(T_S, squared, FREEDOM)
    assert found.from_s <= T_S[123] <= found.until_s
    assert found.until_s - found.from_s < 1.0


def test_few_samples_say_what_one_of_them_would():
    for k in (1, 4):
        assert contradictions(T_S[:k], np.full(k, 5.0 * D), FREEDOM[:k]) == ()  # chance: 7.04
        (found,) = contradictions(T_S[:k], np.full(k, 9.0 * D), FREEDOM[:k])
        assert found.throughout


def test_none_that_test_anything_say_nothing():
    assert contradictions(T_S[:0], np.empty(0), FREEDOM[:0]) == ()
    assert contradictions(T_S, np.full(K, 1e6), 0 * FREEDOM) == ()


def test_correlation_counts_the_samples_that_an_independent_one_is_worth():
    rng = np.random.default_rng(30_004)
    a = 0.8
    found = correlated(first_order(rng, a, 20_000, 2))
    assert found == pytest.approx((1 + a) / (1 - a), rel=0.15)  # closed form of the process


def test_white_series_and_nothing_have_no_correlation():
    rng = np.random.default_rng(30_005)
    assert [correlated(rng.normal(size=(200, 2))) for _ in range(200)].count(1.0) >= 198
    assert correlated(np.zeros((10, 2))) == 1.0


def test_right_noise_that_is_tested_every_second_is_hardly_ever_contradicted():
    rng = np.random.default_rng(30_005)
    tried = (squares(rng).sum(axis=0) for _ in range(2000))
    alarms = sum(bool(beyond_s(T_S, squared, FREEDOM, T_S[-1])) for squared in tried)
    assert alarms <= 2  # of 0.2 expected at most: 1e-4 of all tests of a record together


def test_errors_that_stay_are_worth_one_until_they_can_show_that_they_stay():
    rng = np.random.default_rng(30_006)
    alarms = 0
    for _ in range(500):
        squared = np.full(K, (rng.normal(size=D) ** 2).sum())  # a constant that is off
        alarms += min(beyond_s(T_S, squared, FREEDOM, T_S[-1]), default=np.inf) < 1.6
    assert alarms <= 2


def test_noise_that_grows_louder_is_known_within_seconds_and_no_earlier():
    rng = np.random.default_rng(30_007)
    sigma = np.where(T_S >= 10, 6.0, 1.0)
    squared = squares(rng, sigma).sum(axis=0)
    found = beyond_s(T_S, squared, FREEDOM, T_S[-1])
    assert 10.0 < found[0] < 13.0
    until = T_S <= 14.0  # what comes later does not matter
    assert beyond_s(T_S[until], squared[until], FREEDOM[until], 14.0) == tuple(
        s for s in found if s <= 14.0
    )


def test_a_sensor_that_falls_silent_is_judged_when_the_second_is_over():
    """Whatever comes later of it: by one sample more it was judged, and by none it was not."""
    rng = np.random.default_rng(30_008)
    until = T_S < 3.5
    squared = squares(rng, 6.0).sum(axis=0)[until]
    last, before = (
        beyond_s(T_S[until], squared, FREEDOM[until], until_s)[-1] for until_s in (4.0, 3.99)
    )
    assert (last, before) == (4.0, 3.0)
    late = beyond_s(T_S[until], squared, FREEDOM[until], 4.0, since_s=3.5)
    assert late == (4.0,)
