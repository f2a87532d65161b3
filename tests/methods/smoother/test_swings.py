"""Gaps crossed as a body moves otherwise, against the truth and against a random walk."""

import dataclasses
from functools import cache

import gtsam
import msgspec
import numpy as np
import pytest

from fgnav import rotations
from fgnav.integers.truth import Truth
from fgnav.methods.smoother import Batch, links, swings
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.motion_factor import preintegrated
from fgnav.methods.smoother.smoother import collected_for
from fgnav_sim.receiver_tables import OutageTable
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.methods.simulated import SCENARIOS, errors_rad

FROM_S, UNTIL_S = 15.0, 20.0
BATCH = Batch(resolver=Truth())


@cache
def flown(from_s=FROM_S, until_s=UNTIL_S, span_s=35.0):
    scenario = load_scenario(SCENARIOS / "demo.toml")
    gnss = msgspec.structs.replace(
        scenario.gnss, outages=(OutageTable(from_s=from_s, until_s=until_s),)
    )
    scenario = msgspec.structs.replace(scenario, duration_s=span_s, gnss=gnss)
    return simulate(scenario, np.random.default_rng(3))


@cache
def estimated():
    return BATCH(flown())


@cache
def crossed():
    keyframes = collected_for(BATCH, flown()).keyframes
    return keyframes, *swings.across_gaps(keyframes, solve_batch(keyframes))


def in_gap(t_s):
    return (t_s > FROM_S) & (t_s < UNTIL_S)


def test_a_swing_goes_on_through_a_gap():
    """On a cubic, attitudes err by 48 degrees; the accelerometer then tells positions, too."""
    flight, estimate = flown(), estimated()
    error, gap = errors_rad(flight, estimate), in_gap(estimate.t_s)
    assert np.degrees(np.linalg.norm(error[gap], axis=1)).max() < 5
    sigma = np.sqrt(np.einsum("nii->ni", estimate.attitude_covariance_rad2))
    assert (np.abs(error) < 3 * sigma).mean() >= 0.99
    assert np.degrees(np.sqrt((sigma[gap] ** 2).sum(axis=1)).max()) < 10
    place = np.stack([np.interp(estimate.t_s, flight.truth.t_s, x) for x in flight.truth.p_n_m.T])
    assert np.linalg.norm(estimate.p_n_m - place.T, axis=1).max() < 1
    assert any(note.startswith("Across 14.90 to 20.00 s it turns") for note in estimate.notes)


def test_rates_in_a_gap_are_those_of_the_attitudes():
    estimate = estimated()
    turned = rotations.log(rotations.transpose(estimate.R_nb[:-2]) @ estimate.R_nb[2:])
    mean_radps = turned / (estimate.t_s[2:] - estimate.t_s[:-2])[:, None]
    gap = in_gap(estimate.t_s[1:-1])
    rate = estimate.angular_rate_b_radps[1:-1][gap]
    np.testing.assert_allclose(rate, mean_radps[gap], rtol=0, atol=0.01)


def test_any_time_in_a_gap_is_on_the_same_way():
    estimate = estimated()
    t_s = estimate.t_s[in_gap(estimate.t_s)][::7]
    between = BATCH.at(flown(), t_s + 0.04)
    rows = np.searchsorted(estimate.t_s, t_s - 1e-3)
    ahead = rotations.exp(0.04 * estimate.angular_rate_b_radps[rows])
    off = rotations.log(rotations.transpose(estimate.R_nb[rows] @ ahead) @ between.R_nb)
    assert np.degrees(np.abs(off).max()) < 0.1


def test_foretold_rates_enter_gtsams_factors_as_ours():
    _, keyframes, _ = crossed()
    row = int(np.flatnonzero(in_gap(keyframes.t_s))[10])
    about, ours = keyframes.slot[row - 1 : row], links.empty_motions(1)
    links.integrate(ours, np.array([0]), links.samples_of(keyframes), np.array([row]), about)
    theirs = preintegrated(
        keyframes.preintegrate, row - 1, gtsam.imuBias.ConstantBias(*np.split(about[0], 2))
    )
    np.testing.assert_allclose(
        rotations.exp(ours.gained[:, :3])[0], theirs.deltaRij().matrix(), rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(ours.gained[0, 6:], theirs.deltaVij(), rtol=0, atol=1e-11)


def test_rates_that_are_counted_from_others_are_where_they_were():
    """Outside the gap and its edges nothing starts elsewhere."""
    before, after, notes = crossed()
    assert len(notes) == 1
    apart = (before.t_s < FROM_S - 1) | (before.t_s > UNTIL_S + 1)
    solved = solve_batch(before)
    start = dataclasses.replace(before, slot=solved.slot)
    np.testing.assert_allclose(
        after.rate_b_radps[apart], start.rate_b_radps[apart], rtol=0, atol=1e-12
    )
    assert np.abs(after.slot[apart, 3:] - before.slot[apart, 3:]).max() > 0.1


def test_a_flight_without_gaps_stays_as_it_is():
    scenario = load_scenario(SCENARIOS / "demo.toml")
    scenario = msgspec.structs.replace(scenario, duration_s=10.0)
    keyframes = collected_for(BATCH, simulate(scenario, np.random.default_rng(0))).keyframes
    assert swings.across_gaps(keyframes, solve_batch(keyframes)) == (keyframes, ())


@pytest.mark.parametrize("from_s", [0.35, 2.0, 14.0])
def test_a_gap_with_too_little_beside_it_stays_on_the_cubic(from_s):
    """Seen for less than what rates lag, and for less than what an autoregression takes."""
    keyframes = collected_for(BATCH, flown(from_s, from_s + 4.0, 18.35)).keyframes
    same, notes = swings.across_gaps(keyframes, solve_batch(keyframes))
    assert same is keyframes
    assert not notes


def test_two_gaps_with_next_to_nothing_between_them_are_crossed_one_after_another():
    scenario = load_scenario(SCENARIOS / "demo.toml")
    outages = (OutageTable(from_s=13.0, until_s=16.0), OutageTable(from_s=16.5, until_s=19.5))
    gnss = msgspec.structs.replace(scenario.gnss, outages=outages)
    scenario = msgspec.structs.replace(scenario, duration_s=32.0, gnss=gnss)
    flight = simulate(scenario, np.random.default_rng(5))
    estimate = BATCH(flight)
    assert sum("it turns as it does otherwise" in note for note in estimate.notes) == 2
    error = errors_rad(flight, estimate)
    assert np.degrees(np.linalg.norm(error, axis=1).max()) < 10
    sigma = np.sqrt(np.einsum("nii->ni", estimate.attitude_covariance_rad2))
    assert (np.abs(error) < 3 * sigma).mean() >= 0.99
