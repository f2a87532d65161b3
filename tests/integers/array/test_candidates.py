"""The list of integer vectors: the exact search's best, and all others within reach."""

import dataclasses

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.integers.array.candidates import candidates
from fgnav.integers.array.kernel import NOTHING, PROVEN
from fgnav.integers.array.search import search_constrained
from tests.integers.arrays import PAPER_ANTENNAS_B_M, link_covariance, make

THREE_B_M = PAPER_ANTENNAS_B_M[[0, 1, 3]]


@pytest.fixture(scope="module")
def made():
    rng = np.random.default_rng(8)
    return make(rng, epochs=40, antennas_b_m=THREE_B_M, satellites=(5,), code_m=1.0, sine=True)


def test_the_first_candidate_is_that_of_the_exact_search(made):
    found = candidates(made.differences)
    exact = search_constrained(made.differences, 10**6)
    first = np.flatnonzero(np.diff(found.epoch, prepend=-1))
    assert (found.status == PROVEN).all()
    np.testing.assert_allclose(found.cost[first], exact.costs[:, 0], rtol=0, atol=1e-6)
    assert (found.cycles[first] == exact.cycles).all()


def test_candidates_are_different_and_rise_in_cost(made):
    found = candidates(made.differences)
    for k in range(40):
        own = np.flatnonzero(found.epoch == k)
        assert (np.diff(found.cost[own]) >= 0).all()
        assert len({found.cycles[c].tobytes() for c in own}) == len(own)
    assert len(found.epoch) > 60  # or the test shows nothing


def test_a_wider_reach_adds_only_candidates_beyond_the_narrower(made):
    narrow = candidates(made.differences, reach=8.0, most=200)
    wide = candidates(made.differences, reach=16.0, most=200)
    for k in range(40):
        costs = [found.cost[found.epoch == k] for found in (narrow, wide)]
        least = costs[0][0]
        near = [cost[cost <= least + 8.0] for cost in costs]
        np.testing.assert_allclose(near[0], near[1], rtol=0, atol=1e-6)


def test_a_cost_is_that_of_the_residuals_in_their_full_covariance(made):
    d = made.differences
    found = candidates(d)
    for c in range(0, len(found.epoch), 7):
        k = found.epoch[c]
        links = d.resolvable[k]
        model = -found.baselines_n_m[c] @ (d.e_n[k] - d.e_n[k, d.reference[k, 0]]).T
        phase = (d.phase_m[k] - d.wavelength_m * found.cycles[c] - model)[links]
        code = (d.code_m[k] - model)[links]
        cost = phase @ np.linalg.solve(link_covariance(d, k, links, d.phase_variance_m2), phase)
        cost += code @ np.linalg.solve(link_covariance(d, k, links, d.code_variance_m2), code)
        assert found.cost[c] == pytest.approx(cost, rel=1e-6)


def test_fewer_may_be_asked_for(made):
    all_of_them = candidates(made.differences)
    some = candidates(made.differences, most=2)
    assert np.bincount(some.epoch).max() == 2
    kept = np.concatenate([np.flatnonzero(all_of_them.epoch == k)[:2] for k in range(40)])
    np.testing.assert_allclose(some.cost, all_of_them.cost[kept], rtol=0, atol=1e-6)


def test_an_epoch_without_links_has_none(made):
    code_m = made.differences.code_m.copy()
    code_m[3] = np.nan
    found = candidates(dataclasses.replace(made.differences, code_m=code_m))
    assert 3 not in found.epoch
    assert found.status[3] == NOTHING


@pytest.mark.parametrize("name", ["most", "reach", "nodes"])
def test_limits_must_be_positive(made, name):
    with pytest.raises(BadInputError, match=f"{name}: must be above 0, got 0"):
        candidates(made.differences, **{name: 0})
