"""The place by code against solutions whose errors are drawn."""

import numpy as np
from scipy.special import chdtri

from fgnav.graph.factors.antenna_phase import AntennaPhase, ArcBlock, PhaseRows
from fgnav.graph.innovation.place_by_code import place_innovation
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States

WIDTH, ARCS = 15, 6


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
        constants=Parameters(()),
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


def test_right_solutions_have_a_nis_of_one():
    rng = np.random.default_rng(9_100_300)
    found = [place_innovation(*solved(rng, 0.05)) for _ in range(1000)]
    squared, freedom = (np.concatenate([one[k] for one in found if one]) for k in (1, 2))
    total = freedom.sum()
    assert total > 1000
    assert abs(squared.sum() / total - 1) < 4 * np.sqrt(2 / total)
    assert (squared > chdtri(freedom, 1e-4)).sum() <= 1


def test_a_place_that_pulls_too_far_is_beyond_the_band():
    rng = np.random.default_rng(9_100_301)
    for _ in range(20):
        name, (squared,), (freedom,) = place_innovation(*solved(rng, 0.05, off_m=40.0))
        assert name == "place by code"
        assert squared > chdtri(freedom, 1e-4)


def test_what_gnss_alone_knows_is_not_tested():
    rng = np.random.default_rng(9_100_302)
    assert place_innovation(*solved(rng, 1e3)) is None
