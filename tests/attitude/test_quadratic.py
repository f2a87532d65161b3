import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.attitude.quadratic import RotationQuadratic, tangent_jacobian
from fgnav.geometry import rotations
from fgnav.gnss.clock_free import clock_free
from fgnav.types.integers import fixed_ranges_m
from tests.integers.arrays import link_covariance

from .arrays import sky, synthetic


def random_attitudes(n, rng):
    return rotations.exp(rng.normal(size=(n, 3)))


@pytest.mark.parametrize("missing", [0.0, 0.3])
@pytest.mark.parametrize("group", [[0] * 6, [0, 0, 0, 1, 1, 1]])
def test_form_equals_double_differences_with_their_full_covariance(group, missing):
    rng = np.random.default_rng(1)
    R_nb = random_attitudes(4, rng)
    differences, true = synthetic(R_nb, sky(6, rng), rng, group=group, sine=True, missing=missing)
    form = RotationQuadratic.of_double_differences(differences, true)
    ranges_m = fixed_ranges_m(differences, true)
    for k in range(4):
        links = true.fixed[k]
        covariance = link_covariance(differences, k, links, differences.phase_variance_m2)
        weight = np.linalg.inv(covariance)
        seen = np.isfinite(ranges_m[k])
        seen = np.concatenate([seen.any(axis=0)[None], seen])[None]
        clocks = clock_free(
            differences.group, seen, differences.phase_variance_m2[[k]], np.zeros((*seen.shape, 1))
        )
        assert_allclose(clocks.log_determinant, np.linalg.slogdet(covariance)[1])
        baseline, channel = np.nonzero(links)
        e_n = differences.e_n[k]
        lines = e_n[channel] - e_n[differences.reference[k, differences.group[channel]]]
        A = -np.einsum("li,lj->lij", lines, differences.baselines_b_m[baseline]).reshape(-1, 9)
        y = ranges_m[k][links]
        assert_allclose(form.information[k], A.T @ weight @ A, rtol=1e-9, atol=1e-6)
        assert_allclose(form.vector[k], A.T @ weight @ y, rtol=1e-9, atol=1e-6)
        assert_allclose(form.constant[k], y @ weight @ y, rtol=1e-9)
        assert form.count[k] == links.sum()


def test_equal_weights_without_gaps_fall_apart_into_three_vectors():
    rng = np.random.default_rng(2)
    differences, true = synthetic(random_attitudes(3, rng), sky(6, rng), rng)
    form = RotationQuadratic.of_double_differences(differences, true)
    L = differences.baselines_b_m
    W = np.linalg.inv(np.eye(7) + 1)
    D = (differences.e_n[0, 1:] - differences.e_n[0, 0]).T
    satellites = np.linalg.inv(np.eye(5) + 1)
    expected = np.kron(D @ satellites @ D.T, L.T @ W @ L) / 0.003**2
    assert_allclose(form.information[0], expected, rtol=1e-9, atol=1e-6)


def test_vector_pairs_add_to_the_form():
    rng = np.random.default_rng(3)
    R_nb = random_attitudes(5, rng)
    v_n = rng.normal(size=(5, 3))
    v_b = np.einsum("nji,nj->ni", R_nb, v_n)
    covariance = np.broadcast_to(np.diag([1.0, 2.0, 3.0]), (5, 3, 3))
    form = RotationQuadratic.of_vector_pairs(v_n, v_b, covariance)
    double = form + form
    assert_allclose(double.chi_square(R_nb), 0, atol=1e-12)
    turned = R_nb @ rotations.exp(rng.normal(size=(5, 3)))
    residual = np.einsum("nji,nj->ni", turned, v_n) - v_b
    expected = 2 * (residual**2 / [1.0, 2.0, 3.0]).sum(axis=1)
    assert_allclose(double.chi_square(turned), expected, rtol=1e-12)


def test_a_missing_vector_says_nothing():
    v = np.array([[1.0, 0, 0]])
    form = RotationQuadratic.of_vector_pairs(v, np.full((1, 3), np.nan), np.eye(3)[None])
    assert not form.information.any()
    assert form.count[0] == 0


def test_gradient_and_jacobian_match_finite_differences():
    rng = np.random.default_rng(4)
    R_nb = random_attitudes(3, rng)
    differences, true = synthetic(R_nb, sky(5, rng), rng)
    form = RotationQuadratic.of_double_differences(differences, true)
    at = R_nb @ rotations.exp(0.1 * rng.normal(size=(3, 3)))
    step = 1e-6
    for axis in np.eye(3):
        ahead = at @ rotations.exp(np.tile(step * axis, (3, 1)))
        behind = at @ rotations.exp(np.tile(-step * axis, (3, 1)))
        slope = (ahead - behind).reshape(3, 9) / (2 * step)
        assert_allclose(tangent_jacobian(at) @ axis, slope, atol=1e-8)
        change = (form.chi_square(ahead) - form.chi_square(behind)) / (4 * step)
        assert_allclose(form.gradient_at(at) @ axis, change, rtol=1e-5)


def test_square_root_rebuilds_the_form_of_a_planar_array():
    rng = np.random.default_rng(5)
    R_nb = random_attitudes(3, rng)
    plane = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0.5, 0]])
    differences, true = synthetic(R_nb, sky(6, rng), rng, antennas_b_m=plane)
    form = RotationQuadratic.of_double_differences(differences, true)
    root, minimum = form.square_root()
    at, other = (R_nb @ rotations.exp(rng.normal(size=(3, 3))) for _ in range(2))
    squares = [
        (np.einsum("nij,nj->ni", root, (R - minimum).reshape(3, 9)) ** 2).sum(axis=1)
        for R in (at, other)
    ]
    change = form.chi_square(at) - form.chi_square(other)
    assert_allclose(squares[0] - squares[1], change, rtol=1e-6)
