"""Unit vectors with the covariance of their two angles."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.checks import BadInputError
from fgnav.graph.factors.directions import Directions


def drawn(rng, n):
    """Unit vectors and covariances across them, of the shape that a network gives: rank two."""
    e_b = rng.standard_normal((n, 3))
    e_b /= np.linalg.norm(e_b, axis=1, keepdims=True)
    root = (np.eye(3) - e_b[:, :, None] * e_b[:, None, :]) @ rng.standard_normal((n, 3, 3))
    return e_b, 0.01 * root @ root.swapaxes(1, 2)


def test_what_whitens_a_direction_turns_its_covariance_into_one():
    e_b, covariance = drawn(np.random.default_rng(0), 200)
    directions = Directions.of("some", e_b, covariance)
    white = directions.across_b @ covariance @ directions.across_b.swapaxes(1, 2)
    assert_allclose(white, np.tile(np.eye(2), (200, 1, 1)), rtol=0, atol=1e-9)
    assert_allclose(np.einsum("nij,nj->ni", directions.across_b, e_b), 0, atol=1e-9)


def test_a_covariance_along_the_direction_does_not_count():
    e_b, covariance = drawn(np.random.default_rng(1), 20)
    along = e_b[:, :, None] * e_b[:, None, :]
    directions = Directions.of("some", e_b, covariance + 7 * along)
    without = Directions.of("some", e_b, covariance)
    assert_allclose(directions.across_b, without.across_b, atol=1e-9)


def test_a_round_covariance_is_one_sigma_about_both_axes():
    e_b, _ = drawn(np.random.default_rng(2), 20)
    e_b[4] = np.nan
    by_covariance = Directions.of("some", e_b, np.tile(0.03**2 * np.eye(3), (20, 1, 1)))
    isotropic = Directions.isotropic(e_b, 0.03)
    assert_allclose(by_covariance.across_b, isotropic.across_b, rtol=1e-12, atol=1e-12)
    assert not isotropic.across_b[4].any()
    assert 4 not in isotropic.row


@pytest.mark.parametrize("least", [0.0, -1e-6, 1e-15])
def test_a_direction_that_is_sure_about_an_axis_is_refused(least):
    e_b = np.tile([0.0, 0.0, 1.0], (3, 1))
    covariance = np.tile(0.01 * np.eye(3), (3, 1, 1))
    covariance[2, 1, 1] = least
    text = "some covariance: must be positive definite across the direction, row 2 has variances"
    with pytest.raises(BadInputError, match=text):
        Directions.of("some", e_b, covariance)


def test_directions_are_placed_among_keyframes():
    e_b, covariance = drawn(np.random.default_rng(5), 3)
    directions = Directions.of("some", e_b, covariance)
    spread = directions[np.array([0, 2])].scatter(np.array([4, 1]), 6)
    assert spread.row.tolist() == [1, 4]
    assert_allclose(spread.across_b[[4, 1]], directions.across_b[[0, 2]], rtol=0, atol=0)
    assert not np.delete(spread.across_b, [1, 4], axis=0).any()
