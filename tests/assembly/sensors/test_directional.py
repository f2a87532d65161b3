"""Gravity and line of sight at keyframes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.assembly.sensors import directional
from fgnav.checks import BadInputError
from fgnav.geometry.interpolation import interpolate
from fgnav.graph.factors.directions import Directions
from fgnav.gravity import GravityDirection
from fgnav.integers.resolvers.truth import attitude_at
from tests.methods.simulated import flown

T_S = np.arange(6) / 10


def drawn(rng, n):
    e_b = rng.standard_normal((n, 3))
    e_b /= np.linalg.norm(e_b, axis=1, keepdims=True)
    root = (np.eye(3) - e_b[:, :, None] * e_b[:, None, :]) @ rng.standard_normal((n, 3, 3))
    return e_b, 0.01 * root @ root.swapaxes(1, 2)


def estimated(times_s, seed=3):
    e_b, covariance = drawn(np.random.default_rng(seed), len(times_s))
    return GravityDirection(t_s=np.array(times_s), g_b=e_b, covariance=covariance)


def test_gravity_stands_at_the_nearest_keyframes_with_its_own_covariance():
    direction = estimated([0.04, 0.31, 9.0])
    at_keyframes, unused = directional.gravity(direction, T_S)
    assert at_keyframes.row.tolist() == [0, 3]
    own = Directions.of("some", direction.g_b, direction.covariance)
    assert_allclose(at_keyframes.across_b[[0, 3]], own.across_b[:2])
    assert [(loss.what, loss.count) for loss in unused] == [("gravity direction", 1)]


def test_a_filter_takes_gravity_at_the_first_keyframe_that_is_not_before_it():
    """Of several between two keyframes the last; none that would come too late."""
    direction = estimated([0.04, 0.08, 0.31, 9.0])
    at_keyframes, unused = directional.gravity(direction, T_S, causal=True)
    assert at_keyframes.row.tolist() == [1, 4]
    own = Directions.of("some", direction.g_b, direction.covariance)
    assert_allclose(at_keyframes.across_b[[1, 4]], own.across_b[[1, 2]])
    assert unused[0].count == 2


@pytest.mark.parametrize("least", [0.0, -1e-6, 1e-15])
def test_gravity_that_is_sure_about_an_axis_is_refused_by_its_name(least):
    e_b = np.tile([0.0, 0.0, 1.0], (3, 1))
    covariance = np.tile(0.01 * np.eye(3), (3, 1, 1))
    covariance[2, 1, 1] = least
    text = "gravity direction covariance: must be positive definite across the direction, row 2 "
    direction = GravityDirection(t_s=np.arange(3.0), g_b=e_b, covariance=covariance)
    with pytest.raises(BadInputError, match=text):
        directional.gravity(direction, np.arange(3.0))


def test_without_an_instrument_there_is_no_direction():
    assert directional.gravity(None, T_S) == (None, ())
    flight = flown("demo", 5.0)
    assert directional.sight(flight.photodetector, flight.imu, T_S, np.zeros((6, 3))) == (None, ())


def test_the_line_of_sight_is_that_from_the_accelerometer_to_the_landmark():
    """In a second of a flight that sees it: a degree's thousandth is the detector's noise."""
    flight = flown("approach", 60.0)
    seen_s = flight.photodetector.t_s
    t_s = np.arange(0.0, 60.05, 0.1)
    truth = flight.truth
    p_n_m = interpolate(t_s, truth.t_s, truth.p_n_m)
    at_keyframes, unused = directional.sight(flight.photodetector, flight.imu, t_s, p_n_m)
    rows = at_keyframes.row
    assert len(rows) > 20
    assert t_s[rows].min() > seen_s[0] - 0.2
    R_nb, _ = attitude_at(truth, t_s[rows])
    at_n_m = p_n_m[rows] + R_nb @ flight.imu.position_b_m
    to_b_m = np.einsum("nji,nj->ni", R_nb, flight.photodetector.landmark_n_m - at_n_m)
    u_b = to_b_m / np.linalg.norm(to_b_m, axis=1, keepdims=True)
    whitened = np.einsum("nij,nj->ni", at_keyframes.across_b[rows], u_b)
    degrees = whitened.size
    assert abs((whitened**2).sum() / degrees - 1) < 5 * np.sqrt(2 / degrees)
    assert all(loss.count > 0 for loss in unused)
