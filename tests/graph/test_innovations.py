from types import SimpleNamespace

import gtsam
import numpy as np
import pytest

from fgnav.graph import keys
from fgnav.graph.build import Layout
from fgnav.graph.custom import named, residual_factor
from fgnav.graph.factors.array_phase import ArrayPhase
from fgnav.graph.factors.position import LEVER_ARM, Position
from fgnav.graph.innovations import (
    custom_innovations,
    innovation_series,
    normalised_innovations,
)
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import POSITION
from tests.graph.factors import cases, sensors

N, D = 5, 21


def random_covariances(rng, n, d):
    root = rng.normal(size=(n, d, d + 2))
    return root @ root.swapaxes(1, 2) / d


def solution_of(rng, shared, *, scale: float = 1e-4) -> Solution:
    """Return random states, their covariances with each other and the constants random too."""
    b, at = shared.width, cases.random_states(N, rng, shared)
    joint = scale * random_covariances(rng, 1, N * D + b)[0]
    own = np.array([joint[D * k : D * k + D, D * k : D * k + D] for k in range(N)])
    beside = [joint[D * k : D * k + D, D * k + D : D * k + 2 * D] for k in range(N - 1)]
    return Solution(
        states=at,
        covariance=own,
        cross=np.array(beside),
        constant_covariance=np.tile(joint[N * D :, N * D :], (N, 1, 1)),
        constant_cross=joint[: N * D, N * D :].reshape(N, D, b),
        converged=True,
    )


def summaries(problem, solution):
    """Return the statistics of every sensor."""
    return [one.summary for one in innovation_series(problem, solution)]


def custom_summary(factors, problem, solution):
    """Return the statistic of the only name among custom factors."""
    (series,) = custom_innovations(factors, Layout.of(problem), problem.t_s, solution)
    return series.summary


def problem_of(solution, shared, *measurements) -> Problem:
    return Problem(
        t_s=np.arange(float(len(solution.covariance))),
        start=solution.states,
        motion=SimpleNamespace(aux=12),
        sensors=measurements,
        constants=shared,
        attitude_known=np.ones(N, dtype=bool),
    )


def positions(at, shared, rng, *, sigma_m: float = 1.0, lever: bool = False) -> Position:
    return Position(
        row=np.arange(N),
        value_n_m=at.p_n_m + sigma_m * rng.normal(size=(N, 3)),
        white=np.tile(np.eye(3) / sigma_m, (N, 1, 1)),
        arm_b_m=np.zeros(3),
        constants=shared if lever else Parameters(),
    )


def test_the_deletion_residual_is_the_innovation_of_what_was_known_without_it():
    """One measurement and a Gaussian prior, solved by hand: the same number before and after."""
    rng, shared = np.random.default_rng(1), Parameters()
    before = solution_of(rng, shared, scale=1.0)
    part = positions(before.states, shared, rng)
    r, J, _ = part.linearise(before.states, part.row)
    S = J @ before.covariance @ J.swapaxes(1, 2) + np.eye(3)
    expected = np.einsum("ki,kij,kj->k", r, np.linalg.inv(S), r)
    P = np.linalg.inv(np.linalg.inv(before.covariance) + J.swapaxes(1, 2) @ J)
    step = -np.einsum("kij,kmj,km->ki", P, J, r)
    turnless = step.copy()
    turnless[:, :3] = 0.0  # positions do not depend on it: exact
    after = Solution(
        states=before.states.moved(turnless, np.empty(0)),
        covariance=P,
        cross=None,
        constant_covariance=np.empty((N, 0, 0)),
        constant_cross=np.empty((N, D, 0)),
        converged=True,
    )
    found = normalised_innovations(part, after)
    np.testing.assert_allclose(found.squared, expected, rtol=1e-8)
    assert found.tested.all()


def test_constants_that_a_measurement_depends_on_count():
    rng, shared = np.random.default_rng(2), sensors.constants("another", LEVER_ARM)
    solution = solution_of(rng, shared, scale=0.02)
    part = positions(solution.states, shared, rng, lever=True)
    r, state, by_constants = part.linearise(solution.states, part.row)
    J = np.concatenate([state, by_constants], axis=2)
    P = np.block(
        [
            [solution.covariance, solution.constant_cross],
            [solution.constant_cross.swapaxes(1, 2), solution.constant_covariance],
        ]
    )
    S = np.eye(3) - J @ P @ J.swapaxes(1, 2)
    expected = np.einsum("ki,kij,kj->k", r, np.linalg.inv(S), r)
    np.testing.assert_allclose(normalised_innovations(part, solution).squared, expected, rtol=1e-9)


def test_nine_rows_of_three_degrees_of_freedom_are_three():
    """Phases of right noise about attitudes known beside them: NIS of one for each."""
    rng, shared, n = np.random.default_rng(3), Parameters(), 4000
    sigma_rad, size = 0.01, np.array([300.0, 200.0, 100.0])  # in sigmas per rad
    at = cases.random_states(n, rng, shared)
    moved = at.moved(np.pad(sigma_rad * rng.normal(size=(n, 3)), ((0, 0), (0, 18))), np.empty(0))
    root = np.zeros((n, 9, 9))
    root[:, np.arange(9), np.arange(9)] = np.repeat(size, 3)
    noise = np.einsum("nij,nj->ni", np.linalg.inv(root), rng.normal(size=(n, 9)))
    part = ArrayPhase(
        row=np.arange(n),
        root=root,
        minimum=at.R_nb + noise.reshape(n, 3, 3),
        stretch=np.full(n, -1),
    )
    r, J, _ = part.linearise(moved, part.row)
    information = J[:, :, :3].swapaxes(1, 2) @ J[:, :, :3] + np.eye(3) / sigma_rad**2
    P = np.zeros((n, D, D))
    P[:, :3, :3] = np.linalg.inv(information)
    P[:, range(3, D), range(3, D)] = 1.0
    step = np.zeros((n, D))
    step[:, :3] = -np.einsum("kij,kmj,km->ki", P[:, :3, :3], J[:, :, :3], r)
    known = Solution(
        states=moved.moved(step, np.empty(0)),
        covariance=P,
        cross=None,
        constant_covariance=np.empty((n, 0, 0)),
        constant_cross=np.empty((n, D, 0)),
        converged=True,
    )
    told = summaries(problem_of(known, shared, part), known)[0]
    assert told.what == "array phases"
    assert told.freedom == 9 * n
    assert told.nis == pytest.approx(1.0, abs=4 * np.sqrt(2 / told.freedom))
    assert told.beyond_99 == pytest.approx(0.01, abs=4 * np.sqrt(0.01 / n))
    assert sum(told.deciles) == n
    # A tenth in each: of 4000, 400 with a standard deviation of 19.
    np.testing.assert_allclose(told.deciles, n / 10, rtol=0, atol=4 * np.sqrt(0.09 * n))


def test_a_measurement_that_alone_says_what_it_says_tests_nothing():
    rng, shared = np.random.default_rng(4), Parameters()
    solution = solution_of(rng, shared)
    part = positions(solution.states, shared, rng)
    P = solution.covariance.copy()
    P[2] = 1e3 * np.eye(D)
    P[2, POSITION, POSITION] = np.eye(3)  # exactly what the position at keyframe 2 gives
    alone = Solution(
        states=solution.states,
        covariance=P,
        cross=None,
        constant_covariance=solution.constant_covariance,
        constant_cross=solution.constant_cross,
        converged=True,
    )
    found = normalised_innovations(part, alone)
    assert found.tested.tolist() == [True, True, False, True, True]
    assert summaries(problem_of(alone, shared, part), alone)[0].count == 4


def test_a_singular_covariance_is_no_obstacle():
    rng, shared = np.random.default_rng(5), Parameters()
    solution = solution_of(rng, shared)
    solution.covariance[:] = 0.0
    part = positions(solution.states, shared, rng)
    r = part.linearise(solution.states, part.row).value
    squared = normalised_innovations(part, solution).squared
    np.testing.assert_allclose(squared, (r**2).sum(axis=1), rtol=1e-12)


def test_measurements_of_one_name_are_told_together():
    rng, shared = np.random.default_rng(6), Parameters()
    solution = solution_of(rng, shared)
    both = (positions(solution.states, shared, rng), positions(solution.states, shared, rng))
    told = summaries(problem_of(solution, shared, *both), solution)
    assert [one.what for one in told] == ["position"]
    assert told[0].count == 2 * N


def test_a_factor_of_ones_own_is_judged_as_the_measurement_it_is():
    rng, shared = np.random.default_rng(7), sensors.constants("another", LEVER_ARM)
    solution = solution_of(rng, shared, scale=0.02)
    part = positions(solution.states, shared, rng, lever=True)
    own = [
        residual_factor(
            "mine",
            [keys.pose(k), keys.constant(1)],
            lambda x, arm, k=k: x.transformFrom(arm) - part.value_n_m[k],
            1.0,
            dimension=3,
        )
        for k in range(N)
    ]
    problem = problem_of(solution, shared, part)
    mine, theirs = custom_summary(own, problem, solution), summaries(problem, solution)[0]
    assert mine.what == "mine"
    assert (mine.count, mine.freedom) == (theirs.count, theirs.freedom)
    assert mine.nis == pytest.approx(theirs.nis, rel=1e-6)
    assert mine.beyond_99 == theirs.beyond_99


def test_a_factor_between_neighbours_is_judged_by_their_common_covariance():
    rng, shared = np.random.default_rng(8), sensors.constants("another")
    solution = solution_of(rng, shared, scale=0.05)
    noise = gtsam.noiseModel.Unit.Create(3)
    v = solution.states.v_n_mps
    factor = gtsam.BetweenFactorVector(
        keys.velocity(1), keys.velocity(2), v[2] - v[1] + [1.0, 0.0, 0.0], noise
    )
    own = [named(factor)]
    P, C = solution.covariance[:, 6:9, 6:9], solution.cross[1, 6:9, 6:9]
    S = np.eye(3) - (P[1] + P[2] - C - C.T)
    told = custom_summary(own, problem_of(solution, shared), solution)
    assert told.what == "BetweenFactorVector"
    assert 3 * told.nis == pytest.approx(np.linalg.inv(S)[0, 0], rel=1e-9)


def test_a_factor_of_distant_keyframes_has_the_mean_square_of_its_residual():
    rng, shared = np.random.default_rng(9), sensors.constants("another")
    solution = solution_of(rng, shared)
    v, noise = solution.states.v_n_mps, gtsam.noiseModel.Isotropic.Sigma(3, 0.5)
    far = gtsam.BetweenFactorVector(
        keys.velocity(0), keys.velocity(3), v[3] - v[0] + [1.0, 0.0, 0.0], noise
    )
    told = custom_summary([named(far)], problem_of(solution, shared), solution)
    assert told.nis == pytest.approx(4 / 3, rel=1e-9)


def test_a_factor_of_constants_alone_is_judged_by_their_covariance():
    rng, shared = np.random.default_rng(10), sensors.constants("another")
    solution = solution_of(rng, shared, scale=0.05)
    mean = solution.states.constants + np.array([1.0, 0.0])
    own = gtsam.PriorFactorVector(keys.constant(0), mean, gtsam.noiseModel.Unit.Create(2))
    S = np.eye(2) - solution.constant_covariance[0]
    told = custom_summary([named(own)], problem_of(solution, shared), solution)
    assert 2 * told.nis == pytest.approx(np.linalg.inv(S)[0, 0], rel=1e-9)
