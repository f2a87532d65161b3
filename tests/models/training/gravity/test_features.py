"""What the gravity networks are given: motions of which each figure is known."""

import numpy as np
import pytest
import torch

from fgnav.geometry import rotations
from fgnav_models.training.gravity.data import angles_deg
from fgnav_models.training.gravity.features import (
    RATE_HZ,
    SAMPLES,
    VELOCITIES,
    VELOCITY_HZ,
    CourseMotion,
    directions,
    inputs,
)

T_S = torch.arange(1 - VELOCITIES, 1).double() / VELOCITY_HZ
GRAVITY_N_MPS2 = np.array([0.0, 0.0, 9.81])


def motion_of(velocity, acceleration, jerk=(0.0, 0.0, 0.0)):
    """Return the motion that velocities have which end so, (1, ...)."""
    v, a, j = (torch.from_numpy(np.array([x], dtype=float)) for x in (velocity, acceleration, jerk))
    v_n_mps = v[:, None] + T_S[None, :, None] * a[:, None]
    return CourseMotion()(v_n_mps + T_S[None, :, None] ** 2 / 2 * j[:, None])


@pytest.mark.parametrize("course_deg", [0.0, 77.0, -140.0])
def test_motion_in_the_course_frame_does_not_know_the_heading(course_deg):
    c, s = np.cos(np.radians(course_deg)), np.sin(np.radians(course_deg))
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    motion = motion_of(R @ [50.0, 0.0, -4.0], R @ [1.0, 2.0, 3.0], R @ [0.5, -1.0, 0.2])
    np.testing.assert_allclose(motion.velocity, [[50.0, 0.0, -4.0]], atol=1e-9)
    np.testing.assert_allclose(motion.acceleration, [[1.0, 2.0, 3.0]], atol=1e-9)
    middle = np.array([1.0, 2.0, 3.0]) - 0.75 * np.array([0.5, -1.0, 0.2])
    np.testing.assert_allclose(motion.mean_acceleration, [middle], atol=1e-9)


def test_a_vertical_flight_has_its_course_north():
    motion = motion_of([0.0, 0.0, -9.0], [0.0, 0.0, 3.0])
    np.testing.assert_allclose(motion.velocity, [[0.0, 0.0, -9.0]], atol=1e-9)
    np.testing.assert_allclose(motion.acceleration, [[0.0, 0.0, 3.0]], atol=1e-9)
    np.testing.assert_allclose(motion.steps[:, :, :2], 0.0, atol=1e-9)


def nose_first(rng, n, force_mps2=8.0):
    """Return windows and down of bodies that keep their attitude, the nose along the velocity."""
    yaw, pitch, roll = rng.uniform(-3, 3, n), rng.uniform(-1, 1, n), rng.uniform(-3, 3, n)
    R_nb = rotations.from_euler(roll, pitch, yaw)
    a_n_mps2 = GRAVITY_N_MPS2 + rng.uniform(-force_mps2, force_mps2, (n, 3))
    f_b = np.einsum("nji,nj->ni", R_nb, a_n_mps2 - GRAVITY_N_MPS2)
    seen = torch.from_numpy(np.repeat(f_b[:, None], SAMPLES, axis=1))
    # So fast that the nose is along the velocity all the while.
    v_n_mps = 1e5 * R_nb[:, None, :, 0] + T_S.numpy()[:, None] * a_n_mps2[:, None]
    return seen, torch.from_numpy(v_n_mps), R_nb[:, 2]


def test_physics_has_down_by_the_pair_and_by_lateral_forces():
    seen, v_n_mps, g_b = nose_first(np.random.default_rng(0), 200)
    pair, rolled, nose, by_force = directions(seen, CourseMotion()(v_n_mps)).unbind(dim=1)
    assert angles_deg(pair.numpy(), g_b).max() < 0.1
    assert angles_deg(rolled.numpy(), g_b).max() < 0.1
    np.testing.assert_allclose(nose[:, 0], g_b[:, 0], atol=1e-3)
    assert angles_deg(by_force.numpy(), -seen[:, -1].numpy()).max() < 1e-3
    assert directions(seen, None).shape == (200, 1, 3)


def test_lateral_forces_show_the_roll_where_they_are_a_thousandth_of_gravity():
    seen, v_n_mps, g_b = nose_first(np.random.default_rng(1), 200, force_mps2=0.01)
    rolled = directions(seen, CourseMotion()(v_n_mps))[:, 1]
    assert np.median(angles_deg(rolled.numpy(), g_b)) < 1.0


def test_left_and_right_exchanged_physics_is_mirrored():
    rng, mirror = np.random.default_rng(2), torch.tensor([1.0, -1.0, 1.0]).double()
    f_b_mps2 = torch.from_numpy(rng.normal(size=(20, SAMPLES, 3)))
    v_n_mps = torch.from_numpy(rng.normal(size=(20, VELOCITIES, 3)) + np.array([30.0, 5.0, -3.0]))
    there, back = (
        directions(f, CourseMotion()(v))
        for f, v in ((f_b_mps2, v_n_mps), (f_b_mps2 * mirror, v_n_mps * mirror))
    )
    np.testing.assert_allclose(there * mirror, back, atol=1e-9)


def test_inputs_are_finite_for_a_body_that_rests_or_falls():
    still = CourseMotion()(torch.zeros((1, VELOCITIES, 3)))
    assert bool(torch.isfinite(inputs(torch.zeros((1, SAMPLES, 3)), still)).all())
    assert pytest.approx(SAMPLES / RATE_HZ) == (VELOCITIES - 1) / VELOCITY_HZ
