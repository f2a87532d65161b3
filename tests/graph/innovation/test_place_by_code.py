"""The place by code against solutions whose errors are drawn."""

import numpy as np

from fgnav.graph.factors.antenna_phase import AntennaPhase, ArcBlock, PhaseRows
from fgnav.graph.innovation.place_by_code import place_consistency
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States

WIDTH, ARCS = 15, 6
T_S = np.array([0.0])


def solved(rng, place_sigma_m, off_m=0.0):
    """Return rows of six satellites' errors, and the solution with a measurement of the place.

    That measurement is off by ``off_m`` along each axis.
    """
    G, H = rng.normal(size=(8, 3)), rng.normal(size=(8, ARCS))
    after = np.diag(1 / rng.uniform(0.5, 3.0, ARCS))
    arcs = np.linalg.solve(after, rng.normal(size=ARCS))
    place_n_m = rng.normal(0, 10.0, 3)
    z = G @ place_n_m + H @ arcs + rng.normal(size=8)
    seen = place_n_m + off_m + place_sigma_m * rng.normal(size=3)
    A = np.block(
        [
            [G, H],
            [np.zeros((ARCS, 3)), after],
            [np.eye(3) / place_sigma_m, np.zeros((3, ARCS))],
        ]
    )
    right = np.concatenate([z, np.zeros(ARCS), seen / place_sigma_m])
    P = np.linalg.inv(A.T @ A)
    block = ArcBlock(0, np.zeros((ARCS, 0)), after, np.zeros(ARCS))
    phase = AntennaPhase(
        row=np.array([0]),
        rows=(PhaseRows(G, H, z),),
        block=np.array([0]),
        blocks=(block,),
        arm_b_m=np.zeros((1, 3)),
        lever_column=-1,
        constants=Constants(()),
    )
    covariance = np.zeros((1, WIDTH, WIDTH))
    covariance[0, 3:6, 3:6] = P[:3, :3]
    states = States(
        R_nb=np.eye(3)[None],
        p_n_m=(P @ A.T @ right)[None, :3],
        v_n_mps=np.zeros((1, 3)),
        aux=np.zeros((1, 6)),
        constants=np.zeros(0),
    )
    solution = Solution(
        states=states,
        covariance=covariance,
        cross=None,
        constant_covariance=np.zeros((1, 0, 0)),
        constant_cross=np.zeros((1, WIDTH, 0)),
        converged=True,
    )
    return phase, solution


def test_right_solutions_have_a_nis_of_one_and_are_not_accused():
    rng = np.random.default_rng(9_100_300)
    found = [one for _ in range(1000) for one in place_consistency(*with_times(rng, 0.05))]
    squared = np.array([one.nis * one.freedom for one in found])
    freedom = sum(one.freedom for one in found)
    assert freedom > 1000
    assert abs(squared.sum() / freedom - 1) < 4 * np.sqrt(2 / freedom)
    assert sum(bool(one.contradictions) for one in found) <= 1  # of 1e-4 each


def test_a_place_that_pulls_too_far_is_a_contradiction():
    rng = np.random.default_rng(9_100_301)
    for _ in range(20):
        (one,) = place_consistency(*with_times(rng, 0.05, off_m=40.0))
        assert one.contradictions[0].throughout


def test_what_gnss_alone_knows_is_not_tested():
    rng = np.random.default_rng(9_100_302)
    assert place_consistency(*with_times(rng, 1e3)) == ()


def with_times(rng, place_sigma_m, off_m=0.0):
    phase, solution = solved(rng, place_sigma_m, off_m)
    return phase, T_S, solution
