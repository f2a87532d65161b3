"""The likelihood of the truth under a chain's posterior, and its gradient by given measurements."""

import dataclasses
import tracemalloc

import numpy as np
import pytest

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.solve.chain.sensitivity import Judged, LinearisedFlight
from tests.solve.chain.linear_flight import dense, random_problem

N = 12
STEP = 1e-5


def drawn(seed):
    """Return a linearised flight and what is given and judged: keyframes twice, none, in disorder.

    States are with and without constants and biases; errors are a few of the posterior's sigmas.
    """
    rng = np.random.default_rng(seed)
    problem = random_problem(N, aux=3 * (seed % 3), b=seed % 4, seed=seed)
    m, f, D = 5, 1 + seed % 3, problem.width
    row, root = rng.integers(0, N, m), rng.normal(size=(m, f, f))
    covariance = root @ root.swapaxes(1, 2) + 0.3 * np.eye(f)
    judged_row = np.sort(rng.choice(N, 7, replace=False))
    which = np.array([[0, 1, 2], [0, 1, 2, 6, 7, 8], [2]][seed % 3])
    judged = Judged(judged_row, which, 0.3 * rng.normal(size=(7, len(which))))
    given = (row, rng.normal(size=(m, f, D)), rng.normal(size=(m, f)), covariance)
    return problem, given, judged


@pytest.mark.parametrize("seed", range(20))
def test_the_gradient_is_that_of_differences(seed):
    problem, (row, jacobian, residual, covariance), judged = drawn(seed)
    flight = LinearisedFlight.at(problem, problem.start)

    def slope(dr, dC):
        ends = (
            flight.likelihood(row, jacobian, residual + h * dr, covariance + h * dC, judged).nll
            for h in (STEP, -STEP)
        )
        return np.subtract(*ends) / (2 * STEP)

    found = flight.likelihood(row, jacobian, residual, covariance, judged)
    by_residual, by_covariance = np.zeros_like(residual), np.zeros_like(covariance)
    for at in np.ndindex(*residual.shape):
        one = np.zeros_like(residual)
        one[at] = 1.0
        by_residual[at] = slope(one, 0.0)
    for k, i, j in np.ndindex(*covariance.shape):
        one = np.zeros_like(covariance)
        one[k, i, j] += 0.5
        one[k, j, i] += 0.5
        by_covariance[k, i, j] = slope(0.0, one)
    for exact, differences in (
        (found.by_residual, by_residual),
        (found.by_covariance, by_covariance),
    ):
        assert np.linalg.norm(exact - differences) < 1e-6 * np.linalg.norm(differences)


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_the_likelihood_is_that_of_the_dense_posterior(seed):
    problem, (row, jacobian, residual, covariance), judged = drawn(seed)
    H, g, _ = dense(problem, problem.start)
    D = problem.width
    for k, J, r, W in zip(row, jacobian, residual, np.linalg.inv(covariance), strict=True):
        own = slice(k * D, k * D + D)
        H[own, own] += J.T @ W @ J
        g[own] += J.T @ W @ r
    P, mean = np.linalg.inv(H), -np.linalg.solve(H, g)
    expected = []
    for k, step in zip(judged.row, judged.step, strict=True):
        own = k * D + judged.which
        e, C = mean[own] - step, P[np.ix_(own, own)]
        chi2 = e @ np.linalg.solve(C, e)
        expected.append((chi2 + np.linalg.slogdet(2 * np.pi * C)[1]) / 2)
    flight = LinearisedFlight.at(problem, problem.start)
    found = flight.likelihood(row, jacobian, residual, covariance, judged)
    assert found.nll == pytest.approx(np.mean(expected), rel=1e-9)
    own = judged.row[0] * D + judged.which
    np.testing.assert_allclose(found.covariance[0], P[np.ix_(own, own)], rtol=1e-7, atol=1e-12)


def test_memory_grows_with_the_number_of_keyframes_and_no_faster():
    peaks = []
    for n in (300, 1200):
        problem = random_problem(n, aux=6, b=2)
        flight = LinearisedFlight.at(problem, problem.start)
        given = (np.zeros(1, np.int64), np.ones((1, 1, 15)), np.ones((1, 1)), np.ones((1, 1, 1)))
        judged = Judged(np.arange(n), np.arange(3), np.zeros((n, 3)))
        flight.likelihood(*given, judged)  # what compiling takes
        tracemalloc.start()
        flight.likelihood(*given, judged)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] == pytest.approx(4 * peaks[0], rel=0.05)


def test_a_state_that_is_left_open_is_named():
    problem, (row, jacobian, residual, covariance), judged = drawn(2)
    flight = LinearisedFlight.at(problem, problem.start)
    flight.links.node[:] = 0.0
    flight.links.motion[:] = 0.0
    with pytest.raises(NoSolutionError, match=r"at 0\.00 s"):
        flight.likelihood(row, jacobian, residual, covariance, judged)


def test_phases_with_ambiguities_are_refused():
    problem = dataclasses.replace(random_problem(4, aux=3, b=0), phase=object())
    with pytest.raises(BadInputError, match="carrier phase of single antennas is not differentiat"):
        LinearisedFlight.at(problem, problem.start)
