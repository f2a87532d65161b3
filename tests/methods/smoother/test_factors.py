import gtsam
import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav import rotations
from fgnav.attitude import RotationQuadratic
from fgnav.methods.smoother import factors
from fgnav.methods.smoother.directions import across
from tests.attitude.arrays import L1_M, sky, synthetic

X, V = 0, 1
PHASE_M = 0.003


def pose(rng):
    return gtsam.Pose3(gtsam.Rot3(rotations.exp(rng.normal(size=(1, 3)))[0]), rng.normal(size=3))


def values_of(x):
    values = gtsam.Values()
    values.insert(X, x)
    return values


@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_rotation_factor_has_the_cost_and_the_information_of_the_form(missing):
    rng = np.random.default_rng(1)
    R_nb = rotations.exp(rng.normal(size=(1, 3)))
    differences, true = synthetic(R_nb, sky(6, rng), rng, sine=True, missing=missing)
    form = RotationQuadratic.of_double_differences(differences, true)
    factor = factors.rotation_form(X, *(part[0] for part in form.square_root()))
    at, other = (R_nb @ rotations.exp(0.2 * rng.normal(size=(1, 3))) for _ in range(2))
    costs = [
        factor.error(values_of(gtsam.Pose3(gtsam.Rot3(R[0]), np.ones(3)))) for R in (at, other)
    ]
    expected = (form.chi_square(at) - form.chi_square(other)) / 2
    assert_allclose(costs[0] - costs[1], expected, rtol=1e-9)
    J, _ = factor.linearize(values_of(gtsam.Pose3(gtsam.Rot3(at[0]), np.ones(3)))).jacobian()
    assert_allclose((J.T @ J)[:3, :3], form.information_at(at)[0], rtol=1e-9)
    assert not J[:, 3:].any()


def test_rotation_factor_equals_three_vector_factors_where_those_are_exact():
    rng = np.random.default_rng(2)
    R_nb = rotations.exp(rng.normal(size=(1, 3)))
    differences, true = synthetic(R_nb, sky(6, rng), rng, phase_m=PHASE_M)
    form = RotationQuadratic.of_double_differences(differences, true)
    ours = factors.rotation_form(X, *(part[0] for part in form.square_root()))
    # The reduction by a singular value decomposition: three body vectors with one covariance.
    L = differences.baselines_b_m.T
    D = (differences.e_n[0, 1:] - differences.e_n[0, 0]).T
    Y = (differences.phase_m[0] - L1_M * true.cycles[0])[:, 1:]
    Ls = np.linalg.cholesky(np.eye(5) + 1)
    U, S, Vt = np.linalg.svd(D @ np.linalg.inv(Ls).T, full_matrices=False)
    W = np.linalg.inv(np.eye(7) + 1)
    P = np.linalg.inv(L @ W @ L.T)
    M = -P @ L @ W @ (Y @ np.linalg.inv(Ls).T) @ Vt.T
    noise = gtsam.noiseModel.Gaussian.Covariance(PHASE_M**2 * P)
    theirs = gtsam.NonlinearFactorGraph()
    for k in range(3):
        N = S[k] * U[:, k]
        theirs.add(gtsam.MagPoseFactorPose3(X, M[:, k], S[k], N / S[k], np.zeros(3), noise))
    at = values_of(
        gtsam.Pose3(gtsam.Rot3(R_nb[0] @ rotations.exp(np.full((1, 3), 0.1))[0]), np.ones(3))
    )
    J, b = ours.linearize(at).jacobian()
    H, g = theirs.linearize(at).hessian()
    scale = np.abs(H).max()
    assert_allclose(J.T @ J, H, atol=1e-9 * scale)
    assert_allclose(J.T @ b, g, atol=1e-9 * np.abs(g).max())


def test_velocity_is_a_prior():
    factor = factors.velocity(V, np.ones(3), np.eye(3) / 2)
    values = gtsam.Values()
    values.insert(V, np.array([1.0, 1.0, 3.0]))
    assert_allclose(factor.error(values), 0.5)


def test_a_direction_weighs_its_errors_along_the_axes_of_its_covariance():
    """Whatever the attitude: the axes are the body's."""
    rng = np.random.default_rng(3)
    x, down = pose(rng), np.array([0, 0, 9.8])
    e_b = rng.standard_normal(3)
    e_b /= np.linalg.norm(e_b)
    R = x.rotation().matrix()
    across_b = np.array([[50.0], [2.0]]) * across(e_b[None])[0]
    factor = factors.direction(X, down, e_b, across_b)
    apart = across_b @ R.T @ down / 9.8
    assert_allclose(factor.error(values_of(x)), apart @ apart / 2, rtol=1e-12)
    J, b = factor.linearize(values_of(x)).jacobian()
    expected = across_b @ rotations.skew((R.T @ down / 9.8)[None])[0]
    assert_allclose((J.T @ J)[:3, :3], expected.T @ expected, rtol=0, atol=1e-9 * 50**2)
    assert_allclose(J.T @ b, np.concatenate([-expected.T @ apart, np.zeros(3)]), atol=1e-9 * 50**2)


def test_a_bearing_weighs_its_errors_along_the_axes_of_its_covariance():
    rng = np.random.default_rng(5)
    x, landmark = pose(rng), np.array([100.0, 50.0, 5.0])
    u_b = x.rotation().matrix().T @ (landmark - x.translation())
    u_b /= np.linalg.norm(u_b)
    axes = across(u_b[None])[0]
    across_b, errors, values = np.array([[1000.0], [20.0]]) * axes, [], values_of(x)
    values.insert(9, landmark)
    for axis in axes:
        e_b = u_b + 1e-3 * axis
        factor = factors.bearing(X, 9, e_b / np.linalg.norm(e_b), across_b)
        errors.append(np.sqrt(2 * factor.error(values)))
    assert_allclose(errors, [1.0, 0.02], rtol=1e-3)


def test_position_direction_and_bearing_vanish_at_the_truth():
    rng = np.random.default_rng(4)
    x, arm, landmark = pose(rng), np.array([0.1, 0.2, 0.3]), np.array([100.0, 50.0, 5.0])
    R, p = x.rotation().matrix(), x.translation()
    values = values_of(x)
    values.insert(9, landmark)
    down = np.array([0, 0, 9.8])
    down_b, to_b = R.T @ down / 9.8, R.T @ (landmark - p) / np.linalg.norm(landmark - p)
    for factor in (
        factors.antenna_position(X, p + R @ arm, np.eye(3), arm),
        factors.direction(X, down, down_b, across(down_b[None])[0] / 0.05),
        factors.bearing(X, 9, to_b, across(to_b[None])[0] / 1e-3),
    ):
        assert_allclose(factor.error(values), 0, atol=1e-12)
