import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.checks import BadInputError
from fgnav.gravity import GravityDirection
from fgnav.methods.smoother import instruments
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.directions import Directions
from fgnav.rotations import exp, log, skew

from .flights import turning


def drawn(rng, n):
    """Unit vectors and covariances across them, of the shape that a network gives: rank two."""
    e_b = rng.standard_normal((n, 3))
    e_b /= np.linalg.norm(e_b, axis=1, keepdims=True)
    root = (np.eye(3) - e_b[:, :, None] * e_b[:, None, :]) @ rng.standard_normal((n, 3, 3))
    return e_b, 0.01 * root @ root.swapaxes(1, 2)


def test_what_whitens_a_direction_turns_its_covariance_into_one():
    e_b, covariance = drawn(np.random.default_rng(0), 200)
    found = Directions.of("some", e_b, covariance)
    white = found.across_b @ covariance @ found.across_b.swapaxes(1, 2)
    assert_allclose(white, np.tile(np.eye(2), (200, 1, 1)), rtol=0, atol=1e-9)
    assert_allclose(np.einsum("nij,nj->ni", found.across_b, e_b), 0, atol=1e-9)


def test_what_a_covariance_says_along_the_direction_does_not_count():
    e_b, covariance = drawn(np.random.default_rng(1), 20)
    along = e_b[:, :, None] * e_b[:, None, :]
    found = Directions.of("some", e_b, covariance + 7 * along)
    assert_allclose(found.across_b, Directions.of("some", e_b, covariance).across_b, atol=1e-9)


def test_a_round_covariance_is_one_sigma_about_both_axes():
    e_b, _ = drawn(np.random.default_rng(2), 20)
    e_b[4] = np.nan
    found = Directions.of("some", e_b, np.tile(0.03**2 * np.eye(3), (20, 1, 1)))
    told = Directions.isotropic(e_b, 0.03)
    assert_allclose(found.across_b, told.across_b, rtol=1e-12, atol=1e-12)
    assert not told.across_b[4].any()
    assert 4 not in told.row


@pytest.mark.parametrize("least", [0.0, -1e-6, 1e-15])
def test_a_direction_that_is_sure_about_an_axis_is_refused(least):
    e_b = np.tile([0.0, 0.0, 1.0], (3, 1))
    covariance = np.tile(0.01 * np.eye(3), (3, 1, 1))
    covariance[2, 1, 1] = least
    text = "gravity direction covariance: must be positive definite across the direction, row 2 "
    told = GravityDirection(t_s=np.arange(3.0), g_b=e_b, covariance=covariance)
    with pytest.raises(BadInputError, match=text):
        instruments.gravity(told, np.arange(3.0))


def test_gravity_stands_at_the_nearest_keyframes_with_its_own_covariance():
    e_b, covariance = drawn(np.random.default_rng(3), 3)
    told = GravityDirection(t_s=np.array([0.04, 0.31, 9.0]), g_b=e_b, covariance=covariance)
    found, losses = instruments.gravity(told, np.arange(6) / 10)
    assert found.row.tolist() == [0, 3]
    assert_allclose(found.across_b[3], Directions.of("some", e_b, covariance).across_b[1])
    assert losses[0].count == 1


def test_an_estimate_follows_a_direction_along_the_axis_that_it_knows():
    """A degree off about x_b and about y_b, where it is good for thirty and for 0.3."""
    case, row = turning(np.random.default_rng(4), span_s=5.0), 25
    array = dataclasses.replace(case.keyframes.array, root=case.keyframes.array.root / 60)
    keyframes = dataclasses.replace(case.keyframes, array=array)
    without = solve_batch(keyframes)
    R_bn, P = without.R_nb[row].T, without.covariance[row, :3, :3]
    down_b = R_bn @ keyframes.gravity_n_mps2[row]
    down_b /= np.linalg.norm(down_b)
    e_b = exp(np.radians([[-1.0, -1.0, 0.0]]))[0] @ down_b
    turn = skew(e_b[None])[0]
    covariance = turn @ np.diag(np.radians([30.0, 0.3, 0.0]) ** 2) @ turn.T
    one = Directions.of("gravity", e_b[None], covariance[None])
    told = dataclasses.replace(keyframes, gravity=one.at(np.array([row]), len(keyframes.t_s)))
    moved = log(R_bn @ solve_batch(told).R_nb[row : row + 1])[0]
    # The linear update of what is known without it.
    W = one.across_b[0]
    H = W @ skew(down_b[None])[0]
    expected = -P @ H.T @ np.linalg.solve(H @ P @ H.T + np.eye(2), W @ down_b)
    assert_allclose(moved, expected, rtol=0, atol=0.01 * np.abs(expected).max())
    assert moved[1] > np.radians(0.7)  # by the mean of both variances, 21 degrees: 0.002
    assert abs(moved[0]) < np.radians(0.1)
