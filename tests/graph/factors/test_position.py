import numpy as np
import pytest

from fgnav.graph.factors.position import Position
from tests.graph.factors import cases

K = 4


def positions(rng, shared, *, lever: bool = False) -> Position:
    return Position(
        row=np.arange(K),
        value_n_m=50 * rng.normal(size=(K, 3)),
        white=np.tril(rng.normal(size=(K, 3, 3))) + 2 * np.eye(3),
        arm_b_m=rng.normal(size=3),
        lever_column=shared.column("a") if lever else -1,
        constants=shared,
    )


@pytest.mark.parametrize("gyroscope", [False, True])
@pytest.mark.parametrize("lever", [False, True])
def test_derivatives_are_differences_and_gtsam_says_the_same(gyroscope, lever):
    rng, shared = np.random.default_rng(1), cases.constants(3, 3)
    at = cases.random_states(K, shared, rng, gyroscope=gyroscope)
    cases.assert_factor(positions(rng, shared, lever=lever), at, shared)


def test_an_antenna_two_metres_ahead_is_two_metres_north_of_a_body_facing_north():
    shared = cases.constants()
    at = cases.random_states(1, shared, np.random.default_rng(3))
    at = at._replace(R_nb=np.eye(3)[None], p_n_m=np.zeros((1, 3)))
    one = Position(
        row=np.zeros(1, dtype=int),
        value_n_m=np.array([[2.0, 0.0, 0.0]]),
        white=np.eye(3)[None],
        arm_b_m=np.array([2.0, 0.0, 0.0]),
        lever_column=-1,
        constants=shared,
    )
    assert np.abs(one.linearise(at, np.zeros(1, dtype=int)).value).max() == 0.0


def test_directions_that_are_not_known_are_no_degrees_of_freedom():
    rng, shared = np.random.default_rng(4), cases.constants()
    full = positions(rng, shared)
    white = full.white.copy()
    white[0, 0] = 0.0
    partial = Position(
        row=full.row,
        value_n_m=full.value_n_m,
        white=white,
        arm_b_m=full.arm_b_m,
        lever_column=-1,
        constants=shared,
    )
    assert partial.freedom.tolist() == [2, 3, 3, 3]
    cases.assert_gtsam_says_the_same(partial, cases.random_states(K, shared, rng), shared)
