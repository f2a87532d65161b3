"""Integrals over attitudes against quadrature."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.checks import FloatArray
from fgnav.geometry import rotations
from fgnav.integers.array.nearest import nearest
from fgnav.integers.array.volume import log_likelihood

NO_AXIS = np.zeros(3)


def metric(rng: np.random.Generator, values: FloatArray) -> FloatArray:
    axes = np.linalg.qr(rng.normal(size=(len(values), len(values))))[0]
    return (axes * values) @ axes.T


def over_sphere(column: FloatArray, information: FloatArray, n: int = 400) -> float:
    """Log of the integral by 2 pi, from Gauss-Legendre nodes in height and even ones in azimuth."""
    height, weight = np.polynomial.legendre.leggauss(n)
    azimuth = np.arange(2 * n) * np.pi / n
    level = np.sqrt(1 - height**2)[:, None]
    x = np.stack(
        [level * np.cos(azimuth), level * np.sin(azimuth), np.tile(height[:, None], (1, 2 * n))], -1
    )
    cost = np.einsum("abi,ij,abj->ab", x - column, information, x - column)
    parts = np.exp(-0.5 * (cost - cost.min())) * weight[:, None]
    return float(np.log(parts.sum() / (2 * n)) - 0.5 * cost.min())


@pytest.mark.parametrize(
    "values",
    [(900.0, 1100.0, 1200.0), (40.0, 120.0, 5000.0), (3.0, 900.0, 1500.0), (1.0, 2.0, 3.0)],
)
def test_integral_over_the_sphere_is_that_of_quadrature_also_where_it_has_two_peaks(values):
    rng = np.random.default_rng(1)
    for _ in range(5):
        information = metric(rng, np.array(values))
        direction = rotations.exp(rng.normal(size=(1, 3)) * 2)[0, 0]
        column = direction + 2.0 * np.linalg.cholesky(np.linalg.inv(information)) @ rng.normal(
            size=3
        )
        distance, M = nearest(column, information, NO_AXIS)
        found = log_likelihood(column, information, M, distance)
        assert_allclose(found, over_sphere(column, information), rtol=0, atol=0.03)


@pytest.mark.parametrize("rank", [2, 3])
def test_integral_around_an_attitude_is_that_of_quadrature_where_residuals_bend_it(rank):
    rng = np.random.default_rng(2)
    for _ in range(5):
        information = metric(rng, 10 ** rng.uniform(3.0, 3.5, 3 * rank))
        R = rotations.exp(rng.normal(size=(1, 3)))[0]
        columns = R.T[:rank].ravel() + 0.08 * rng.normal(size=3 * rank)
        distance, M = nearest(columns, information, NO_AXIS)
        step = np.linspace(-0.25, 0.25, 41)
        turn = np.stack(np.meshgrid(step, step, step, indexing="ij"), -1).reshape(-1, 3)
        turned = np.einsum("nij,uj->nui", rotations.exp(turn), M.reshape(rank, 3)).reshape(
            -1, 3 * rank
        )
        cost = np.einsum("ni,ij,nj->n", turned - columns, information, turned - columns)
        parts = np.exp(-0.5 * (cost - distance)) * (step[1] - step[0]) ** 3
        # rotation vectors are longer than the turns they stand for: 1 - |w|^2 / 12 of the volume
        parts *= 1 - (turn**2).sum(axis=1) / 12
        quadrature = np.log(parts.sum()) - 0.5 * distance - 1.5 * np.log(2 * np.pi)
        found = log_likelihood(columns, information, M, distance)
        assert_allclose(found, quadrature, rtol=0, atol=0.03)
