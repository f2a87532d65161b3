import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fgnav.checks import BadInputError
from fgnav.integers.ils.search import integer_least_squares_batch
from fgnav.integers.ils.success import success_rates


def rounded(sigma):
    """Chance that one float of that standard deviation is rounded to its mean."""
    return math.erf(0.5 / (sigma * math.sqrt(2)))


def test_one_ambiguity_is_right_as_often_as_rounding_is():
    rates = success_rates([[0.09]])
    assert rates.bootstrapped == pytest.approx(rounded(0.3), rel=1e-12)
    assert rates.upper == pytest.approx(rounded(0.3), rel=1e-9)  # the ball is the interval
    assert rates.adop_cycles == pytest.approx(0.3, rel=1e-12)


def test_independent_ambiguities_are_right_independently():
    rates = success_rates(np.diag([0.04, 0.09, 0.16]))
    assert rates.bootstrapped == pytest.approx(rounded(0.2) * rounded(0.3) * rounded(0.4))
    assert rates.adop_cycles == pytest.approx(0.024 ** (1 / 3))


def test_adop_is_that_of_the_determinant_whatever_the_correlation():
    rng = np.random.default_rng(1)
    A = rng.normal(size=(6, 6))
    Q = A @ A.T + 0.01 * np.eye(6)
    expected = np.exp(np.linalg.slogdet(Q)[1] / 12)
    assert success_rates(Q).adop_cycles == pytest.approx(expected, rel=1e-9)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 6))
def test_integer_least_squares_is_right_between_the_two_bounds(seed, n):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, 3))
    Q = 0.02 * np.eye(n) + rng.choice([0.03, 0.3]) * A @ A.T
    rates = success_rates(Q)
    floats = rng.normal(size=(4000, n)) @ np.linalg.cholesky(Q).T
    found, _ = integer_least_squares_batch(floats, Q, 1)
    share = (found[:, 0] == 0).all(axis=1).mean()
    sigma = 0.5 / math.sqrt(4000)  # of a share, at most
    assert rates.bootstrapped - 5 * sigma <= share <= rates.upper + 5 * sigma
    assert rates.bootstrapped <= rates.upper * (1 + 1e-9)


def test_bounds_of_precise_ambiguities_are_one():
    rates = success_rates(1e-4 * np.eye(5))
    assert_allclose([rates.bootstrapped, rates.upper], 1.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("Q", "text"),
    [
        ([[1.0, 2.0], [2.0, 1.0]], "positive definite"),
        ([[1.0, 0.5], [0.2, 1.0]], "symmetric"),
        ([[np.nan]], "finite"),
        (np.ones((2, 3)), r"expected shape \(2, 2\)"),
    ],
)
def test_bad_covariance_is_refused_by_name(Q, text):
    with pytest.raises(BadInputError, match=text):
        success_rates(Q)
