"""Epochs eliminated one by one, against one dense system of everything."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.gnss import arc_kernel as kernel

N, M, P, ARCS = 6, 9, 4, 3


@pytest.fixture(scope="module")
def equations():
    """Random epochs; the last M // 2 measurements of each belong to arcs, one is missing."""
    rng = np.random.default_rng(3)
    A, y = rng.standard_normal((N, M, P)), rng.standard_normal((N, M))
    weight = rng.uniform(0.5, 2.0, (N, M))
    weight[2, 7] = 0.0
    arc = np.full((N, M), ARCS)
    arc[:, M // 2 :] = rng.integers(0, ARCS, (N, M - M // 2))
    return A, y, weight, arc


def dense(equations, prior=1e-4):
    """Unknowns of all epochs and arcs' constants at once: solution and covariance."""
    A, y, weight, arc = equations
    size = N * P + ARCS
    H, g = np.zeros((size, size)), np.zeros(size)
    H[N * P :, N * P :] = prior * np.eye(ARCS)
    for k in range(N):
        for j in range(M):
            row = np.zeros(size)
            row[k * P : (k + 1) * P] = A[k, j]
            if arc[k, j] < ARCS:
                row[N * P + arc[k, j]] = 1.0
            H += weight[k, j] * np.outer(row, row)
            g += weight[k, j] * y[k, j] * row
    covariance = np.linalg.inv(H)
    return covariance @ g, covariance


def reduced(equations, prior=1e-4):
    A, y, weight, arc = equations
    cofactor = np.empty((N, P, P))
    dilution = kernel.eliminate(A, weight, cofactor)
    H, g = prior * np.eye(ARCS), np.zeros(ARCS)
    kernel.reduce(A, y, weight, cofactor, np.isfinite(dilution), arc, H, g)
    Q = np.zeros((ARCS + 1, ARCS + 1))
    Q[:-1, :-1] = np.linalg.inv(np.tril(H) + np.tril(H, -1).T)
    return cofactor, Q, Q @ np.append(g, 0.0)


def test_constants_are_those_of_the_whole_system(equations):
    x, covariance = dense(equations)
    _, Q, constants = reduced(equations)
    assert_allclose(constants[:-1], x[N * P :], rtol=1e-9, atol=1e-12)
    assert_allclose(Q[:-1, :-1], covariance[N * P :, N * P :], rtol=1e-9, atol=1e-12)


def test_unknowns_and_their_covariance_are_those_of_the_whole_system(equations):
    A, y, weight, arc = equations
    x, covariance = dense(equations)
    cofactor, Q, constants = reduced(equations)
    found, residual = kernel.fit(A, y - constants[arc], weight, cofactor)
    assert_allclose(found, x[: N * P].reshape(N, P), rtol=1e-9, atol=1e-12)
    left = y - constants[arc] - np.einsum("nmp,np->nm", A, found)
    assert_allclose(residual, np.where(weight > 0, left, 0.0), rtol=0, atol=1e-12)
    rows = np.arange(N)
    common = kernel.spread(A, weight, cofactor, rows, arc, Q)
    theirs = np.array([covariance[k * P : k * P + 3, k * P : k * P + 3] for k in rows])
    assert_allclose(cofactor[:, :3, :3] + common, theirs, rtol=1e-9, atol=1e-12)


def test_a_residual_shows_what_least_squares_leaves_of_an_error(equations):
    A, _, weight, _ = equations
    cofactor, _, _ = reduced(equations)
    share = kernel.shares(A, weight, cofactor)
    for k in range(N):
        root = np.sqrt(weight[k])[:, None] * A[k]
        hat = root @ np.linalg.pinv(root)
        assert_allclose(share[k], 1 - np.diag(hat), rtol=0, atol=1e-12)


def test_an_epoch_with_too_little_has_no_position(equations):
    A, _, weight, _ = equations
    poor = weight.copy()
    poor[1, 3:] = 0.0
    flat = A.copy()
    flat[4, :, 2] = flat[4, :, 1]
    cofactor = np.empty((N, P, P))
    assert np.isinf(kernel.eliminate(A, poor, cofactor)[1])
    assert not cofactor[1].any()
    assert not kernel.eliminate(flat, weight, cofactor)[4] < 1e4


def test_an_unknown_that_nothing_speaks_of_takes_no_part(equations):
    A, y, weight, _ = equations
    silent = A.copy()
    silent[:, :, 3] = 0.0
    cofactor, fewer = np.empty((N, P, P)), np.empty((N, 3, 3))
    kernel.eliminate(silent, weight, cofactor)
    kernel.eliminate(np.ascontiguousarray(A[:, :, :3]), weight, fewer)
    assert_allclose(cofactor[:, :3, :3], fewer, rtol=1e-12)
    assert_allclose(kernel.fit(silent, y, weight, cofactor)[0][:, 3], 0.0, atol=1e-15)
