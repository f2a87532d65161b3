"""Positions by carrier phase: centimetres against a base, the way from epoch to epoch without."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.frontend.position.phase_positions import Attitudes, positions
from fgnav.gnss.code_solution import code_solution
from fgnav.rotations import exp
from fgnav_sim.receiver_tables import OutageTable
from tests.gnss.based import antenna_n_m, flown
from tests.gnss.test_position_phase import rows
from tests.methods.simulated import nees


def positions_of(flight):
    truth = flight.truth
    return positions(flight, code_solution(flight), Attitudes(t_s=truth.t_s, R_nb=truth.R_nb))


def test_fixed_positions_are_good_to_centimetres_and_have_no_larger_error_in_common():
    flight = flown()
    by_phase = positions_of(flight)
    assert by_phase.fixed.all()
    assert not by_phase.losses
    assert by_phase.notes[0].startswith(
        "Positions against the base: integers known at 100.0 % of epochs, all right but for"
    )
    error = by_phase.p_n_m - antenna_n_m(flight, code_solution(flight).t_s)
    assert np.sqrt((error**2).sum(axis=1).mean()) < 0.02
    assert 2.0 < nees(error, by_phase.noise_m2 + by_phase.arcs_m2 + by_phase.common_m2) < 4.0


def test_without_a_base_phase_tells_the_way_to_millimetres_and_code_where_it_is():
    flight = flown(base=None, seed=2)
    by_phase, code = positions_of(flight), code_solution(flight)
    error = by_phase.p_n_m - antenna_n_m(flight, code.t_s)
    own = error - error.mean(axis=0)  # but for what all epochs share
    by_code = code.p_n_m - antenna_n_m(flight, code.t_s)
    assert np.sqrt((own**2).mean()) < 0.01
    assert np.sqrt((by_code - by_code.mean(axis=0)).var()) > 0.2
    shared = (by_phase.arcs_m2 + by_phase.common_m2).mean(axis=0)
    assert nees(error.mean(axis=0)[None], shared[None]) < 16.3  # of three at 99.9 %
    assert (by_phase.segment == 0).all()
    assert not by_phase.fixed.any()


def test_a_base_that_records_once_a_second_leaves_the_rest_to_code_and_lists_it():
    flight = flown()
    seldom = np.arange(0, 200, 10)
    flight = replace(flight, base=replace(flight.base, observations=rows(flight.base, seldom)))
    by_phase = positions_of(flight)
    assert by_phase.fixed.sum() == 20
    assert by_phase.losses[-1].count == 180
    assert by_phase.losses[-1].reason == "no epoch of the base, or too few arcs"


def test_a_base_of_another_day_is_no_base():
    flight = flown(span_s=5.0)
    later = replace(
        flight.base.observations,
        t_s=flight.base.observations.t_s + 1e4,
        tag_s=flight.base.observations.tag_s + 1e4,
    )
    by_phase = positions_of(replace(flight, base=replace(flight.base, observations=later)))
    assert not by_phase.fixed.any()
    assert by_phase.losses[0].reason == "no epoch of the base, or too few arcs"
    assert by_phase.losses[0].count == 50


def test_a_spin_wound_up_beyond_repair_keeps_its_code_with_the_reason():
    flight = flown(name="spin", base=None, wind_up=True)
    still = Attitudes(t_s=flight.truth.t_s[:1], R_nb=np.eye(3)[None])
    by_phase = positions(flight, code_solution(flight), still)
    np.testing.assert_array_equal(by_phase.p_n_m, code_solution(flight).p_n_m)
    assert (by_phase.segment == -1).all()
    assert by_phase.adjustment is None
    assert by_phase.notes[0].startswith("Positions are those of code: position by phase:")


def test_an_outage_parts_positions_into_segments_the_longest_first():
    flight = flown(base=None, outages=(OutageTable(from_s=12.0, until_s=15.0),))
    by_phase = positions_of(flight)
    after = code_solution(flight).t_s >= 15.0
    np.testing.assert_array_equal(by_phase.segment, after)
    assert np.sqrt(np.einsum("nii->n", by_phase.noise_m2)).max() < 0.01
    assert np.sqrt(np.einsum("nii->n", by_phase.arcs_m2)).min() > 0.05


def test_attitudes_turn_evenly_in_between_and_stay_beyond_the_ends():
    turn = np.array([[0.0, 0, 0], [0.4, 0.2, 0]])
    attitudes = Attitudes(t_s=np.array([1.0, 2.0]), R_nb=exp(turn))
    share = np.array([[0.0], [0.25], [1.0], [1.0]])
    expected = exp(share * turn[1])
    turned = attitudes.at(np.array([0.0, 1.25, 2.0, 7.0]))
    np.testing.assert_allclose(turned, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("wind_up", [False, True])
def test_turns_of_the_antenna_are_taken_off_where_residuals_ask_for_it(wind_up):
    flight = flown(wind_up=wind_up)
    by_phase = positions_of(flight)
    error = by_phase.p_n_m - antenna_n_m(flight, code_solution(flight).t_s)
    assert by_phase.fixed.all()
    assert np.sqrt((error**2).sum(axis=1).mean()) < 0.02
