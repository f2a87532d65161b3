import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fgnav.attitude.vector_pairs import (
    VectorPairs,
    paper_matrix,
    sensitivity,
    wahba,
)
from fgnav.checks import BadInputError
from fgnav.geometry import rotations

PAPER_ARRAY_B_M = np.array(
    [[0, 0.1, 0], [0, -0.1, 0], [1, 0, 0], [-1, 0, 0], [-0.8, 0.1, 0.1], [-0.8, -0.1, 0.1],
     [-0.8, 0, -0.1]]
)  # fmt: skip
# Six satellites with PDOP 2.43, the size of the setting that the reference ratios come from.
AZIMUTH_DEG = np.array([119.0, 284.0, 109.0, 163.0, 48.0, 145.0])
ELEVATION_DEG = np.array([25.0, 30.0, 66.0, 31.0, 46.0, 84.0])


def random_rotations(rng, n):
    return rotations.exp(rng.uniform(-1.8, 1.8, (n, 3)))


def pairs(v_n, v_b, weight=None):
    n, k, _ = v_n.shape
    return VectorPairs(
        v_n=v_n,
        v_b=np.broadcast_to(v_b, v_n.shape),
        weight=np.ones((n, k)) if weight is None else weight,
        sources=tuple(f"baseline {i}" for i in range(k)),
    )


def rotated(R_nb, v_b):
    return np.einsum("nij,kj->nki", R_nb, v_b)


@pytest.fixture
def rng():
    return np.random.default_rng(20)


@pytest.mark.parametrize("count", [2, 3, 7])
def test_exact_vectors_give_the_exact_attitude_by_every_method(rng, count):
    R_nb = random_rotations(rng, 50)
    v_b = rng.standard_normal((count, 3))
    exact = pairs(rotated(R_nb, v_b), v_b)
    for answer in (wahba(exact).R_nb, paper_matrix(exact)):
        np.testing.assert_allclose(answer, R_nb, rtol=0, atol=1e-12)


def test_planar_antennas_are_as_good_as_any_to_the_papers_matrix(rng):
    R_nb = random_rotations(rng, 20)
    planar_b = np.array([[1.0, 0, 0], [0, 2.0, 0], [1.0, 1.0, 0], [-1.0, 0.5, 0]])
    answer = paper_matrix(pairs(rotated(R_nb, planar_b), planar_b))
    np.testing.assert_allclose(answer, R_nb, rtol=0, atol=1e-12)


def test_two_vectors_make_the_matrix_of_equations_18_and_19(rng):
    v_n, v_b = rng.standard_normal((2, 1, 2, 3))
    columns = []
    for first, second in (v_n[0], v_b[0]):
        three = [first, second, np.cross(first, second)]
        columns.append(np.stack([a / np.linalg.norm(a) for a in three], axis=1))
    expected = columns[0] @ np.linalg.inv(columns[1])
    np.testing.assert_allclose(paper_matrix(pairs(v_n, v_b))[0], expected, rtol=0, atol=1e-12)


def test_many_vectors_make_the_matrix_of_equation_20(rng):
    v_n, v_b = rng.standard_normal((2, 1, 5, 3))
    N_n, N_b = (a[0].T / np.linalg.norm(a[0], axis=1) for a in (v_n, v_b))
    expected = N_n @ N_b.T @ np.linalg.inv(N_b @ N_b.T)
    np.testing.assert_allclose(paper_matrix(pairs(v_n, v_b))[0], expected, rtol=0, atol=1e-12)


def test_wahba_is_what_scipy_finds_vector_by_vector(rng):
    v_n, v_b = rng.standard_normal((2, 30, 4, 3))
    weight = rng.uniform(0.1, 3.0, (30, 4))
    ours = wahba(pairs(v_n, v_b, weight)).R_nb
    for k in range(30):
        peer, _ = Rotation.align_vectors(v_n[k], v_b[k], weights=weight[k])
        np.testing.assert_allclose(ours[k], peer.as_matrix(), rtol=0, atol=1e-9)


def test_a_missing_vector_is_as_one_never_given(rng):
    v_n, v_b = rng.standard_normal((2, 8, 5, 3))
    gapped = v_n.copy()
    gapped[:, 2] = np.nan
    rest = [0, 1, 3, 4]
    for method in (paper_matrix, lambda p: wahba(p).R_nb):
        np.testing.assert_allclose(
            method(pairs(gapped, v_b)), method(pairs(v_n[:, rest], v_b[:, rest])), atol=1e-12
        )


def test_an_epoch_without_vectors_has_rank_zero_and_no_attitude():
    empty = pairs(np.full((2, 3, 3), np.nan), np.eye(3))
    answer = wahba(empty)
    assert (answer.rank == 0).all()
    assert np.isnan(answer.R_nb).all()
    assert np.isnan(paper_matrix(empty)).all()


@pytest.mark.parametrize(
    ("vector_b", "open_angle"), [((1.6, 0.0, 0.0), 0), ((0.0, 0.7, 0.0), 1)], ids=["nose", "across"]
)
def test_one_baseline_leaves_an_angle_open_and_sets_it_to_zero(rng, vector_b, open_angle):
    R_nb, v_b = rotations.from_euler(*rng.uniform(-1, 1, (3, 40))), np.array([vector_b])
    answer = wahba(pairs(rotated(R_nb, v_b), v_b))
    assert (answer.rank == 1).all()
    axis_b = np.eye(3)[open_angle]
    np.testing.assert_allclose(np.abs(answer.open_axis_b), [axis_b] * 40, atol=1e-12)
    np.testing.assert_allclose(rotations.to_euler(answer.R_nb)[:, open_angle], 0, atol=1e-9)
    np.testing.assert_allclose(rotated(answer.R_nb, v_b), rotated(R_nb, v_b), atol=1e-12)


def test_gravity_alone_leaves_yaw_open_and_sets_it_to_zero(rng):
    angles = rng.uniform(-1, 1, (3, 20))
    down_n = np.broadcast_to([0.0, 0.0, 1.0], (20, 1, 3))
    down_b = np.einsum("nji,nkj->nki", rotations.from_euler(*angles), down_n)
    answer = wahba(pairs(down_n, down_b))
    assert (answer.rank == 1).all()
    expected = np.column_stack([angles[0], angles[1], np.zeros(20)])
    np.testing.assert_allclose(rotations.to_euler(answer.R_nb), expected, atol=1e-9)


def test_collinear_vectors_have_no_paper_matrix(rng):
    R_nb = random_rotations(rng, 3)
    line_b = np.array([[1.0, 0, 0], [-2.0, 0, 0]])
    line = pairs(rotated(R_nb, line_b), line_b)
    assert np.isnan(paper_matrix(line)).all()
    assert (wahba(line).rank == 1).all()


def solved(some):
    return wahba(some).R_nb


def test_sensitivity_is_the_derivative_of_wahba_s_answer(rng):
    """Shuster: ``(sum w (v'v I - v v'))^-1 w [v]x R'`` for small errors of ``v_n``."""
    R_nb, weight = random_rotations(rng, 1), rng.uniform(0.5, 2, (1, 7))
    exact = pairs(rotated(R_nb, PAPER_ARRAY_B_M), PAPER_ARRAY_B_M, weight)
    S = sensitivity(solved, exact)
    K = rotations.skew(PAPER_ARRAY_B_M)
    A = -np.einsum("k,kij,kjl->il", weight[0], K, K)
    expected = np.linalg.inv(A) @ (weight[0][:, None, None] * K) @ R_nb[0].T
    np.testing.assert_allclose(S[0], expected, rtol=0, atol=1e-8)


def test_an_open_axis_has_the_variance_of_a_uniform_angle_and_no_share_of_the_rest(rng):
    R_nb = random_rotations(rng, 4)
    nose_b = np.array([[1.0, 0, 0]])
    line = pairs(rotated(R_nb, nose_b), nose_b)
    S = sensitivity(solved, line)
    P = wahba(line).with_open_axis(np.einsum("nkia,nkja->nij", S, S))
    expected = np.diag([np.pi**2 / 3, 1.0, 1.0])
    np.testing.assert_allclose(P, np.broadcast_to(expected, P.shape), rtol=0, atol=1e-8)


def test_absent_pairs_have_no_share_in_the_sensitivity(rng):
    v_n, v_b = rng.standard_normal((2, 3, 4, 3))
    gapped = v_n.copy()
    gapped[1, 2] = np.nan
    S = sensitivity(solved, pairs(gapped, v_b))
    assert not S[1, 2].any()
    assert (np.abs(S[:, 3]).max(axis=(1, 2)) > 0.01).all()


def test_covariance_of_weighted_directions_meets_the_scatter(rng):
    n, sigma_rad = 4000, np.array([0.01, 0.02, 0.03])
    v_b = np.array([[1.0, 0, 0], [0.6, 0.8, 0], [0, 0, 1.0]])
    R_nb = np.repeat(random_rotations(rng, 1), n, axis=0)
    v_n = rotated(R_nb, v_b) + sigma_rad[:, None] * rng.standard_normal((n, 3, 3))
    noisy = pairs(v_n, v_b, np.broadcast_to(sigma_rad**-2, (n, 3)))
    answer = wahba(noisy)
    S = sensitivity(solved, pairs(v_n[:1], v_b, noisy.weight[:1]))[0]
    P = np.einsum("kij,k,klj->il", S, sigma_rad**2, S)
    error = rotations.log(answer.R_nb.swapaxes(1, 2) @ R_nb)
    nees = np.einsum("ni,ij,nj->n", error, np.linalg.inv(P), error)
    assert nees.mean() == pytest.approx(3.0, abs=5 * np.sqrt(6 / n))


@pytest.fixture(scope="module")
def ratios():
    """RMSE over Cramer-Rao bound of roll, pitch, yaw: 20-degree sines, phase noise 3 mm."""
    rng = np.random.default_rng(3)
    az, el = np.radians(AZIMUTH_DEG), np.radians(ELEVATION_DEG)
    e_n = np.column_stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), -np.sin(el)])
    H = e_n[0] - e_n[1:]
    t_s = np.linspace(0, 60, 3000)
    angle = np.radians(20) * np.sin(t_s)
    R_nb = rotations.from_euler(angle, angle, angle)
    satellites, antennas = np.eye(5) + 1, np.eye(7) + 1
    noise_m = 0.003 * np.linalg.cholesky(antennas) @ rng.standard_normal((len(t_s), 7, 5))
    noise_m = noise_m @ np.linalg.cholesky(satellites).T
    b_n_m = rotated(R_nb, PAPER_ARRAY_B_M) + noise_m @ np.linalg.pinv(H).T
    M = R_nb.swapaxes(1, 2) @ (H.T @ np.linalg.inv(satellites) @ H) @ R_nb
    K = rotations.skew(PAPER_ARRAY_B_M)
    information = np.einsum("ij,iab,nac,jcd->nbd", np.linalg.inv(antennas), K, M, K)
    J = rotations.euler_jacobian(R_nb)
    bound = J @ np.linalg.inv(information / 0.003**2) @ J.swapaxes(1, 2)
    crlb = np.sqrt(np.diagonal(bound, axis1=1, axis2=2).mean(axis=0))
    noisy = pairs(b_n_m, PAPER_ARRAY_B_M)
    answers = {
        "raw T": paper_matrix(noisy),
        "unit Wahba": wahba(noisy.directions()).R_nb,
        "Wahba": wahba(noisy).R_nb,
    }
    truth = rotations.to_euler(R_nb)
    return {
        name: np.sqrt((rotations.wrap(rotations.to_euler(R) - truth) ** 2).mean(axis=0)) / crlb
        for name, R in answers.items()
    }


@pytest.mark.parametrize(
    ("name", "published"),
    [
        ("raw T", (3.7, 2.1, 1.5)),
        ("unit Wahba", (3.6, 2.2, 4.4)),
        ("Wahba", (1.65, 1.85, 1.39)),
    ],
)
def test_closed_forms_miss_the_bound_by_the_published_factors(ratios, name, published):
    # The published satellites are not known, only their PDOP: other skies of it scatter by 30 %.
    np.testing.assert_allclose(ratios[name], published, rtol=0.3)


def test_length_weights_beat_unit_vectors_on_every_angle(ratios):
    assert (ratios["Wahba"] < ratios["unit Wahba"]).all()
    assert (ratios["Wahba"] >= 1).all()


def test_vector_pairs_of_unequal_shape_are_rejected():
    v = np.ones((2, 1, 3))
    with pytest.raises(BadInputError, match=r"vector pairs v_b: expected shape \(2, 1, 3\)"):
        VectorPairs(v_n=v, v_b=np.ones((1, 1, 3)), weight=np.ones((2, 1)), sources=("gravity",))


def test_negative_weight_is_rejected():
    with pytest.raises(BadInputError, match="vector pairs weight: must not be negative, got -1"):
        pairs(np.ones((1, 1, 3)), np.ones((1, 3)), np.array([[-1.0]]))
