import numpy as np
import pytest

from fgnav import rotations
from fgnav.methods.smoother.keyframes import Timed
from fgnav.methods.smoother.rates import Rates
from tests.methods.smoother.test_gaps import record

T_S = np.arange(0, 9, 0.1)
TURNING = np.array([[0.3, -0.2, 0.1]])
R_NB = rotations.exp(T_S[:, None] * TURNING)
SIGMA_RAD = 0.005


def rates(gyro=False):
    covariance = np.tile(SIGMA_RAD**2 * np.eye(3), (len(T_S), 1, 1))
    return Rates.of(record(gyro=gyro), T_S, R_NB, covariance)


def test_attitudes_of_an_even_turn_tell_its_rate():
    np.testing.assert_allclose(rates().w_b_radps, np.tile(TURNING, (len(T_S), 1)), atol=1e-9)


def test_a_gyroscope_is_believed_rather_than_attitudes():
    told = rates(gyro=True)
    np.testing.assert_allclose(told.w_b_radps[:, 0], np.sin(T_S) / 10, atol=1e-9)
    np.testing.assert_allclose(told.covariance_rad2ps2, 2e-3**2 * np.eye(3))


def test_the_swing_of_an_antenna_is_taken_off_and_its_doubt_added():
    told, arm_b_m = rates(), np.array([1.0, 0.0, 0.0])
    swing_n_mps = np.einsum("nij,nj->ni", R_NB, np.cross(told.w_b_radps, arm_b_m))
    own = np.tile([100.0, 5.0, -2.0], (len(T_S), 1))
    noise = np.tile(0.05**2 * np.eye(3), (len(T_S), 1, 1))
    measured = Timed(value=own + swing_n_mps, covariance=noise, arm_b_m=arm_b_m)
    moved = told.at_accelerometer(measured, R_NB)
    np.testing.assert_allclose(moved.value, own, atol=1e-9)
    assert not moved.arm_b_m.any()
    added = rotations.transpose(R_NB) @ (moved.covariance - noise) @ R_NB
    # Two attitudes half a second apart; nothing along the arm.
    doubt = 2 * SIGMA_RAD**2 / 0.5**2
    np.testing.assert_allclose(
        added, np.tile(np.diag([0, doubt, doubt]), (len(T_S), 1, 1)), atol=1e-9
    )
    assert told.at_accelerometer(None, R_NB) is None


def test_the_first_rate_may_be_three_times_the_usual_and_a_bit():
    slot, sigma = rates().slot(record())
    np.testing.assert_allclose(slot[:, 3:], -np.tile(TURNING, (len(T_S), 1)), atol=1e-9)
    assert sigma[3:] == pytest.approx(np.full(3, 1 + 3 * np.linalg.norm(TURNING)))
    assert sigma[:3] == pytest.approx(np.full(3, 3e-2))


def test_a_gyroscopes_slot_is_its_bias():
    slot, sigma = rates(gyro=True).slot(record(gyro=True))
    assert not slot.any()
    assert sigma[3:] == pytest.approx(np.full(3, 2e-3))
