"""How many samples each interval lost: against all that there may be, listed one by one."""

from itertools import product

import numpy as np
import pytest
from scipy.special import gammaln, softmax

from fgnav.identification.spans.lost_counts import likeliest_counts, moments_of_counts

MOST = np.array([4.0, 3.0, 4.0, 2.0])
BEFORE = np.array([0, 1, 0, 0])


@pytest.fixture
def information():
    """About three losses in four intervals: tags after each are early by all before."""
    rng = np.random.default_rng(5)
    late = np.triu(np.ones((4, 4)))
    N = late @ np.diag(rng.uniform(0.5, 2.0, 4)) @ late.T
    return N @ (np.array([0.2, 1.4, 0.9, 0.3]) - BEFORE), N


def every(information, most):
    """Return all losses that there may be, and ln of their probability but for a constant."""
    s, N = information
    n = np.array(list(product(*(range(int(one) + 1) for one in most))))
    off, total = n - BEFORE, n.sum(axis=1)
    order = total * np.log(4) + gammaln(n + 1).sum(axis=1) - gammaln(total + 1)
    return n, off @ s - np.einsum("ki,ij,kj->k", off, N, off) / 2 - order


def test_the_likeliest_are_those_of_all(information):
    n, log_p = every(information, [0, *MOST[1:]])
    counts, odds = likeliest_counts(information, BEFORE, MOST)
    np.testing.assert_array_equal(counts, n[log_p.argmax()])
    assert 0.0 < odds < counts.sum() * np.log(4)


def test_mean_and_covariance_are_those_of_all(information):
    n, log_p = every(information, MOST)
    share = softmax(log_p)
    mean, covariance = moments_of_counts(information, BEFORE, MOST, np.random.default_rng(0))
    np.testing.assert_allclose(mean, share @ n, atol=0.08)
    off = n - share @ n
    np.testing.assert_allclose(covariance, (share[:, None] * off).T @ off, atol=0.08)
