"""Two or three satellites: what they tell, against least squares and against the truth."""

import dataclasses
from pathlib import Path

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.gnss.arc_adjustment import adjust_arcs
from fgnav.gnss.code_solution import code_solution
from fgnav.gnss.few_satellites import Partial, _reduced, few_positions, few_velocities
from fgnav.gnss.position_phase import position_phase
from fgnav.integers.truth import attitude_at
from fgnav_sim.receiver_tables import OutageTable
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

SCENARIO = Path(__file__).resolve().parents[2] / "sim" / "scenarios" / "six.toml"
GAP_S = (4.0, 9.0)
THREE_LEFT, TWO_LEFT = (0.0, 100.0), (0.0, 170.0)


def with_gap(azimuth_deg, seed=1, span_s=13.0):
    """A flight of six satellites that loses those of a sector for five seconds."""
    scenario = load_scenario(SCENARIO)
    outage = OutageTable(from_s=GAP_S[0], until_s=GAP_S[1], azimuth_deg=azimuth_deg)
    gnss = msgspec.structs.replace(scenario.gnss, outages=(outage,))
    scenario = msgspec.structs.replace(scenario, duration_s=span_s, gnss=gnss)
    return simulate(scenario, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def flight():
    return with_gap(THREE_LEFT)


def true_antenna(flight, t_s):
    """Place of the reference antenna, and velocity of the body, at times."""
    truth = flight.truth
    p, v = (
        np.stack([np.interp(t_s, truth.t_s, column) for column in values.T], axis=1)
        for values in (truth.p_n_m, truth.v_n_mps)
    )
    R_nb, _ = attitude_at(truth, t_s)
    return p + R_nb @ flight.antennas[0].position_b_m, v


def mean_square(partial, true):
    whitened = np.einsum("kij,kj->ki", partial.root, partial.value - true)
    return (whitened**2).sum() / partial.root.any(axis=2).sum()


def test_clocks_are_eliminated_as_by_least_squares():
    rng = np.random.default_rng(0)
    clock = np.eye(2)[[0, 0, 0, 0, 1, 1, 1, 1]]
    A = np.concatenate([rng.standard_normal((8, 3)), clock], axis=1)[None]
    y, weight = rng.standard_normal((1, 8)), rng.uniform(1, 2, (1, 8))
    found = _reduced(A, y, weight)
    N = A[0].T @ (weight[0, :, None] * A[0])
    covariance = np.linalg.inv(N)
    assert_allclose(found.root[0].T @ found.root[0], np.linalg.inv(covariance[:3, :3]), rtol=1e-9)
    x = covariance @ A[0].T @ (weight[0] * y[0])
    assert_allclose(found.value[0], x[:3], rtol=1e-9, atol=1e-12)
    assert_allclose(found.gain[0] @ y[0], x[:3], rtol=1e-9, atol=1e-12)


def test_an_open_direction_is_told_nothing_about():
    rng = np.random.default_rng(1)
    A = np.concatenate([rng.standard_normal((3, 3)), np.ones((3, 1))], axis=1)[None]
    truth = np.array([3.0, -2.0, 5.0])
    y = (A[0] @ np.append(truth, 7.0))[None]
    found = _reduced(A, y, np.full((1, 3), 4.0))
    assert found.root.any(axis=2).sum() == 2
    assert_allclose(found.root[0] @ (truth - found.value[0]), 0, atol=1e-9)


def test_contradicting_measurements_are_not_sound():
    A = np.array([[[1.0, 0, 0, 1], [1.0, 0, 0, 1], [-1.0, 0, 0, 1]]])
    weight = np.ones((1, 3))
    assert _reduced(A, np.array([[0.0, 1.0, 0.0]]), weight).sound[0]
    assert not _reduced(A, np.array([[0.0, 10.0, 0.0]]), weight).sound[0]


def test_noise_is_added_in_the_known_directions():
    root = np.diag([2.0, 1.0, 0.0])[None]
    partial = Partial(t_s=np.zeros(1), value=np.zeros((1, 3)), root=root)
    noisy = partial.with_noise(np.eye(3))
    assert_allclose(np.diag(noisy.root[0].T @ noisy.root[0]), [1 / 1.25, 1 / 2, 0], rtol=1e-12)


def test_three_satellites_hold_the_antenna_to_millimetres_in_two_directions(flight):
    adjustment = adjust_arcs(position_phase(flight, base=False), ("models", "a1"))
    few, full = few_positions(adjustment), adjustment.positions()
    assert len(few.t_s) == 50
    assert (few.root.any(axis=2).sum(axis=1) == 2).all()
    near = np.abs(full.t_s - GAP_S[0]) < 2
    # Of the error that all positions share, the full ones before the gap tell how large it is.
    shared_m = (full.p_n_m - true_antenna(flight, full.t_s)[0])[near].mean(axis=0)
    assert 0.8 < mean_square(few, true_antenna(flight, few.t_s)[0] + shared_m) < 1.25
    sigma_m = 1 / np.linalg.svd(few.root, compute_uv=False)[:, :2]
    assert (sigma_m < 0.02).all()


def test_two_satellites_tell_one_direction():
    flight = with_gap(TWO_LEFT)
    adjustment = adjust_arcs(position_phase(flight, base=False), ("models", "a1"))
    assert (few_positions(adjustment).root.any(axis=2).sum(axis=1) == 1).all()
    few = few_velocities(flight, code_solution(flight).t_s)
    assert len(few.t_s) == 50
    assert (few.root.any(axis=2).sum(axis=1) == 1).all()


def test_dopplers_of_three_satellites_agree_with_the_velocity(flight):
    few = few_velocities(flight, code_solution(flight).t_s)
    assert len(few.t_s) == 50
    # The antenna is the body's origin here.
    assert not flight.antennas[0].position_b_m.any()
    assert 0.75 < mean_square(few, true_antenna(flight, few.t_s)[1]) < 1.3


def test_a_slip_among_three_satellites_shows_in_their_doppler(flight):
    seen = flight.observations
    k = int(np.searchsorted(seen.t_s, 6.0))
    channel = np.flatnonzero(np.isfinite(seen.code_m[k, 0]))[0]
    cycles = seen.phase_cycles.copy()
    cycles[k:, 0, channel] += 1
    slipped = dataclasses.replace(
        flight, observations=dataclasses.replace(seen, phase_cycles=cycles)
    )
    before, after = (position_phase(one, base=False).single for one in (flight, slipped))
    changed = before.lock_flags[:, 1] != after.lock_flags[:, 1]
    assert changed.sum() == 1
    assert changed[k].any()


def test_a_flight_with_enough_satellites_has_no_such_epochs():
    flight = with_gap(THREE_LEFT, span_s=3.0)
    adjustment = adjust_arcs(position_phase(flight, base=False), ("models", "a1"))
    assert not len(few_positions(adjustment).t_s)
    assert not len(few_velocities(flight, code_solution(flight).t_s).t_s)
