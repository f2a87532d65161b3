import numpy as np
import pytest
import torch

from fgnav.types.flight import Imu
from fgnav_models.training.gravity.features import SAMPLES, course_motion, differenced, windows


def imu(t_s, f_b_mps2):
    return Imu(
        t_s=t_s,
        f_b_mps2=f_b_mps2,
        accelerometer_noise_mps2_per_sqrt_hz=1e-3,
        accelerometer_bias_mps2=0.03,
        accelerometer_bias_walk_mps2_per_sqrt_s=1e-4,
    )


def test_a_window_ends_at_its_time_and_is_oldest_first():
    t_s = np.arange(200) / 100
    f_b_mps2, covered = windows(imu(t_s, np.stack([t_s, 2 * t_s, -t_s], axis=1)), np.array([1.0]))
    assert covered.all()
    np.testing.assert_allclose(f_b_mps2[0, :, 0], 0.91 + 0.01 * np.arange(SAMPLES), atol=1e-12)
    np.testing.assert_allclose(f_b_mps2[0, :, 2], -f_b_mps2[0, :, 0], atol=1e-12)


def test_windows_beyond_the_record_or_over_a_gap_are_not_covered():
    t_s = np.delete(np.arange(200) / 100, slice(100, 103))
    at_s = np.array([0.05, 0.5, 1.02, 1.05, 1.2, 1.99, 2.1])
    _, covered = windows(imu(t_s, np.zeros((len(t_s), 3))), at_s)
    np.testing.assert_array_equal(covered, [False, True, False, False, True, True, False])


def test_a_record_at_half_the_rate_has_no_windows():
    t_s = np.arange(100) / 50
    assert not windows(imu(t_s, np.zeros((100, 3))), np.array([1.0]))[1].any()


@pytest.mark.parametrize("course_deg", [0.0, 77.0, -140.0])
def test_motion_in_the_course_frame_does_not_know_the_heading(course_deg):
    c, s = np.cos(np.radians(course_deg)), np.sin(np.radians(course_deg))
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    velocity, acceleration = np.array([[50.0, 0, -4.0]]) @ R.T, np.array([[1.0, 2.0, 3.0]]) @ R.T
    motion = course_motion(torch.from_numpy(velocity), torch.from_numpy(acceleration))
    np.testing.assert_allclose(motion, [[50.0, 4.0, 1.0, 2.0, 3.0]], atol=1e-12)


def test_a_vertical_flight_has_its_course_north():
    motion = course_motion(torch.tensor([[0.0, 0, -9.0]]), torch.tensor([[1.0, 2.0, 3.0]]))
    np.testing.assert_allclose(motion, [[0.0, 9.0, 1.0, 2.0, 3.0]])


def test_velocity_of_an_even_acceleration_is_differenced_exactly():
    t_s = np.array([0.0, 0.1, 0.2, 0.3])
    v, a = differenced(t_s, np.outer(t_s, [1.0, -2.0, 3.0]))
    np.testing.assert_allclose(a, [[1.0, -2.0, 3.0]] * 2, atol=1e-12)
    np.testing.assert_allclose(v, np.outer(t_s[1:-1], [1.0, -2.0, 3.0]), atol=1e-12)
