"""An attitude known beforehand: exact to second order, narrowing, and in the posterior."""

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry import rotations
from fgnav.integers.array.prior import AttitudePrior, prior_columns
from fgnav.integers.array.relaxation import spans
from fgnav.integers.array.search import PROVEN, search_constrained
from fgnav.integers.resolvers.constrained import Constrained
from tests.integers.arrays import PAPER_ANTENNAS_B_M, make

PAIR_B_M = np.array([[0.0, 0.0, 0.0], [1.6, 0.0, 0.0]])
TRIANGLE_B_M = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.1, 0.25, 0.0]])
NODES = 10**6


def around(rng, R_nb, sigma_deg):
    """A prior that is off by draws from its own covariance."""
    n = len(R_nb)
    A = rng.normal(size=(n, 3, 3)) * np.radians(sigma_deg)
    covariance = A @ A.swapaxes(1, 2) / 3 + np.eye(3) * np.radians(sigma_deg) ** 2
    delta = np.einsum("nij,nj->ni", np.linalg.cholesky(covariance), rng.normal(size=(n, 3)))
    prior = R_nb @ rotations.exp(-delta)
    return AttitudePrior(R_nb=prior, attitude_covariance_rad2=covariance)


@pytest.mark.parametrize("antennas_b_m", [PAIR_B_M, TRIANGLE_B_M, PAPER_ANTENNAS_B_M])
def test_cost_of_a_small_turn_is_that_of_its_covariance(antennas_b_m):
    rng = np.random.default_rng(1)
    made = make(rng, epochs=5, antennas_b_m=antennas_b_m)
    prior = around(rng, made.R_nb, 5.0)
    arrays = spans(made.differences.baselines_b_m, made.differences.resolvable)
    columns, information = prior_columns(prior, arrays)
    r = arrays.rank[0]
    V = arrays.basis_b[0][:, :r]
    delta = 1e-4 * rng.normal(size=(5, 3))
    turned = (prior.R_nb @ rotations.exp(delta) @ V).swapaxes(1, 2).reshape(5, 3 * r)
    off = turned - columns[:, : 3 * r]
    cost = np.einsum("ni,nij,nj->n", off, information[:, : 3 * r, : 3 * r], off)
    P = prior.attitude_covariance_rad2
    if r == 1:  # only the two angles across the line are felt
        axes = np.linalg.svd(V.T)[2][1:]
        P, delta = axes @ P @ axes.T, delta @ axes.T
    expected = np.einsum("ni,nij,nj->n", delta, np.linalg.inv(P), delta)
    np.testing.assert_allclose(cost, expected, rtol=1e-3)


def test_prior_narrows_the_search_and_fixes_a_weak_pair():
    rng = np.random.default_rng(2)
    made = make(rng, epochs=400, antennas_b_m=PAIR_B_M, code_m=1.0, satellites=(5,))
    prior = around(rng, made.R_nb, 2.0)
    alone = search_constrained(made.differences, NODES)
    helped = search_constrained(made.differences, NODES, prior)
    assert helped.nodes.mean() < 0.1 * alone.nodes.mean()
    accepted = helped.wrong_probability < 1e-3
    assert accepted.mean() > 0.5
    assert accepted.mean() > 10 * (alone.wrong_probability < 1e-3).mean()
    right = (helped.cycles == made.cycles).all(axis=(1, 2))
    assert right[accepted].all()
    assert right.mean() > 0.95


def test_stated_probability_holds_with_a_prior():
    rng = np.random.default_rng(3)
    made = make(rng, epochs=1500, antennas_b_m=PAIR_B_M, code_m=1.0, satellites=(5,))
    found = search_constrained(made.differences, NODES, around(rng, made.R_nb, 6.0))
    wrong, stated = ~(found.cycles == made.cycles).all(axis=(1, 2)), found.wrong_probability
    for low, high in [(0.0, 0.03), (0.03, 0.2), (0.2, 1.0)]:
        of_bin = (stated >= low) & (stated < high)
        spread = np.sqrt((stated[of_bin] * (1 - stated[of_bin])).sum())
        assert of_bin.sum() > 50
        assert abs(wrong[of_bin].sum() - stated[of_bin].sum()) < 4 * spread + 1


def test_degrees_of_freedom_count_what_the_prior_knows():
    rng = np.random.default_rng(4)
    made = make(rng, epochs=400, antennas_b_m=TRIANGLE_B_M, satellites=(7,))
    found = search_constrained(made.differences, NODES, around(rng, made.R_nb, 1.0))
    right = (found.cycles == made.cycles).all(axis=(1, 2)) & (found.status == PROVEN)
    assert right.mean() > 0.95
    assert set(found.degrees) == {24}
    mean = found.costs[right, 0].mean()
    assert mean == pytest.approx(24.0, abs=4 * np.sqrt(2 * 24 / right.sum()) + 0.1)


def test_epoch_without_a_prediction_is_searched_without():
    rng = np.random.default_rng(5)
    made = make(rng, epochs=6, antennas_b_m=PAIR_B_M)
    prior = around(rng, made.R_nb, 2.0)
    R_nb = prior.R_nb.copy()
    R_nb[:3] = np.nan
    half = AttitudePrior(R_nb=R_nb, attitude_covariance_rad2=prior.attitude_covariance_rad2)
    alone = search_constrained(made.differences, NODES)
    found = search_constrained(made.differences, NODES, half)
    np.testing.assert_array_equal(found.costs[:3], alone.costs[:3])
    assert (found.degrees - alone.degrees).tolist() == [0, 0, 0, 2, 2, 2]


def test_prior_that_contradicts_the_epoch_is_refused():
    rng = np.random.default_rng(6)
    made = make(rng, epochs=20)
    off = made.R_nb @ rotations.exp(np.tile([0.0, 0.0, 0.5], (20, 1)))
    prior = AttitudePrior(
        R_nb=off, attitude_covariance_rad2=np.tile(np.eye(3) * np.radians(2.0) ** 2, (20, 1, 1))
    )
    found = Constrained(prior=prior, links_out=0)(made.differences, made.flight)
    assert not found.fixed.any()
    assert {loss.reason for loss in found.losses} == {
        "residuals of the array above chi-square at 0.0001"
    }


def test_prior_of_other_epochs_is_refused():
    made = make(np.random.default_rng(7), epochs=3)
    prior = around(np.random.default_rng(7), made.R_nb[:2], 1.0)
    with pytest.raises(BadInputError, match="attitude prior: has 2 epochs, the differences 3"):
        Constrained(prior=prior)(made.differences, made.flight)


def test_prior_that_is_no_rotation_or_no_covariance_is_refused():
    R_nb, P = np.eye(3)[None], np.eye(3)[None]
    with pytest.raises(BadInputError, match="R_nb: must be rotations, or NaN"):
        AttitudePrior(R_nb=1.1 * R_nb, attitude_covariance_rad2=P)
    with pytest.raises(BadInputError, match="R_nb: must be rotations, or NaN"):
        AttitudePrior(R_nb=-R_nb, attitude_covariance_rad2=P)
    with pytest.raises(BadInputError, match="covariance_rad2: must be positive definite"):
        AttitudePrior(R_nb=R_nb, attitude_covariance_rad2=-P)
