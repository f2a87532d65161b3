"""One direction of gravity moves the estimate as its covariance says."""

import dataclasses

import numpy as np
from numpy.testing import assert_allclose

from fgnav.geometry.rotations import exp, log, skew
from fgnav.graph.factors.directions import Directions
from fgnav.graph.factors.gravity import Gravity
from fgnav.solve.batch import solve_batch
from tests.assembly.flights import turning


def test_an_estimate_follows_a_direction_along_the_axis_that_it_knows():
    """A degree off about x_b and about y_b, where it is good for thirty and for 0.3."""
    problem, row = turning(np.random.default_rng(4), span_s=5.0).problem, 25
    array, *rest = problem.sensors
    quiet = dataclasses.replace(array, root=array.root / 60)
    problem = dataclasses.replace(problem, sensors=(quiet, *rest))
    without = solve_batch(problem)
    R_bn, P = without.states.R_nb[row].T, without.covariance[row, :3, :3]
    known_n = problem.motion.gravity_n_mps2[row : row + 1]
    known_n = known_n / np.linalg.norm(known_n)
    down_b = R_bn @ known_n[0]
    e_b = exp(np.radians([[-1.0, -1.0, 0.0]]))[0] @ down_b
    turn = skew(e_b[None])[0]
    covariance = turn @ np.diag(np.radians([30.0, 0.3, 0.0]) ** 2) @ turn.T
    W = Directions.of("gravity", e_b[None], covariance[None]).across_b
    gravity = Gravity(
        row=np.array([row]),
        known_n=known_n,
        across_b=W,
        constants=problem.constants,
    )
    together = dataclasses.replace(problem, sensors=(*problem.sensors, gravity))
    moved = log((R_bn @ solve_batch(together).states.R_nb[row])[None])[0]
    # The linear update of what is known without it.
    H = W[0] @ skew(down_b[None])[0]
    expected = -P @ H.T @ np.linalg.solve(H @ P @ H.T + np.eye(2), W[0] @ down_b)
    assert_allclose(moved, expected, rtol=0, atol=0.01 * np.abs(expected).max())
    assert moved[1] > np.radians(0.7)  # by the mean of both variances, 21 degrees: 0.002
    assert abs(moved[0]) < np.radians(0.1)
