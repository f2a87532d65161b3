"""Eigenvalues by Jacobi's rotations, against LAPACK's."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.integers.array.principal_axes import principal_axes


@pytest.mark.parametrize("spread", [0.0, 3.0, 12.0])
def test_axes_diagonalise_the_matrix_and_rise(spread):
    rng = np.random.default_rng(3)
    for _ in range(30):
        Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        S = (Q * 10.0 ** rng.uniform(-spread, 0, 3)) @ Q.T
        S = 0.5 * (S + S.T)
        values, axes = principal_axes(S)
        assert (np.diff(values) >= 0).all()
        assert_allclose(axes.T @ axes, np.eye(3), rtol=0, atol=1e-14)
        assert_allclose((axes * values) @ axes.T, S, rtol=0, atol=1e-14)
        assert_allclose(values, np.linalg.eigvalsh(S), rtol=0, atol=1e-14)


def test_a_diagonal_matrix_is_only_sorted():
    values, axes = principal_axes(np.diag([3.0, 1.0, 2.0]))
    assert values.tolist() == [1.0, 2.0, 3.0]
    assert axes.tolist() == [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


def test_nothing_has_the_axes_of_the_frame():
    values, axes = principal_axes(np.zeros((3, 3)))
    assert values.tolist() == [0.0, 0.0, 0.0]
    assert (axes == np.eye(3)).all()
