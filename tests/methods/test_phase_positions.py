"""Positions by phase in the smoother: against a base, without one, and with few satellites."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.frontend.position import antenna_motion
from fgnav.frontend.position.phase_positions import Attitudes, positions
from fgnav.integers.truth import Truth
from fgnav.methods.smoother import Batch, Smoother
from fgnav_sim.receiver_tables import OutageTable
from tests.gnss.based import flown
from tests.gnss.test_few_satellites import GAP_S, THREE_LEFT, TWO_LEFT, true_antenna, with_gap
from tests.methods.simulated import errors_rad, flown_with, nees

RIGHT = Truth()


def errors(flight, estimate):
    row = np.searchsorted(flight.truth.t_s, estimate.t_s - 1e-6)
    truth = flight.truth
    return estimate.p_n_m - truth.p_n_m[row], estimate.v_n_mps - truth.v_n_mps[row]


@pytest.mark.parametrize("method", [Batch(resolver=RIGHT), Smoother(resolver=RIGHT)])
@pytest.mark.parametrize("wind_up", [False, True])
def test_a_base_gives_centimetres_as_good_as_stated(method, wind_up):
    flight = flown(wind_up=wind_up)
    estimate = method(flight)
    place_m, speed_mps = errors(flight, estimate)
    assert np.sqrt((place_m**2).sum(axis=1).mean()) < 0.01
    assert 1.0 < nees(place_m, estimate.position_covariance_m2) < 4.5
    assert 1.0 < nees(speed_mps, estimate.velocity_covariance_m2ps2) < 4.5


def of_code(flight, code, _attitudes):
    """Positions of code alone."""
    truth = flight.truth
    by_phase = positions(flight, code, Attitudes(t_s=truth.t_s, R_nb=truth.R_nb))
    return replace(
        by_phase,
        p_n_m=code.p_n_m,
        noise_m2=code.position_noise_m2,
        arcs_m2=0 * code.position_noise_m2,
        segment=np.full(len(code.t_s), -1),
        common_m2=code.position_covariance_m2 - code.position_noise_m2,
    )


def test_phase_tells_velocity_and_attitude_better_than_code_and_doppler(monkeypatch):
    flight = flown(base=None, seed=2)
    with_phase = Batch(resolver=RIGHT)(flight)
    monkeypatch.setattr(antenna_motion, "positions", of_code)
    without = Batch(resolver=RIGHT)(flight)
    speed, speed_without = (errors(flight, e)[1] for e in (with_phase, without))
    assert np.sqrt((speed**2).mean()) < 0.5 * np.sqrt((speed_without**2).mean())
    turn, turn_without = (errors_rad(flight, e) for e in (with_phase, without))
    assert np.sqrt((turn**2).mean()) < 0.85 * np.sqrt((turn_without**2).mean())
    assert 1.0 < nees(turn, with_phase.attitude_covariance_rad2) < 4.5
    assert 1.0 < nees(speed, with_phase.velocity_covariance_m2ps2) < 4.5


def test_velocity_across_an_outage_is_as_uncertain_as_both_its_ends():
    """Eight flights with a gyroscope, ten seconds of them without any satellite."""
    squares = []
    for seed in range(8):
        outage = OutageTable(from_s=10.0, until_s=20.0)
        flight = flown_with("surroundings", 30.0, seed=seed, outages=(outage,))
        estimate = Batch(resolver=RIGHT)(flight)
        k = int(np.argmin(np.abs(estimate.t_s - 15.0)))
        truth = flight.truth
        row = int(np.argmin(np.abs(truth.t_s - estimate.t_s[k])))
        error = (truth.v_n_mps[row] - estimate.v_n_mps[k])[None]
        squares.append(nees(error, estimate.velocity_covariance_m2ps2[k][None]))
    assert 1.0 < np.mean(squares) < 5.5  # 24 degrees of freedom, 99.9 %


def gap_errors(flight, estimate):
    """Errors of position and velocity within the gap, less the shared one of positions."""
    p_n_m, v_n_mps = true_antenna(flight, estimate.t_s)
    inside = (estimate.t_s > GAP_S[0]) & (estimate.t_s < GAP_S[1])
    before = estimate.t_s < GAP_S[0]
    off_m = estimate.p_n_m - p_n_m
    return off_m[inside] - off_m[before].mean(axis=0), (estimate.v_n_mps - v_n_mps)[inside], inside


@pytest.mark.parametrize("method", [Smoother(resolver=RIGHT), Batch(resolver=RIGHT)])
def test_three_satellites_bridge_a_gap(monkeypatch, method):
    flight = with_gap(THREE_LEFT, seed=2)
    estimate = method(flight)
    off_m, off_mps, inside = gap_errors(flight, estimate)
    assert nees(off_mps, estimate.velocity_covariance_m2ps2[inside]) < 8
    monkeypatch.setattr(antenna_motion, "rank_deficient_of", lambda *_: None)
    blind_m, blind_mps, _ = gap_errors(flight, method(flight))
    assert np.linalg.norm(off_m, axis=1).max() < 0.5 * np.linalg.norm(blind_m, axis=1).max()
    assert (off_mps**2).mean() < (blind_mps**2).mean() / 2


def test_two_satellites_in_a_gap_without_attitude_change_nothing(monkeypatch):
    flight = with_gap(TWO_LEFT)
    estimate = Batch(resolver=RIGHT)(flight)
    monkeypatch.setattr(antenna_motion, "rank_deficient_of", lambda *_: None)
    without = Batch(resolver=RIGHT)(flight)
    np.testing.assert_allclose(estimate.p_n_m, without.p_n_m, rtol=0, atol=1e-9)
