"""Recordings with holes: bridged within what is stated."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from fgnav.geometry.interpolation import interpolate
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.solve.gauss_newton import gauss_newton, posterior_at
from fgnav_sim.gnss.tables import OutageTable
from fgnav_sim.simulate import simulate
from tests.alignment.test_gaps import with_hole
from tests.assembly.test_problem import PER_EPOCH, with_outages
from tests.methods.simulated import errors_rad, nees, shared
from tests.methods.test_truncation import scenario

BATCH = Batch(resolver=Truth(), noise="nominal")


def within_three_sigma(flight, estimate):
    """Axis by axis, (n, 6): all six normal errors at once are within at 98.4 % of epochs."""
    sigma = np.sqrt(np.einsum("nii->ni", estimate.attitude_covariance_rad2))
    attitude = np.abs(errors_rad(flight, estimate)) < 3 * sigma
    truth = flight.truth
    place = interpolate(estimate.t_s, truth.t_s, truth.p_n_m)
    sigma = np.sqrt(np.einsum("nii->ni", estimate.position_covariance_m2))
    return np.hstack([attitude, np.abs(estimate.p_n_m - place) < 3 * sigma])


OTHERS = tuple(f"a{k}" for k in (1, 3, 4, 5, 6, 7, 8))


@pytest.mark.parametrize(
    ("outage", "span_s", "largest_deg"),
    [
        (OutageTable(from_s=12.0, until_s=17.0), 25.0, np.inf),
        (OutageTable(from_s=12.0, until_s=27.0), 35.0, np.inf),
        (OutageTable(from_s=5.0, until_s=15.0, antennas=("a3",)), 20.0, 2.0),
        (OutageTable(from_s=0.0, until_s=30.0, antennas=("a1",)), 20.0, np.inf),
        (OutageTable(from_s=8.0, until_s=10.0, antennas=OTHERS), 20.0, np.inf),
    ],
    ids=["all, 5 s", "all, 15 s", "one antenna", "the reference, for good", "all but one antenna"],
)
def test_an_outage_is_bridged_within_what_is_stated(outage, span_s, largest_deg):
    flight = with_outages(outage, span_s=span_s)
    estimate = BATCH(flight)
    assert estimate.available == 1
    assert within_three_sigma(flight, estimate).mean() >= 0.99
    assert np.degrees(np.linalg.norm(errors_rad(flight, estimate), axis=1)).max() < largest_deg
    note = f"No position from 11.90 to {outage.until_s:.2f} s."
    assert (note in estimate.notes) == (not outage.antennas)


def test_epochs_that_are_not_in_the_file_have_estimates_all_the_same():
    flight = with_outages()
    seen = flight.observations
    keep = (seen.t_s < 8.0) | (seen.t_s > 10.05)
    rest = dataclasses.replace(seen, **{name: getattr(seen, name)[keep] for name in PER_EPOCH})
    estimate = BATCH(dataclasses.replace(flight, observations=rest))
    np.testing.assert_allclose(estimate.t_s, seen.t_s, atol=0.02)
    assert within_three_sigma(flight, estimate).mean() >= 0.99


def test_a_hole_in_the_inertial_record_is_bridged():
    flight = with_outages()
    holed = dataclasses.replace(flight, imu=with_hole(flight.imu, 6.0, 11.0))
    estimate = BATCH(holed)
    assert estimate.converged
    assert estimate.available == 1
    assert within_three_sigma(flight, estimate).mean() >= 0.99


def test_a_minute_without_satellites_leaves_a_filter_within_what_it_states():
    """Normal equations lose the position: elimination goes on by rows."""
    flight = with_outages(OutageTable(from_s=6.0, until_s=66.0), span_s=70.0)
    estimate = Forward(resolver=Truth(), noise="nominal")(flight)
    assert estimate.available == 1
    sigma_m = np.sqrt(np.einsum("nii->ni", estimate.position_covariance_m2)).max(axis=1)
    assert sigma_m[655] > 1000 > 10 > sigma_m[680]
    assert within_three_sigma(flight, estimate).mean() >= 0.99


@pytest.mark.parametrize("antennas", [("a1",), ("a1", "a2")])
def test_attitude_and_position_outlive_the_reference_antenna(antennas):
    flight = with_outages(OutageTable(from_s=5.0, until_s=15.0, antennas=antennas))
    estimate = BATCH(flight)
    assert estimate.converged
    assert within_three_sigma(flight, estimate).mean() >= 0.99
    during = (estimate.t_s > 5) & (estimate.t_s < 15)
    # Without another reference the body turns unseen: tens of degrees.
    assert np.degrees(np.linalg.norm(errors_rad(flight, estimate)[during], axis=1)).max() < 1
    truth = flight.truth
    place = interpolate(estimate.t_s, truth.t_s, truth.p_n_m)
    error = estimate.p_n_m - place  # nearly the same all along a flight: a sample of chi-square
    nees_of_position = np.einsum(
        "ni,nij,nj->n", error, np.linalg.inv(estimate.position_covariance_m2), error
    )
    assert np.median(nees_of_position) < 16.3  # of three at 99.9 %


GAP = OutageTable(from_s=30.0, until_s=45.0)


@cache
def without_satellites(seed):
    return simulate(scenario("beacon", 50.0, outages=(GAP,)), np.random.default_rng(seed))


@pytest.mark.parametrize(
    ("method", "seed"),
    [(Smoother(noise="nominal"), 20_001), (Forward(noise="nominal"), 20_001), (Batch(), 20_104)],
    ids=lambda one: getattr(one, "name", one),
)
def test_fifteen_seconds_without_satellites_are_solved_by_every_method(method, seed):
    """A detector sees a beacon all along; its line of sight leaves the roll to the body's swing.

    Along the valley of the second flight the cost bends before a whole Newton step ends.
    """
    gap, flight = GAP, without_satellites(seed)
    estimate = shared(method, flight)
    assert estimate.converged
    error, P = errors_rad(flight, estimate), estimate.attitude_covariance_rad2
    turned, sigma = np.linalg.norm(error, axis=1), np.sqrt(np.einsum("nii->n", P))
    assert np.degrees(sigma).max() < 30.0
    assert (turned < 3 * sigma).mean() >= 0.99
    after = estimate.t_s >= gap.until_s
    assert np.degrees(sigma[after]).max() < 1.0
    assert nees(error[after], P[after]) < 4.0


def test_a_search_along_a_valley_ends_where_a_newton_step_is_short():
    problem = Batch(noise="nominal").prepare(without_satellites(20_104)).problem
    end = gauss_newton(problem).solution
    assert end.converged
    assert end.updates > 10  # where Newton's own steps lead, five or six are enough
    assert posterior_at(problem, end.states).converged
