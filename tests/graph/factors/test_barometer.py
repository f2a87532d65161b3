import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.graph.factors.barometer import BarometricHeight
from tests.graph.factors import cases

K = 4


def heights(rng, shared, *, offset: bool = True, sigma_m: float = 0.4) -> BarometricHeight:
    return BarometricHeight(
        row=np.arange(K),
        down_n_m=50 * rng.normal(size=K),
        sigma_m=sigma_m,
        arm_b_m=rng.normal(size=3),
        column=shared.column("b") if offset else -1,
        node=np.array([0, 0, 1, 2]),
        share=np.array([0.0, 0.4, 0.9, 0.0]),
        constants=shared,
    )


@pytest.mark.parametrize("gyroscope", [False, True])
@pytest.mark.parametrize("offset", [False, True])
def test_derivatives_are_differences_and_gtsam_says_the_same(gyroscope, offset):
    rng, shared = np.random.default_rng(1), cases.constants(2, 3)
    at = cases.random_states(K, shared, rng, gyroscope=gyroscope)
    cases.assert_factor(heights(rng, shared, offset=offset), at, shared)


def test_between_two_nodes_the_offset_lies_on_a_straight_line():
    rng, shared = np.random.default_rng(3), cases.constants(2, 3)
    at = cases.random_states(K, shared, rng)
    part = heights(rng, shared)
    none = at._replace(constants=np.zeros(5))
    some = at._replace(constants=np.array([0.0, 0.0, 1.0, 2.0, 4.0]))
    which = np.arange(K)
    taken_m = 0.4 * (part.linearise(none, which).value - part.linearise(some, which).value)[:, 0]
    np.testing.assert_allclose(taken_m, [1.0, 1.4, 3.8, 4.0], rtol=0, atol=1e-12)


def test_a_sigma_of_zero_is_refused():
    with pytest.raises(BadInputError, match="barometric height sigma_m: must be positive"):
        heights(np.random.default_rng(4), cases.constants(2, 3), sigma_m=0.0)
