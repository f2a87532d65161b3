"""Errors of satellites: believed as stated where they are there, and as they are where not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import chdtri

from fgnav.assembly.position.numbered_arcs import Observed
from fgnav.assembly.position.phases import antenna_phase
from fgnav.gnss.undifferenced import undifferenced
from fgnav.graph.types.parameters import Parameters
from fgnav.methods.smoother import Smoother
from fgnav.noise.satellite_errors import (
    ERRORS,
    SatelliteErrors,
    satellite_error_factors,
    with_errors,
)
from fgnav.types.flight import GnssNoise
from tests.gnss.based import flown

SIZE, WALK, RATE, CODE, PHASE = ERRORS


def phases(seed, span_s=20.0, stated=None, **gnss):
    """Return phases of a flight, which states other sizes of errors than it has where asked."""
    flight = flown.__wrapped__(base=None, span_s=span_s, seed=seed, **gnss)
    flight = replace(flight, gnss_noise=replace(flight.gnss_noise, **(stated or {})))
    of, truth = undifferenced(flight), flight.truth
    rows = np.arange(len(of.t_s))
    R_nb = truth.R_nb[np.searchsorted(truth.t_s, of.t_s - 1e-6)]
    observed = Observed(of, rows, rows, np.zeros(3))
    return antenna_phase((observed,), of.t_s, R_nb, Parameters()).phase


def dense_log_likelihood(phase):
    """Return it of all rows at once, a place free at every epoch; but for a constant."""
    first = np.cumsum([0, *(one.size for one in phase.blocks)])
    width, rows, right = first[-1] + 3 * len(phase.row), [], []
    for j, one in enumerate(phase.blocks):
        row = np.zeros((len(one.right), width))
        row[:, first[j] : first[j + 1]] = one.after
        if j:
            row[:, first[j - 1] : first[j]] = -one.before
        rows.append(row)
        right.append(one.right)
    for i, (j, one) in enumerate(zip(phase.block, phase.rows, strict=True)):
        row = np.zeros((len(one.z), width))
        row[:, first[j] : first[j + 1]] = one.H
        row[:, first[-1] + 3 * i : first[-1] + 3 * i + 3] = one.G
        rows.append(row)
        right.append(one.z)
    A, b = np.vstack(rows), np.concatenate(right)
    R = np.linalg.qr(np.column_stack([A, b]), mode="r")
    return -(R[-1, -1] ** 2) / 2 - np.log(np.abs(np.diag(R)[:-1])).sum()


def test_the_likelihood_is_that_of_all_rows_at_once():
    phase, theta = phases(93_020, 4.0, message_errors=True), np.array([0.3, -0.5, 0.8, 0.4, 0.2])
    errors = SatelliteErrors(phase)
    factors = dict(zip(ERRORS, np.exp(theta), strict=True))
    changed = dense_log_likelihood(with_errors(phase, factors)) - dense_log_likelihood(phase)
    own = errors.log_likelihood(theta) - errors.log_likelihood(np.zeros(5))
    # Squares have half the digits of rows; what is asked of it are units.
    places = 3 * len(phase.row) * theta[-1]  # dense, they are among the unknowns
    np.testing.assert_allclose(own, changed - errors.count @ theta - places, rtol=0, atol=1e-3)


@pytest.mark.parametrize("seed", range(93_000, 93_006))
def test_errors_as_stated_stay_near_the_nominal(seed):
    factors = satellite_error_factors(phases(seed, message_errors=True))
    assert all(1 / 2 < factor < 2 for factor in factors.values())


def test_perfect_messages_are_believed_no_further_than_one_prior_sigma():
    usual = GnssNoise()
    names = ("message_errors", "satellite_error_rate_mps", "satellite_error_walk_m_per_sqrt_s")
    stated = {name: getattr(usual, name) for name in names}
    found = satellite_error_factors(phases(93_010, stated=stated))
    assert SIZE not in found
    assert CODE not in found
    assert 1 / 3 <= found[WALK] < 0.4


def test_errors_that_move_faster_than_stated_are_found():
    moving = {"satellite_error_rate_mps": 2e-2, "message_errors": True}
    found = satellite_error_factors(
        phases(93_011, stated={"satellite_error_rate_mps": 2e-4}, **moving)
    )
    assert abs(np.log(found[RATE] / 100)) < 4 / np.sqrt(2 * 4)  # four satellites more than a place


@pytest.mark.filterwarnings("error")
def test_errors_stated_beyond_all_digits_are_searched_without_a_warning():
    phase = phases(93_013, 4.0, stated={"satellite_error_rate_mps": 1e9}, message_errors=True)
    assert satellite_error_factors(phase).get(RATE, 1.0) <= 1.0


def test_codes_louder_than_stated_are_found():
    found = satellite_error_factors(phases(93_012, stated={"code_m": 0.1}, message_errors=True))
    assert abs(np.log(found[CODE] / 3)) < 4 / np.sqrt(2 * 20 * 7)  # a second apart, eight of them


@pytest.mark.parametrize("seed", [93_030, 93_031])
def test_positions_are_as_good_as_their_covariance_says(seed):
    flight = flown.__wrapped__(base=None, span_s=20.0, seed=seed)
    estimate = Smoother()(flight)
    true_n_m = flight.truth.p_n_m[np.searchsorted(flight.truth.t_s, estimate.t_s - 1e-6)]
    off_n_m = estimate.p_n_m - true_n_m
    nees = np.einsum(
        "ni,nij,nj->n", off_n_m, np.linalg.inv(estimate.position_covariance_m2), off_n_m
    )
    # One error of the whole flight, of three dimensions.
    assert nees.mean() < chdtri(3, 1e-3)
    assert np.sqrt((off_n_m**2).sum(axis=1).mean()) < 1.0
