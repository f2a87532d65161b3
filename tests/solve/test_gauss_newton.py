"""The minimum of random chains, against dense algebra that shares no line with it."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.solve.gauss_newton import gauss_newton
from tests.solve.linear_flight import dense, random_problem

CASES = [(6, 2), (12, 3), (12, 0), (6, 24)]


@pytest.mark.parametrize(("aux", "b"), CASES)
def test_gradient_of_the_dense_cost_vanishes_at_the_solution(aux, b):
    problem = random_problem(12, aux, b)
    solution = gauss_newton(problem).solution
    H, g, cost = dense(problem, solution.states)
    assert solution.converged
    # Newton's next step from there, in sigmas.
    step, sigma = np.linalg.solve(H, g), np.sqrt(np.diag(np.linalg.inv(H)))
    assert np.abs(step / sigma).max() < 0.01
    assert solution.cost == pytest.approx(cost, abs=1e-4)


def test_a_far_beginning_ends_in_the_same_minimum():
    problem = random_problem(30, 6, 2, turn_rad=0.5)
    near = gauss_newton(problem).solution
    rng = np.random.default_rng(5)
    begin = problem.start.moved(0.3 * rng.normal(size=(30, 15)), np.ones(2))
    far = gauss_newton(problem, begin=begin).solution
    assert near.converged
    assert far.converged
    assert far.cost == pytest.approx(near.cost, abs=1e-3)


def test_one_keyframe_is_solved():
    problem = random_problem(1, 12, 3)
    solution = gauss_newton(problem).solution
    P = np.linalg.inv(dense(problem, solution.states)[0])[:21, :21]
    scale = np.sqrt(np.outer(np.diag(P), np.diag(P)))
    assert not solution.cross.any()
    np.testing.assert_allclose(solution.covariance[0] / scale, P / scale, rtol=0, atol=1e-3)


def test_log_evidence_is_that_of_the_dense_gaussian():
    problem = random_problem(10, 12, 3)
    minimum = gauss_newton(problem)
    H, g, cost = dense(problem, minimum.solution.states)
    least = cost - g @ np.linalg.solve(H, g)
    white = np.linalg.slogdet(problem.motion.W)[1].sum() + 12 * np.log(2.0)
    expected = -least / 2 - np.linalg.slogdet(H)[1] / 2 + white
    assert minimum.log_evidence == pytest.approx(expected, abs=1e-3)


def test_a_motion_without_log_white_counts_as_constant():
    problem = random_problem(5, 6, 0)

    class Silent:
        t_s, aux = problem.motion.t_s, problem.motion.aux
        linearise, prior = problem.motion.linearise, problem.motion.prior

    less = gauss_newton(replace(problem, motion=Silent())).log_evidence
    white = np.linalg.slogdet(problem.motion.W)[1].sum()
    assert gauss_newton(problem).log_evidence - less == pytest.approx(white, abs=1e-9)


@pytest.mark.parametrize(
    ("columns", "aux", "name"),
    [
        (slice(0, 3), 6, "attitude"),
        (slice(3, 6), 6, "position"),
        (slice(12, 15), 6, "gyroscope bias"),
        (slice(18, 21), 12, "angular jerk"),
    ],
)
def test_a_state_that_nothing_measures_is_named_with_its_time(columns, aux, name):
    problem = random_problem(8, aux, 0)
    for sensor in problem.sensors:
        sensor.H[sensor.row >= 5, :, columns] = 0.0
    motion = problem.motion
    motion.F[4:, :, columns] = motion.F[4:, columns] = 0.0
    motion.W[4:, :, columns] = motion.W[4:, columns] = 0.0
    with pytest.raises(NoSolutionError, match=rf"{name}: the data do not determine it at 1\.25 s"):
        gauss_newton(problem)


def test_residuals_that_are_not_finite_are_an_error():
    problem = random_problem(8, 6, 0)
    problem.sensors[0].z[3] = np.nan
    with pytest.raises(NoSolutionError, match="residuals are not finite at"):
        gauss_newton(problem)


def test_a_long_dead_reckoning_keeps_its_digits():
    """Position known to 1 km, then a hundred intervals of a tenth of a micrometre each.

    GTSAM's prior of a pose takes rotation and position together, within a hundredth.
    """
    problem = random_problem(100, 6, 0)
    motion = problem.motion
    D = 15
    motion.F[:], motion.u[:], motion.W[:] = np.eye(D), 0.0, 1e7 * np.eye(D)
    for sensor in problem.sensors:
        sensor.H[:, :, 3:6] = 0.0
    solution = gauss_newton(problem).solution
    sigma = np.sqrt(np.einsum("nii->ni", solution.covariance)[:, 3:6])
    np.testing.assert_allclose(sigma, 1e3, rtol=1e-2)
