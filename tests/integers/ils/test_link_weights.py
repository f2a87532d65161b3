"""The inverse covariance of double differences by eliminating clocks, against the dense inverse."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.integers.ils.array_model import epoch_links, link_arrays, link_covariance
from fgnav.integers.ils.link_weights import solved, weighed
from tests.integers.arrays import make


@pytest.mark.parametrize("satellites", [(6,), (4, 3), (2, 1, 5)])
@pytest.mark.parametrize("share_missing", [0.0, 0.3])
def test_weights_are_those_of_the_full_covariance_whatever_is_missing(satellites, share_missing):
    rng = np.random.default_rng(1)
    missing = rng.random((5, 8, sum(satellites))) < share_missing
    made = make(rng, epochs=5, satellites=satellites, sine=True, missing=missing)
    epochs = link_arrays(made.differences)
    for k in range(5):
        everywhere = np.ones(7, dtype=bool)
        links = epoch_links(epochs.resolvable[k], epochs.of_reference[k], everywhere)
        X = rng.normal(size=(len(links), 4))
        variances = epochs.code_variance_m2[k], epochs.phase_variance_m2[k]
        found = weighed(links, *variances, X)
        for one, variance in zip(found, variances, strict=True):
            expected = np.linalg.solve(link_covariance(links, variance), X)
            assert_allclose(one, expected, rtol=0, atol=1e-11 * np.abs(expected).max(initial=1.0))


def test_no_links_weigh_nothing():
    links, variance = np.zeros((0, 3), dtype=np.int64), np.ones(5)
    variance.flags.writeable = False  # as variances are: compiled for these alone
    assert weighed(links, variance, variance, np.zeros((0, 4))).shape == (2, 0, 4)


def test_symmetric_systems_are_solved():
    rng = np.random.default_rng(2)
    A = rng.normal(size=(6, 6))
    S, B = A @ A.T + np.eye(6), rng.normal(size=(6, 3))
    S[:3, 3:] = S[3:, :3] = 0.0
    assert_allclose(S @ solved(S, B), B, rtol=0, atol=1e-12)
