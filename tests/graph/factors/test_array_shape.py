import numpy as np
import pytest

from fgnav.graph.factors.array_phase import ArrayPhase
from fgnav.graph.factors.array_shape import ArrayShape
from tests.graph.factors import cases

K, A = 3, 4


def shapes(rng, shared, columns) -> ArrayShape:
    return ArrayShape(
        row=np.arange(K),
        root=100 * rng.normal(size=(K, 3 * A, 3 * A)),
        minimum_n_m=rng.normal(size=(K, A, 3)),
        baselines_b_m=rng.normal(size=(A, 3)),
        column=np.array(columns),
        constants=shared,
    )


@pytest.mark.parametrize("gyroscope", [False, True])
def test_jacobians_equal_differences(gyroscope):
    rng, shared = np.random.default_rng(1), cases.constants(3, 2, 3)
    at = cases.random_states(K, shared, rng, gyroscope=gyroscope)
    cases.assert_jacobians(shapes(rng, shared, [-1, 0, -1, 5]), at)


@pytest.mark.parametrize("columns", [[-1, 0, -1, 5], [-1, -1, -1, -1]])
def test_gtsam_says_the_same(columns):
    rng, shared = np.random.default_rng(2), cases.constants(3, 2, 3)
    at = cases.random_states(K, shared, rng)
    cases.assert_gtsam_says_the_same(shapes(rng, shared, columns), at, shared)


def test_an_array_of_known_shape_is_a_form_of_the_rotation():
    """vec(R) enters the baselines linearly: root of the one, times that, is root of the other."""
    rng, shared = np.random.default_rng(3), cases.constants()
    at = cases.random_states(K, shared, rng)
    shape = shapes(rng, shared, [-1] * A)
    minimum = cases.random_states(K, shared, rng).R_nb
    exact = ArrayShape(
        row=shape.row,
        root=shape.root,
        minimum_n_m=np.einsum("nij,aj->nai", minimum, shape.baselines_b_m),
        baselines_b_m=shape.baselines_b_m,
        column=shape.column,
        constants=shared,
    )
    by_rotation = np.einsum("ij,bc->bijc", np.eye(3), shape.baselines_b_m).reshape(3 * A, 9)
    upper = np.linalg.qr(shape.root @ by_rotation)[1]
    rotation = ArrayPhase(
        row=shape.row,
        root=upper,
        minimum=minimum,
        element_column=np.full(K, -1),
        constants=shared,
    )
    one, other = exact.linearise(at, np.arange(K)), rotation.linearise(at, np.arange(K))
    np.testing.assert_allclose(
        np.square(one.value).sum(1), np.square(other.value).sum(1), rtol=1e-10
    )
    hessians = [part.state.swapaxes(1, 2) @ part.state for part in (one, other)]
    np.testing.assert_allclose(*hessians, rtol=0, atol=1e-10 * np.abs(hessians[0]).max())
