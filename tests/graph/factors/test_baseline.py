import numpy as np
import pytest

from fgnav.geometry.rotations import from_euler
from fgnav.graph.factors.baseline import BaselineVector
from tests.graph.factors import cases

K = 4


def baselines(rng, shared, dimensions) -> BaselineVector:
    value = rng.normal(size=(K, 3))
    white = np.tril(rng.normal(size=(K, 3, 3))) + 2 * np.eye(3)
    if dimensions == 1:
        value[:, 2] = 0.0
        value /= np.linalg.norm(value, axis=1, keepdims=True)
        white = np.zeros((K, 3, 3))
        white[:, 0] = 20.0 * np.stack([-value[:, 1], value[:, 0], 0 * value[:, 0]], axis=1)
    return BaselineVector(
        row=np.arange(K),
        value_n_m=value,
        white=white,
        baseline_b_m=rng.normal(size=3),
        dimensions=dimensions,
        constants=shared,
    )


@pytest.mark.parametrize("gyroscope", [False, True])
@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_derivatives_are_differences_and_gtsam_says_the_same(gyroscope, dimensions):
    rng, shared = np.random.default_rng(1), cases.constants(3, 3)
    at = cases.random_states(K, shared, rng, gyroscope=gyroscope)
    cases.assert_factor(baselines(rng, shared, dimensions), at, shared)


def test_a_heading_is_off_by_as_much_as_the_body_is_turned_whatever_its_pitch():
    rng, shared = np.random.default_rng(3), cases.constants()
    turned_rad, pitch_rad = np.array([-3.0, -0.2, 0.4, 3.1]), np.array([0.0, 0.5, -1.2, 0.9])
    one = baselines(rng, shared, 1)
    forward = BaselineVector(
        row=one.row,
        value_n_m=one.value_n_m,
        white=one.white,
        baseline_b_m=np.array([0.7, 0.0, 0.0]),
        dimensions=1,
        constants=shared,
    )
    heading_rad = np.arctan2(one.value_n_m[:, 1], one.value_n_m[:, 0])
    at = cases.random_states(K, shared, rng)
    at = at._replace(R_nb=from_euler(np.zeros(K), pitch_rad, heading_rad + turned_rad))
    value = forward.linearise(at, np.arange(K)).value
    np.testing.assert_allclose(value[:, 0], 20.0 * turned_rad, atol=1e-12)
    assert not value[:, 1:].any()
    assert forward.freedom.tolist() == [1] * K
