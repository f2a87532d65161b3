import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fgnav.integers import integer_least_squares
from fgnav.integers.ils.affine import NOTHING, WEAK, search_array
from fgnav.integers.ils.float_solution import solve_symmetric
from fgnav.integers.ils.search import OK
from tests.integers.arrays import PAPER_ANTENNAS_B_M, float_solution, link_covariance, make

LINE_B_M = np.array([[0.0, 0, 0], [0, 0.5, 0], [0, 1.0, 0]])
PLANE_B_M = np.array([[0.0, 0, 0], [0, 0.5, 0], [1.0, 0, 0], [1.0, 0.5, 0]])


def by_numpy(differences, k, rank):
    """Float solution by plain weighted least squares with the border type's own covariance."""
    links = differences.resolvable[k]
    baseline, channel = np.nonzero(links)
    reference = differences.reference[k, differences.group[channel]]
    V = np.linalg.svd(differences.baselines_b_m)[2][:rank].T
    across = differences.e_n[k, reference] - differences.e_n[k, channel]
    A = np.einsum("qx,qr->qrx", across, (differences.baselines_b_m @ V)[baseline])
    A = A.reshape(len(baseline), -1)
    code = link_covariance(differences, k, links, differences.code_variance_m2)
    phase = link_covariance(differences, k, links, differences.phase_variance_m2)
    P = np.linalg.inv(A.T @ np.linalg.solve(code, A))
    M = P @ A.T @ np.linalg.solve(code, differences.code_m[k][links])
    wavelength = differences.wavelength_m[channel]
    cycles = (differences.phase_m[k][links] - A @ M) / wavelength
    return cycles, (phase + A @ P @ A.T) / np.outer(wavelength, wavelength)


@pytest.mark.parametrize(
    ("antennas_b_m", "rank"),
    [(PAPER_ANTENNAS_B_M, 3), (PLANE_B_M, 2), (LINE_B_M, 1), (PLANE_B_M[:2], 1)],
)
def test_float_solution_is_weighted_least_squares_over_links_groups_and_gaps(antennas_b_m, rank):
    rng = np.random.default_rng(1)
    missing = np.zeros((4, len(antennas_b_m), 13), dtype=bool)
    missing[1] = rng.random(missing[1].shape) < 0.1
    missing[2, -1, 6] = True  # the reference channel of the second group
    made = make(
        rng, epochs=4, antennas_b_m=antennas_b_m, satellites=(6, 7), sine=True, missing=missing
    )
    for k in range(4):
        cycles, covariance = by_numpy(made.differences, k, rank)
        found = float_solution(made.differences, k)
        # double precision of 1e8 cycles, through the condition of code against array
        assert_allclose(found[0], cycles, rtol=0, atol=1e-6)
        assert_allclose(found[1], covariance, rtol=1e-8, atol=1e-8)


def test_one_baseline_of_the_array_is_ordinary_lambda():
    made = make(np.random.default_rng(2), satellites=(7,), sine=True)
    d = made.differences
    found = search_array(d, joint=False)
    D = d.e_n[0, :1] - d.e_n[0, 1:]
    code = np.diag(d.code_variance_m2[0, 1:]) + d.code_variance_m2[0, 0]
    phase = np.diag(d.phase_variance_m2[0, 1:]) + d.phase_variance_m2[0, 0]
    for i in range(7):
        P = np.linalg.inv(D.T @ np.linalg.solve(2 * code, D))
        baseline_n_m = P @ D.T @ np.linalg.solve(2 * code, d.code_m[0, i, 1:])
        a = (d.phase_m[0, i, 1:] - D @ baseline_n_m) / d.wavelength_m[1:]
        Q = (2 * phase + D @ P @ D.T) / d.wavelength_m[0] ** 2
        integers, norms = integer_least_squares(a, Q)
        assert_array_equal(found.cycles[0, i, 1:], integers[0])
        assert_allclose(found.squared_norms[0, i], norms, rtol=1e-6)


def test_joint_search_is_the_public_search_of_the_float_solution():
    made = make(np.random.default_rng(3), epochs=5, satellites=(5, 4), sine=True)
    found = search_array(made.differences, joint=True)
    for k in range(5):
        integers, norms = integer_least_squares(*float_solution(made.differences, k))
        assert_array_equal(found.cycles[k][made.differences.resolvable[k]], integers[0])
        assert_allclose(found.squared_norms[k], np.tile(norms, (7, 1)), rtol=1e-9)


def test_antenna_without_any_link_leaves_the_others_resolved():
    missing = np.zeros((2, 8, 8), dtype=bool)
    missing[1, 3] = True
    made = make(np.random.default_rng(4), epochs=2, satellites=(8,), code_m=0.1, missing=missing)
    found = search_array(made.differences, joint=True)
    there = made.differences.resolvable
    assert_array_equal(found.cycles[there], made.cycles[there])
    assert found.status[1, 2] == NOTHING
    assert (np.delete(found.status.ravel(), 7 + 2) == OK).all()
    assert np.isnan(found.squared_norms[1, 2]).all()


def test_antennas_left_in_a_plane_are_resolved_in_that_plane():
    missing = np.zeros((1, 8, 8), dtype=bool)
    missing[0, 5:] = True  # leaves five antennas, of rank 2
    made = make(np.random.default_rng(5), satellites=(8,), code_m=0.1, missing=missing)
    found = search_array(made.differences, joint=True)
    there = made.differences.resolvable
    assert (found.status[0, :4] == OK).all()
    assert_array_equal(found.cycles[there], made.cycles[there])


@pytest.mark.parametrize("joint", [True, False])
@pytest.mark.parametrize("satellites", [(3,), (2, 2), (3, 1)])
def test_too_few_satellites_leave_the_epoch_unresolved(joint, satellites):
    made = make(np.random.default_rng(6), satellites=satellites)
    found = search_array(made.differences, joint=joint)
    assert (found.status == WEAK).all()
    assert (found.cycles == 0).all()


def test_satellites_in_a_plane_leave_the_epoch_unresolved():
    made = make(np.random.default_rng(7), satellites=(6,))
    d = made.differences
    e_n = d.e_n.copy()
    e_n[..., 2] = 0.3 * e_n[..., 0] - 0.5  # differences lack one direction
    fields = {name: getattr(d, name) for name in d.__slots__ if name != "__weakref__"}
    flat = type(d)(**{**fields, "e_n": e_n})
    assert (search_array(flat, joint=True).status == WEAK).all()


def test_two_antennas_in_one_place_need_no_code():
    made = make(np.random.default_rng(8), antennas_b_m=np.zeros((2, 3)), code_m=100.0)
    found = search_array(made.differences, joint=True)
    assert (found.status == OK).all()
    assert_array_equal(found.cycles, made.cycles)


def test_no_links_at_all_are_nothing_and_no_failure():
    missing = np.ones((2, 8, 6), dtype=bool)
    made = make(np.random.default_rng(9), epochs=2, missing=missing)
    assert (search_array(made.differences, joint=True).status == NOTHING).all()


@pytest.mark.parametrize(
    ("code_m", "joint", "at_least", "at_most"),
    [
        (0.1, True, 0.985, 1.0),  # a prototype had 99.7 %
        (0.3, True, 0.84, 0.93),  # 87-90 %
        (1.0, True, 0.14, 0.26),  # 18-22 %
        (0.1, False, 0.30, 0.45),  # 39 %
        (0.3, False, 0.0, 0.01),  # 0.2 %
    ],
)
def test_paper_array_is_resolved_as_often_as_the_prototype(code_m, joint, at_least, at_most):
    made = make(np.random.default_rng(10), epochs=1000, code_m=code_m)
    found = search_array(made.differences, joint=joint)
    right = (found.cycles == made.cycles).all(axis=(1, 2)).mean()
    # 1000 epochs: one standard deviation is at most 1.6 %
    assert at_least <= right <= at_most


def test_three_constellations_fix_the_array_in_every_epoch():
    made = make(np.random.default_rng(11), epochs=20, satellites=(8, 8, 8), code_m=0.5, sine=True)
    assert_array_equal(search_array(made.differences, joint=True).cycles, made.cycles)


def test_symmetric_systems_are_solved():
    rng = np.random.default_rng(2)
    A = rng.normal(size=(6, 6))
    S, B = A @ A.T + np.eye(6), rng.normal(size=(6, 3))
    S[:3, 3:] = S[3:, :3] = 0.0
    assert_allclose(S @ solve_symmetric(S, B), B, rtol=0, atol=1e-12)
