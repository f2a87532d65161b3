import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry import rotations
from fgnav.geometry.earth import EARTH_RATE_RADPS, Origin
from fgnav.gravity import LowDynamics, specific_force_pair
from fgnav.types.flight import Flight
from tests.imu import imu_of

ORIGIN = Origin(latitude_rad=0.7, longitude_rad=-0.07, height_m=700.0)
G_N_MPS2 = ORIGIN.gravity_n_mps2(np.zeros((2, 3)))[0]


def imu(t_s, f_b_mps2):
    return imu_of(t_s, f_b_mps2)


def flight(t_s, f_b_mps2):
    return Flight(name="bench", start_gps_s=0.0, origin=ORIGIN, imu=imu(t_s, f_b_mps2))


def resting(roll_rad, pitch_rad, seconds):
    t_s = np.arange(0, seconds, 0.01)
    R_nb = rotations.from_euler(*np.array([[roll_rad], [pitch_rad], [0.4]]))[0]
    return t_s, np.repeat(-G_N_MPS2[None] @ R_nb, len(t_s), axis=0), R_nb.T @ G_N_MPS2


def test_a_still_accelerometer_shows_the_direction_of_gravity():
    t_s, f_b_mps2, g_b = resting(0.3, -0.2, 2.0)
    answer = LowDynamics()(flight(t_s, f_b_mps2))
    assert len(answer.t_s) == 4
    np.testing.assert_allclose(answer.t_s, [0.245, 0.745, 1.245, 1.745], atol=1e-9)
    np.testing.assert_allclose(answer.g_b, [g_b / np.linalg.norm(g_b)] * 4, atol=1e-12)
    assert answer.unused == ()


def test_covariance_lies_across_gravity_and_states_unmodelled_acceleration():
    t_s, f_b_mps2, _ = resting(0.3, -0.2, 1.0)
    answer = LowDynamics(acceleration_mps2=0.5)(flight(t_s, f_b_mps2))
    np.testing.assert_allclose(answer.covariance[0] @ answer.g_b[0], 0, atol=1e-15)
    sigma_rad = np.sqrt(np.trace(answer.covariance[0]) / 2)
    assert np.degrees(sigma_rad) == pytest.approx(2.93, abs=0.02)


def test_free_fall_and_shaking_are_counted_gaps():
    t_s, f_b_mps2, _ = resting(0.0, 0.0, 3.0)
    f_b_mps2[:100] = 0.0
    f_b_mps2[100:200, 0] = np.where(np.arange(100) % 2, 2.0, -2.0)
    answer = LowDynamics()(flight(t_s, f_b_mps2))
    np.testing.assert_allclose(answer.t_s, [2.245, 2.745], atol=1e-9)
    assert {loss.reason: loss.count for loss in answer.unused} == {
        "size is not that of gravity": 2,
        "samples are not steady": 2,
    }


def test_a_pause_of_the_recorder_makes_no_window():
    t_s, f_b_mps2, _ = resting(0.0, 0.0, 2.0)
    answer = LowDynamics()(flight(t_s + 10.0 * (t_s >= 0.995), f_b_mps2))
    np.testing.assert_allclose(answer.t_s, [0.245, 0.745, 11.245, 11.745], atol=1e-9)


def test_gravity_without_accelerometer_is_refused():
    empty = Flight(name="empty", start_gps_s=0.0, origin=ORIGIN)
    with pytest.raises(BadInputError, match=r"flight empty: low-dynamics gravity needs an \[imu\]"):
        LowDynamics()(empty)


def test_a_window_of_no_length_is_rejected():
    with pytest.raises(BadInputError, match="low dynamics window_s: must be positive, got 0"):
        LowDynamics(window_s=0.0)


def test_specific_force_is_one_vector_in_two_frames_in_a_climbing_turn():
    R_nb = rotations.from_euler(*np.array([[0.5], [0.2], [1.0]]))[0]
    t_s, fine_s = np.arange(0.0, 5.05, 0.1), np.arange(-0.1, 5.2, 0.01)
    rate, speed = 0.3, 30.0

    def v_n_mps(t):
        return np.column_stack([speed * np.cos(rate * t), speed * np.sin(rate * t), -2 * t])

    def a_n_mps2(t):
        turn = rate * speed * np.column_stack([-np.sin(rate * t), np.cos(rate * t)])
        return np.column_stack([turn, np.full(len(t), -2.0)])

    p_n_m = np.zeros((len(t_s), 3))
    earth_n = ORIGIN.earth_rate_n_radps
    f_n_mps2 = a_n_mps2(fine_s) + 2 * np.cross(earth_n, v_n_mps(fine_s)) - G_N_MPS2
    f_n, f_b = specific_force_pair(imu(fine_s, f_n_mps2 @ R_nb), ORIGIN, t_s, p_n_m, v_n_mps(t_s))
    assert np.isnan(f_n[[0, -1]]).all()
    # Both cover the same span; what is left is the trapezoid rule and the noise-free Coriolis mean.
    np.testing.assert_allclose(f_b[1:-1] @ R_nb.T, f_n[1:-1], rtol=0, atol=1e-4)
    assert 2 * EARTH_RATE_RADPS * speed > 10 * 1e-4  # so the Coriolis term is seen


def test_specific_force_needs_the_accelerometer_on_both_sides():
    t_s = np.arange(0.0, 1.0, 0.1)
    samples_s = np.arange(0.25, 0.75, 0.01)
    f_b_mps2 = np.repeat(-G_N_MPS2[None], len(samples_s), axis=0)
    zero = np.zeros((len(t_s), 3))
    f_n, f_b = specific_force_pair(imu(samples_s, f_b_mps2), ORIGIN, t_s, zero, zero)
    np.testing.assert_array_equal(np.isfinite(f_b[:, 0]).nonzero()[0], [4, 5, 6])
    np.testing.assert_allclose(f_n[1:-1], [-G_N_MPS2] * 8, atol=1e-12)


def test_two_epochs_make_no_acceleration():
    t_s = np.array([0.0, 0.1])
    samples_s = np.arange(-1.0, 1.0, 0.01)
    f_b_mps2 = np.zeros((len(samples_s), 3))
    zero = np.zeros((2, 3))
    pair = specific_force_pair(imu(samples_s, f_b_mps2), ORIGIN, t_s, zero, zero)
    assert np.isnan(pair).all()
