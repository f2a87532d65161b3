"""The whole flight at once, against dense algebra on GTSAM's own graph."""

import gtsam
import numpy as np
import pytest

from fgnav.checks import FloatArray
from fgnav.graph import keys
from fgnav.graph.build import Layout, flight_values
from fgnav.graph.types.parameters import flight_constant
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.solve.batch import solve_batch
from tests.solve.flights import flight, flight_graph


def _dense(
    problem: Problem, states: States, own: list[gtsam.NonlinearFactor]
) -> tuple[FloatArray, FloatArray]:
    """Newton step and covariance of all variables by one dense inverse."""
    layout, ordering = Layout.of(problem), gtsam.Ordering()
    for k in range(len(problem.t_s)):
        for key in layout.keyframe(k):
            ordering.push_back(key)
    for key in layout.constant_keys:
        ordering.push_back(key)
    linear = flight_graph(problem, states, own).linearize(flight_values(problem, states))
    A, b = linear.jacobian(ordering)
    inverse = np.linalg.pinv(A, rcond=1e-14)
    return inverse @ b, inverse @ inverse.T


def _worst(one: FloatArray, other: FloatArray, sigma: FloatArray, beside: FloatArray) -> float:
    """Largest difference of two covariances, as a correlation."""
    return float(np.abs((one - other) / np.outer(sigma, beside)).max())


def _compare(problem: Problem, solution: Solution, P: FloatArray) -> float:
    D, n = problem.width, len(problem.t_s)
    sigma = np.sqrt(np.diag(P))
    shared, worst = slice(n * D, None), 0.0
    for k in range(n):
        own, after = slice(k * D, k * D + D), slice(k * D + D, k * D + 2 * D)
        s, c = sigma[own], sigma[shared]
        pairs = [(solution.covariance[k], own, s)]
        if k < n - 1:
            pairs.append((solution.cross[k], after, sigma[after]))
        if len(c):
            pairs.append((solution.constant_cross[k], shared, c))
            worst = max(worst, _worst(solution.constant_covariance[k], P[shared, shared], c, c))
        for block, columns, beside in pairs:
            worst = max(worst, _worst(block, P[own, columns], s, beside))
    return worst


@pytest.mark.parametrize("gyroscope", [False, True])
@pytest.mark.parametrize("is_far", [False, True])
def test_batch_is_the_least_cost_with_its_covariances(gyroscope: bool, is_far: bool) -> None:
    lever = flight_constant("lever arm", ("x", "y"), "m", 0.5)
    problem, truth = flight(1.0, gyroscope=gyroscope, extra=(lever,))
    own = []
    if is_far:  # a factor across the flight, which no chain has
        R, p = truth.R_nb[1].T @ truth.R_nb[9], truth.R_nb[1].T @ (truth.p_n_m[9] - truth.p_n_m[1])
        noise = gtsam.noiseModel.Isotropic.Sigma(6, 1e-3)
        own = [
            gtsam.BetweenFactorPose3(
                keys.pose(1), keys.pose(9), gtsam.Pose3(gtsam.Rot3(R), p), noise
            )
        ]
    solution = solve_batch(problem, custom=own)
    step, P = _dense(problem, solution.states, own)
    assert solution.converged
    assert np.abs(step / np.sqrt(np.diag(P))).max() < 0.02
    assert _compare(problem, solution, P) < 1e-4
    graph = flight_graph(problem, solution.states, own)
    cost = 2 * graph.error(flight_values(problem, solution.states))
    np.testing.assert_allclose(solution.cost, cost, rtol=1e-6)
