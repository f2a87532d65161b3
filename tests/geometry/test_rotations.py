import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fgnav.geometry import rotations
from fgnav.geometry.rotation_kernel import accumulated

vectors = arrays(np.float64, (5, 3), elements=st.floats(-1e3, 1e3))
# From far below the series' border to half a turn: what an exponential must survive.
angles = st.sampled_from([0.0, 1e-12, 1e-7, 1e-6, 1e-3, 1.0, 3.0, np.pi - 1e-6, np.pi])
euler = st.tuples(*[st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)])


@given(vectors, vectors)
def test_skew_is_the_cross_product(a, b):
    got = np.einsum("nij,nj->ni", rotations.skew(a), b)
    assert_allclose(got, np.cross(a, b), rtol=1e-12, atol=1e-9)


@given(angles, st.integers(0, 2**32 - 1))
def test_exponential_and_logarithm_agree_with_scipy_and_undo_each_other(angle, seed):
    axis = np.random.default_rng(seed).normal(size=(4, 3))
    vector = angle * axis / np.linalg.norm(axis, axis=1, keepdims=True)
    R = rotations.exp(vector)
    assert_allclose(R, Rotation.from_rotvec(vector).as_matrix(), atol=1e-12)
    assert_allclose(rotations.exp(rotations.log(R)), R, atol=1e-9)
    assert_allclose(np.linalg.norm(rotations.log(R), axis=1), angle, atol=1e-7)


@given(euler)
def test_euler_angles_are_yaw_then_pitch_then_roll(angles):
    roll, pitch, yaw = (np.array([a]) for a in angles)
    R_nb = rotations.from_euler(roll, pitch, yaw)
    assert_allclose(
        R_nb, Rotation.from_euler("ZYX", [[*yaw, *pitch, *roll]]).as_matrix(), atol=1e-12
    )
    assert_allclose(rotations.to_euler(R_nb)[0], angles, atol=1e-9)


@given(euler)
def test_euler_jacobian_matches_finite_differences(angles):
    R_nb = rotations.from_euler(*np.array([angles]).T)
    step = 1e-7
    ahead = rotations.to_euler(R_nb @ rotations.exp(step * np.eye(3)))
    behind = rotations.to_euler(R_nb @ rotations.exp(-step * np.eye(3)))
    slope = rotations.wrap(ahead - behind) / (2 * step)
    J = rotations.euler_jacobian(R_nb)[0]
    assert_allclose(J, slope.T, rtol=1e-3, atol=1e-5)


def test_sigmas_of_angles_are_those_of_draws_where_the_turn_is_wide():
    rng = np.random.default_rng(4)
    R_nb = rotations.exp(np.array([[0.1, 0.25, -0.2]]))
    axes = np.array([[0.26, 0.0, 0.0], [0.05, 0.001, 0.0], [0.22, 0.0, 0.001]])
    turns = rotations.exp(rng.normal(size=(100_000, 3)) @ axes.T)
    off = rotations.wrap(rotations.to_euler(R_nb @ turns) - rotations.to_euler(R_nb))
    drawn = np.sqrt((off**2).mean(axis=0))
    covariance = (axes @ axes.T)[None]
    linear = rotations.euler_jacobian(R_nb)[0] @ axes
    assert_allclose(rotations.euler_sigma(R_nb, covariance)[0], drawn, rtol=0.08)
    assert np.linalg.norm(linear, axis=1)[1] < 0.6 * drawn[1]
    small = rotations.euler_sigma(R_nb, 1e-6 * covariance)[0]
    assert_allclose(small, 1e-3 * np.linalg.norm(linear, axis=1), rtol=1e-5)
    assert np.isnan(rotations.euler_sigma(R_nb, np.full((1, 3, 3), np.nan))).all()


def test_quaternions_agree_with_scipy_up_to_sign():
    R = Rotation.random(100, rng=np.random.default_rng(1))
    ours, theirs = rotations.quaternion_wxyz(R.as_matrix()), R.as_quat(scalar_first=True)
    assert_allclose(np.abs((ours * theirs).sum(axis=1)), 1, atol=1e-12)


def test_nearest_rotation_beats_its_neighbours_and_is_no_reflection():
    rng = np.random.default_rng(2)
    M = rng.normal(size=(50, 3, 3))
    R = rotations.nearest(M)
    assert_allclose(np.linalg.det(R), 1)
    for turn in rotations.exp(0.1 * rng.normal(size=(20, 3))):
        far, near = (((X - M) ** 2).sum(axis=(1, 2)) for X in (R @ turn, R))
        assert (far >= near - 1e-12).all()


@pytest.mark.parametrize(("angle", "wrapped"), [(np.pi, -np.pi), (-7.0, 2 * np.pi - 7), (0.5, 0.5)])
def test_wrapped_angles_lie_within_half_a_turn(angle, wrapped):
    assert_allclose(rotations.wrap(np.array([angle])), wrapped, atol=1e-12)


@pytest.mark.parametrize("n", [0, 1, 2, 10, 100])
def test_turns_lead_where_their_products_do(n):
    turns_rad = np.random.default_rng(n).standard_normal((n, 3))
    R = rotations.exp(np.array([[0.3, -2.0, 1.0]]))[0]
    found = accumulated(turns_rad, R)
    assert found.shape == (n + 1, 3, 3)
    for k, turn in enumerate([np.eye(3), *rotations.exp(turns_rad)]):
        R = R @ turn
        assert_allclose(found[k], R, rtol=0, atol=1e-13)
