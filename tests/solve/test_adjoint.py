"""A posterior covariance applied twice, against dense inverses, where factors join keyframes."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.graph.build import Layout, flight_values
from fgnav.graph.keys import index
from fgnav.neural.manifest import Covariance
from fgnav.neural.outputs import Counted, factor_of
from fgnav.solve.adjoint import PosteriorCovariance, terms_of
from fgnav.solve.gauss_newton import elimination_at
from tests.neural import graphs
from tests.solve.linear_flight import dense, random_problem

N, JOINS = 12, ((0, 4), (3, 7), (5, 6), (5, 11))
NOISE = Covariance(form="none", sigma=(0.5,))
OUTPUT = graphs.told("moved", "displacement", NOISE, frame="b", over_s=1.0)


@pytest.mark.parametrize(("aux", "b"), [(6, 0), (6, 2), (12, 3)])
def test_adjoints_are_products_with_the_dense_inverse(aux, b):
    problem, rng = random_problem(N, aux=aux, b=b), np.random.default_rng(b)
    factors = [
        factor_of("moved", OUTPUT, rows, rng.normal(size=3), 0.3 * np.eye(3), Counted()).factor
        for rows in JOINS
    ]
    states, D = problem.start, problem.width
    H, _, _ = dense(problem, states)
    values = flight_values(problem, states)
    for factor in factors:
        rows = np.zeros((3, len(H)))
        linear = factor.linearize(values)
        for key, block in zip(
            factor.keys(), np.split(linear.jacobian()[0], 2, axis=1), strict=True
        ):
            rows[:, index(key) * D : index(key) * D + 6] = block
        H += rows.T @ rows
    P = np.linalg.inv(H)
    found = PosteriorCovariance(
        elimination_at(problem, states, factors), Layout.of(problem), states
    )
    a, B = rng.normal(size=(N, D)), rng.normal(size=(N, D, D))
    B += B.swapaxes(1, 2)
    wide, right = np.zeros_like(P), np.concatenate([a.ravel(), np.zeros(b)])
    for k in range(N):
        wide[k * D : k * D + D, k * D : k * D + D] = B[k]
    adjoint = found.adjoint(a, B, ())
    np.testing.assert_allclose(adjoint.step, -P @ right, rtol=1e-9, atol=1e-11)
    expected = P @ wide @ P
    for pair in (*JOINS, *((k, k + 1) for k in range(N - 1))):
        keyframes, joined = np.array([pair]), np.arange(2 * D + b)
        if pair[1] > pair[0] + 1:  # by their poses alone
            joined = np.concatenate([joined[:D], joined[D : D + 6], joined[2 * D :]])
        columns = adjoint.columns(keyframes)[0][joined]
        step, M = (of[0] for of in adjoint.derivatives(keyframes))
        np.testing.assert_allclose(step[joined], -(P @ right)[columns], rtol=1e-9, atol=1e-11)
        block = M[np.ix_(joined, joined)]
        np.testing.assert_allclose(block, expected[np.ix_(columns, columns)], rtol=1e-8, atol=1e-9)


def test_phases_with_ambiguities_are_rejected():
    problem = replace(random_problem(4, aux=3, b=0), phase=object())
    with pytest.raises(BadInputError, match="carrier phase of single antennas is not differentiat"):
        terms_of(problem)
