"""The search against independent costs: brute force over integers, scipy over attitudes."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from fgnav.integers.array.kernel import PROVEN, UNFINISHED
from fgnav.integers.array.nearest import nearest, weak_axis
from fgnav.integers.array.relaxation import relaxation
from fgnav.integers.array.search import search_constrained
from fgnav.integers.array.walk import least_distance
from fgnav.integers.ils.array_model import link_arrays, spans
from fgnav.integers.ils.decorrelation import decorrelate
from tests.integers.arrays import PAPER_ANTENNAS_B_M, float_solution, link_covariance, make

NODES = 10**6
PAIR_B_M = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
TRIANGLE_B_M = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.1, 0.25, 0.0]])
SOLID_B_M = np.array(
    [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.1, 0.4, 0.0], [0.1, 0.1, -0.3], [-0.2, 0.1, 0.1]]
)


def cost_of(differences, k, cycles, starts=12):
    """Least cost of an epoch with these integers, over attitudes from many starts, by scipy."""
    links = differences.resolvable[k]
    there = [differences.code_variance_m2, differences.phase_variance_m2]
    roots = [
        np.linalg.cholesky(np.linalg.inv(link_covariance(differences, k, links, v))).T
        for v in there
    ]
    phase_m = differences.phase_m[k] - differences.wavelength_m * cycles
    code_m = differences.code_m[k]

    def residuals(turn, start):
        R_nb = (Rotation.from_rotvec(turn) * start).as_matrix()
        array_m = differences.array_m(np.repeat(R_nb[None], len(differences.t_s), axis=0))[k]
        parts = [(code_m - array_m)[links], (phase_m - array_m)[links]]
        return np.concatenate([root @ part for root, part in zip(roots, parts, strict=True)])

    turns = Rotation.random(starts, random_state=np.random.default_rng(0))
    fits = [least_squares(residuals, np.zeros(3), args=(start,), xtol=1e-12) for start in turns]
    return 2 * min(fit.cost for fit in fits)


@pytest.mark.parametrize("antennas_b_m", [PAIR_B_M, TRIANGLE_B_M, SOLID_B_M, PAPER_ANTENNAS_B_M])
@pytest.mark.parametrize("satellites", [(4,), (6,), (4, 3)])
def test_cost_is_the_least_over_attitudes(antennas_b_m, satellites):
    rng = np.random.default_rng(1)
    made = make(rng, epochs=3, antennas_b_m=antennas_b_m, satellites=satellites, sine=True)
    found = search_constrained(made.differences, NODES)
    solved = np.flatnonzero(found.status == PROVEN)
    assert len(solved) >= 2
    for k in solved:
        expected = cost_of(made.differences, k, found.cycles[k])
        assert found.costs[k, 0] == pytest.approx(expected, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("code_m", [0.3, 1.0])
def test_no_integers_nearby_cost_less(code_m):
    rng = np.random.default_rng(2)
    made = make(rng, antennas_b_m=PAIR_B_M, code_m=code_m, satellites=(5,))
    found = search_constrained(made.differences, NODES)
    links = made.differences.resolvable[0, 0]
    for k in range(1):
        costs = []
        for steps in itertools.product((-1, 0, 1), repeat=int(links.sum())):
            cycles = found.cycles[k].copy()
            cycles[0, links] += np.array(steps)
            costs.append(cost_of(made.differences, k, cycles, starts=2))
        best, second = sorted(costs)[:2]
        assert best == pytest.approx(found.costs[k, 0], rel=1e-4, abs=1e-4)
        assert second > found.costs[k, 1] - 1e-3 or second > best + 25  # beyond the reach


def test_true_integers_never_cost_less_than_what_is_found():
    rng = np.random.default_rng(3)
    missing = rng.random((60, 5, 9)) < 0.15
    made = make(
        rng,
        epochs=60,
        antennas_b_m=SOLID_B_M,
        satellites=(5, 4),
        code_m=2.0,
        sine=True,
        missing=missing,
    )
    found = search_constrained(made.differences, NODES)
    right = ((found.cycles == made.cycles) | ~made.differences.resolvable).all(axis=(1, 2))
    solved = found.status == PROVEN
    assert solved.mean() > 0.9
    for k in np.flatnonzero(solved & ~right):
        assert cost_of(made.differences, k, made.cycles[k]) > found.costs[k, 0] - 1e-4


@pytest.mark.parametrize("satellites", [4, 5, 6, 8])
def test_any_number_of_satellites_is_enough_for_the_array_of_the_paper(satellites):
    made = make(np.random.default_rng(4), epochs=400, satellites=(satellites,), code_m=1.0)
    found = search_constrained(made.differences, NODES)
    right = (found.cycles == made.cycles).all(axis=(1, 2))
    assert (found.status == PROVEN).all()
    assert right.mean() >= (0.993 if satellites == 4 else 0.999)


def test_relaxed_cost_is_the_constrained_one_at_any_attitude():
    made = make(np.random.default_rng(6), epochs=2, antennas_b_m=SOLID_B_M, satellites=(5, 4))
    d, arrays = (
        made.differences,
        spans(made.differences.baselines_b_m, made.differences.resolvable.any(axis=2)),
    )
    for k in range(2):
        relaxed = relaxation(link_arrays(d), arrays, k)
        links = relaxed.links
        z = made.cycles[k][links[:, 0], links[:, 1]]
        gap = relaxed.cycles - z
        columns = relaxed.columns + relaxed.gain @ gap
        norm = gap @ np.linalg.solve(relaxed.covariance, gap)
        # M of the true attitude, in the coordinates the relaxation chose
        body = np.linalg.lstsq(d.baselines_b_m, arrays.coordinates_m[0], rcond=None)[0]
        off = (made.R_nb[k] @ body).T.ravel() - columns
        cost = relaxed.constant + norm + off @ relaxed.information @ off
        there = d.resolvable[k]
        model_m = d.array_m(made.R_nb)[k]
        code = (d.code_m[k] - model_m)[there]
        phase = (d.phase_m[k] - model_m - d.wavelength_m * made.cycles[k])[there]
        expected = code @ np.linalg.solve(link_covariance(d, k, there, d.code_variance_m2), code)
        expected += phase @ np.linalg.solve(
            link_covariance(d, k, there, d.phase_variance_m2), phase
        )
        assert cost == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("r", [1, 2, 3])
def test_nearest_columns_are_the_nearest_of_many(r):
    rng = np.random.default_rng(r)
    for _ in range(30):
        A = rng.normal(size=(3 * r, 3 * r)) * 10.0 ** rng.uniform(-1, 1, 3 * r)
        information = A.T @ A + 0.1 * np.eye(3 * r)
        columns = rng.normal(size=3 * r) * 0.6
        axis = weak_axis(information, np.inf)
        distance, M = nearest(columns, information, axis)
        stacked = M.reshape(r, 3)
        assert np.abs(stacked @ stacked.T - np.eye(r)).max() < 1e-9
        off = M - columns
        assert distance == pytest.approx(off @ information @ off, rel=1e-9)
        turns = Rotation.random(3000, random_state=rng).as_matrix()[:, :, :r]
        others = turns.swapaxes(1, 2).reshape(-1, 3 * r) - columns
        if r == 1:  # the global minimum by construction; otherwise the best of several descents
            least = np.einsum("ni,ij,nj->n", others, information, others).min()
            assert distance <= least + 1e-9


@pytest.mark.parametrize(("r", "usual"), [(1, 0.1), (2, 0.05), (3, 0.01)])
def test_bound_from_products_is_below_the_distance_and_no_empty_one(r, usual):
    rng = np.random.default_rng(10 + r)
    shares = []
    for _ in range(400):
        A = rng.normal(size=(3 * r, 3 * r)) * 10.0 ** rng.uniform(0, 2, 3 * r)
        information = A.T @ A + 0.1 * np.eye(3 * r)
        M = Rotation.random(random_state=rng).as_matrix()[:, :r].T.ravel()
        columns = M + rng.normal(size=3 * r) * 10.0 ** rng.uniform(-2, 0)
        distance, _ = nearest(columns, information, weak_axis(information, np.inf))
        bound = least_distance(columns, np.linalg.inv(information))
        assert bound <= distance * (1 + 1e-9)
        shares.append(bound / distance)
    assert np.median(shares) > usual


def test_direction_without_a_share_in_the_weakest_axis_is_completed_along_it():
    information = np.diag([1.0, 100.0, 400.0])
    distance, M = nearest(np.array([0.0, 0.3, 0.4]), information, np.zeros(3))
    # x_i = values_i t_i / (values_i - mu), with mu at the least eigenvalue
    y, z = 30.0 / 99.0, 160.0 / 399.0
    assert abs(M[0]) == pytest.approx(np.sqrt(1 - y * y - z * z), abs=1e-6)
    assert M[1:] == pytest.approx([y, z], abs=1e-6)
    assert distance > 0


def test_transforms_stay_small_where_satellites_are_many_and_code_is_weak():
    made = make(np.random.default_rng(7), epochs=8, satellites=(12,), code_m=5.0)
    for k in range(8):
        _, covariance = float_solution(made.differences, k)
        carried = np.eye(len(covariance))
        sound, L, d, T = decorrelate(covariance, carried)
        assert sound
        assert np.abs(np.round(T) - T).max() == 0
        assert np.abs(carried @ T.T - np.eye(len(T))).max() < 1e-6  # a = z @ T
        reduced = carried @ covariance @ carried.T
        assert np.abs(L.T @ np.diag(d) @ L - reduced).max() < 1e-6 * np.abs(reduced).max()


def test_epoch_that_nothing_fits_raises_its_bound():
    made = make(np.random.default_rng(8), epochs=4)
    small = made.differences.phase_variance_m2 / 9
    found = search_constrained(replace(made.differences, phase_variance_m2=small), NODES)
    assert (found.costs[:, 0] > 100).all()
    assert (found.cycles == made.cycles).all()
    assert (found.status == PROVEN).all()


def test_search_given_up_says_so():
    made = make(np.random.default_rng(9), epochs=2)
    found = search_constrained(made.differences, 10)
    assert (found.status == UNFINISHED).all()
    assert (found.nodes < 200).all()
    assert (found.wrong_probability == 1).all()
