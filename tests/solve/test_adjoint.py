"""The likelihood of the truth under a posterior, and its gradient by given measurements."""

import dataclasses
import tracemalloc

import numpy as np
import pytest

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.solve.adjoint import Judged, LinearisedFlight
from tests.solve.linear_flight import dense, random_problem

N = 12
STEP = 1e-5


def drawn(seed):
    """Return a linearised flight and what is given and judged: keyframes twice, none, in disorder.

    States are with and without constants and biases; errors are a few of the posterior's sigmas.
    """
    rng = np.random.default_rng(seed)
    problem = random_problem(N, aux=3 + 3 * (seed % 3), b=seed % 4, seed=seed)
    m, f, D = 5, 1 + seed % 3, problem.width
    row, root = rng.integers(0, N, m), rng.normal(size=(m, f, f))
    covariance = root @ root.swapaxes(1, 2) + 0.3 * np.eye(f)
    judged_row = np.sort(rng.choice(N, 7, replace=False))
    which = np.array([[0, 1, 2], [0, 1, 2, 6, 7, 8], [2]][seed % 3])
    judged = Judged(judged_row, which, 0.3 * rng.normal(size=(7, len(which))))
    given = (row, rng.normal(size=(m, f, D)), rng.normal(size=(m, f)), covariance)
    return problem, given, judged, rng.normal(size=(m, f, problem.constants.width))


@pytest.mark.parametrize("seed", range(20))
def test_the_gradient_is_that_of_differences(seed):
    problem, (row, jacobian, *start), judged, shared = drawn(seed)
    flight = LinearisedFlight.at(problem, problem.start)
    start.append(shared)

    def likelihood(residual, covariance, shared):
        return flight.likelihood(row, jacobian, residual, covariance, judged, shared)

    def slope(which, step):
        ends = [
            likelihood(*(x + h * step if k == which else x for k, x in enumerate(start))).nll
            for h in (STEP, -STEP)
        ]
        return np.subtract(*ends) / (2 * STEP)

    found = likelihood(*start)
    exact = (found.by_residual, found.by_covariance, found.by_shared)
    for which, (x, gradient) in enumerate(zip(start, exact, strict=True)):
        differences = np.zeros_like(x)
        for at in np.ndindex(*x.shape):
            step = np.zeros_like(x)
            step[at] = 1.0
            if which == 1:  # covariances stay symmetric
                step = (step + step.swapaxes(1, 2)) / 2
            differences[at] = slope(which, step)
        bound = 1e-6 * np.linalg.norm(differences)
        assert np.linalg.norm(gradient - differences) <= bound


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_the_likelihood_is_that_of_the_dense_posterior(seed):
    problem, (row, jacobian, residual, covariance), judged, shared = drawn(seed)
    H, g, _ = dense(problem, problem.start)
    D = problem.width
    full = np.concatenate([jacobian, shared], axis=2)
    for k, J, r, W in zip(row, full, residual, np.linalg.inv(covariance), strict=True):
        of = np.concatenate([np.arange(k * D, k * D + D), np.arange(N * D, len(H))])
        H[np.ix_(of, of)] += J.T @ W @ J
        g[of] += J.T @ W @ r
    P, mean = np.linalg.inv(H), -np.linalg.solve(H, g)
    expected = []
    for k, step in zip(judged.row, judged.step, strict=True):
        own = k * D + judged.which
        e, C = mean[own] - step, P[np.ix_(own, own)]
        chi2 = e @ np.linalg.solve(C, e)
        expected.append((chi2 + np.linalg.slogdet(2 * np.pi * C)[1]) / 2)
    flight = LinearisedFlight.at(problem, problem.start)
    found = flight.likelihood(row, jacobian, residual, covariance, judged, shared)
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
    problem, (row, jacobian, residual, covariance), judged, _ = drawn(1)
    flight = LinearisedFlight.at(problem, problem.start)
    for factors in flight.factors:
        factors.clear()
    with pytest.raises(NoSolutionError, match=r"at 0\.00 s"):
        flight.likelihood(row, jacobian, residual, covariance, judged)


def test_phases_with_ambiguities_are_refused():
    problem = dataclasses.replace(random_problem(4, aux=3, b=0), phase=object())
    with pytest.raises(BadInputError, match="carrier phase of single antennas is not differentiat"):
        LinearisedFlight.at(problem, problem.start)
