"""Positions by phase in the smoother: centimetres against a base, and better motion without one."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.gnss.code_solution import code_solution
from fgnav.integers.truth import Truth
from fgnav.methods.smoother import Batch, Smoother
from fgnav.methods.smoother.base import Attitudes, positions
from fgnav_sim.receiver_tables import OutageTable
from tests.gnss.based import antenna_n_m, flown
from tests.gnss.test_position_phase import rows
from tests.methods.simulated import errors_rad, nees

RIGHT = Truth()


def found_in(flight):
    truth = flight.truth
    return positions(flight, code_solution(flight), Attitudes(t_s=truth.t_s, R_nb=truth.R_nb))


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
    assert any(
        note.startswith("Positions against the base: integers known at 100.0 % of epochs")
        for note in estimate.notes
    )


def test_phase_tells_velocity_and_attitude_better_than_code_and_doppler(monkeypatch):
    flight = flown(base=None, seed=2)
    with_phase = Batch(resolver=RIGHT)(flight)
    monkeypatch.setattr("fgnav.methods.smoother.antenna_motion.positions", of_code)
    without = Batch(resolver=RIGHT)(replace(flight))  # with nothing known of it
    speed, speed_without = (errors(flight, e)[1] for e in (with_phase, without))
    assert np.sqrt((speed**2).mean()) < 0.5 * np.sqrt((speed_without**2).mean())
    turn, turn_without = (errors_rad(flight, e) for e in (with_phase, without))
    assert np.sqrt((turn**2).mean()) < 0.85 * np.sqrt((turn_without**2).mean())
    assert 1.0 < nees(turn, with_phase.attitude_covariance_rad2) < 4.5
    assert 1.0 < nees(speed, with_phase.velocity_covariance_m2ps2) < 4.5


def of_code(flight, code, attitudes):
    """What positions were before phase: those of code."""
    assert len(attitudes.t_s)
    found = found_in(flight)
    return replace(
        found,
        p_n_m=code.p_n_m,
        noise_m2=code.position_noise_m2,
        arcs_m2=0 * code.position_noise_m2,
        piece=np.full(len(code.t_s), -1),
        common_m2=code.position_covariance_m2 - code.position_noise_m2,
    )


def test_fixed_positions_have_nothing_in_common_that_is_larger_than_they_are():
    flight = flown()
    found = found_in(flight)
    assert found.fixed.all()
    assert not found.losses
    error = found.p_n_m - antenna_n_m(flight, code_solution(flight).t_s)
    assert 2.0 < nees(error, found.noise_m2 + found.arcs_m2 + found.common_m2) < 4.0


def test_a_base_that_records_once_a_second_leaves_the_rest_to_code_and_says_so():
    flight = flown()
    seldom = np.arange(0, 200, 10)
    flight = replace(flight, base=replace(flight.base, observations=rows(flight.base, seldom)))
    found = found_in(flight)
    assert found.fixed.sum() == 20
    assert found.losses[-1].count == 180
    assert found.losses[-1].reason == "no epoch of the base, or too few arcs"


def test_a_base_of_another_day_is_no_base():
    flight = flown(span_s=5.0)
    later = replace(
        flight.base.observations,
        t_s=flight.base.observations.t_s + 1e4,
        tag_s=flight.base.observations.tag_s + 1e4,
    )
    found = found_in(replace(flight, base=replace(flight.base, observations=later)))
    assert not found.fixed.any()
    assert found.losses[0].reason == "no epoch of the base, or too few arcs"
    assert found.losses[0].count == 50


def test_a_spin_wound_up_beyond_repair_keeps_its_code_and_says_why():
    flight = flown(name="spin", base=None, wind_up=True)
    still = Attitudes(t_s=flight.truth.t_s[:1], R_nb=np.eye(3)[None])
    found = positions(flight, code_solution(flight), still)
    np.testing.assert_array_equal(found.p_n_m, code_solution(flight).p_n_m)
    assert found.notes[0].startswith("Positions are those of code: position by phase:")


def test_what_an_outage_parts_is_told_apart_from_the_rest():
    flight = flown(base=None, outages=(OutageTable(from_s=12.0, until_s=15.0),))
    found = found_in(flight)
    after = code_solution(flight).t_s >= 15.0
    np.testing.assert_array_equal(found.piece, after)  # the longer one comes first
    assert np.sqrt(np.einsum("nii->n", found.noise_m2)).max() < 0.01
    assert np.sqrt(np.einsum("nii->n", found.arcs_m2)).min() > 0.05
