from dataclasses import replace

import numpy as np
import pytest

from fgnav.graph.factors.velocity import Velocity
from tests.graph.factors import cases

K = 4
EARTH_N_RADPS = np.array([5e-2, 0.0, -4e-2])  # a thousand times the Earth's: so that it is seen


def velocities(rng, shared, *, gyroscope: bool, lever: bool = False, arm: bool = True) -> Velocity:
    return Velocity(
        row=np.arange(K),
        value_n_mps=10 * rng.normal(size=(K, 3)),
        white=np.tril(rng.normal(size=(K, 3, 3))) + 2 * np.eye(3),
        arm_b_m=rng.normal(size=3) if arm else np.zeros(3),
        measured_b_radps=rng.normal(size=(K, 3)) if gyroscope else None,
        earth_rate_n_radps=EARTH_N_RADPS,
        lever_column=shared.column("b") if lever else -1,
        constants=shared,
    )


@pytest.mark.parametrize("gyroscope", [False, True])
@pytest.mark.parametrize(("lever", "arm"), [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_derivatives_are_differences_and_gtsam_says_the_same(gyroscope, lever, arm):
    rng, shared = np.random.default_rng(1), cases.constants(1, 3)
    at = cases.random_states(K, shared, rng, gyroscope=gyroscope)
    part = velocities(rng, shared, gyroscope=gyroscope, lever=bool(lever), arm=bool(arm))
    cases.assert_factor(part, at, shared)


def test_a_turn_to_the_right_moves_an_antenna_ahead_to_the_right():
    shared = cases.constants()
    at = cases.random_states(1, shared, np.random.default_rng(3))
    aux = np.zeros((1, 12))
    aux[0, 5] = 1.0  # rad/s about down
    at = at._replace(R_nb=np.eye(3)[None], v_n_mps=np.zeros((1, 3)), aux=aux)
    one = Velocity(
        row=np.zeros(1, dtype=int),
        value_n_mps=np.array([[0.0, 2.0, 0.0]]),
        white=np.eye(3)[None],
        arm_b_m=np.array([2.0, 0.0, 0.0]),
        measured_b_radps=None,
        earth_rate_n_radps=np.zeros(3),
        lever_column=-1,
        constants=shared,
    )
    assert np.abs(one.linearise(at, np.zeros(1, dtype=int)).value).max() < 1e-15


def test_a_body_that_turns_with_the_earth_has_no_swing():
    shared, rng = cases.constants(), np.random.default_rng(4)
    at = cases.random_states(K, shared, rng, gyroscope=True)
    at = at._replace(aux=np.zeros((K, 6)))
    part = velocities(rng, shared, gyroscope=True)
    turning_b = np.einsum("nji,j->ni", at.R_nb, EARTH_N_RADPS)
    part = replace(part, measured_b_radps=turning_b)
    apart = np.einsum("nij,nj->ni", part.white, at.v_n_mps - part.value_n_mps)
    value = part.linearise(at, np.arange(K)).value
    np.testing.assert_allclose(value, apart, rtol=0, atol=1e-12)
