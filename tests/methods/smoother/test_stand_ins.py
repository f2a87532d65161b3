import dataclasses

import msgspec
import numpy as np
import pytest

from fgnav.integers.truth import Truth
from fgnav.methods.smoother import Batch
from fgnav.methods.smoother.stand_ins import references_told, stood_in, views
from fgnav_sim.receiver_tables import OutageTable
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.methods.simulated import SCENARIOS, errors_rad
from tests.methods.smoother.test_gaps import within_three_sigma


def flown(*outages, span_s=20.0):
    scenario = load_scenario(SCENARIOS / "demo.toml")
    gnss = msgspec.structs.replace(scenario.gnss, outages=outages)
    scenario = msgspec.structs.replace(scenario, duration_s=span_s, gnss=gnss)
    return simulate(scenario, np.random.default_rng(1))


def gone(from_s, until_s, *antennas):
    return OutageTable(from_s=from_s, until_s=until_s, antennas=antennas)


def test_a_flight_whose_reference_is_never_gone_is_its_own_view():
    flight = flown()
    (view,) = views(flight)
    assert view.flight is flight
    assert len(view.rows) == len(flight.observations.t_s)
    assert not [*references_told((view,))]


def test_others_stand_in_one_after_another_with_their_own_antennas_first():
    others = [f"a{k}" for k in range(3, 9)]
    flight = flown(gone(5.0, 9.0, "a1"), gone(5.0, 6.0, *others), gone(6.0, 9.0, "a2"))
    whole, second, third = views(flight)
    assert whole.flight is flight
    assert {view.flight.antennas[0].name for view in (second, third)} == {"a2", "a3"}
    np.testing.assert_array_equal(np.sort([*second.rows, *third.rows]), np.arange(50, 90))
    for view in (second, third):
        column = flight.antennas.index(view.flight.antennas[0])
        seen, own = flight.observations, view.flight.observations
        np.testing.assert_array_equal(own.code_m[:, 0], seen.code_m[view.rows, column])
        np.testing.assert_array_equal(own.tag_s[:, 0], seen.tag_s[view.rows, column])


def test_a_reference_that_never_tracks_is_replaced_for_good():
    flight = flown(gone(0.0, 30.0, "a1"))
    (view,) = views(flight)
    assert view.flight.antennas[0].name != "a1"
    assert len(view.rows) == len(flight.observations.t_s)
    estimate = Batch(resolver=Truth())(flight)
    assert within_three_sigma(flight, estimate).mean() >= 0.99


def test_losses_of_all_views_add_up_to_each_link_once():
    flight = flown(gone(5.0, 9.0, "a1"))
    estimate = Batch(resolver=Truth())(flight)
    below = {
        loss.what: loss.count
        for loss in estimate.losses
        if loss.reason == "below the elevation mask" and loss.what.endswith("link")
    }
    assert below["a2 link"] == below["a8 link"] == len(flight.observations.t_s)
    assert not any("reference antenna" in loss.reason for loss in estimate.losses)
    assert stood_in(views(flight), ()) == ()


@pytest.mark.parametrize("antennas", [("a1",), ("a1", "a2")])
def test_attitude_and_position_outlive_the_reference_antenna(antennas):
    flight = flown(gone(5.0, 15.0, *antennas))
    estimate = Batch(resolver=Truth())(flight)
    assert estimate.converged
    told = "No observations of the reference antenna a1 from 4.90 to 15.00 s: "
    assert any(note.startswith(told) for note in estimate.notes)
    assert within_three_sigma(flight, estimate).mean() >= 0.99
    during = (estimate.t_s > 5) & (estimate.t_s < 15)
    # Without a stand-in the body turns unseen: tens of degrees.
    assert np.degrees(np.linalg.norm(errors_rad(flight, estimate)[during], axis=1)).max() < 1
    truth = flight.truth
    place = np.stack([np.interp(estimate.t_s, truth.t_s, x) for x in truth.p_n_m.T], axis=1)
    assert np.linalg.norm(estimate.p_n_m - place, axis=1).max() < 0.5


def test_an_antenna_alone_still_gives_position():
    names = [f"a{k}" for k in (1, 3, 4, 5, 6, 7, 8)]
    flight = flown(gone(8.0, 10.0, *names))
    estimate = Batch(resolver=Truth())(flight)
    assert estimate.available == 1
    assert not any(note.startswith("No position") for note in estimate.notes)
    assert within_three_sigma(flight, estimate).mean() >= 0.99


def test_a_flight_without_observations_has_one_view():
    flight = dataclasses.replace(flown(span_s=5.0), observations=None)
    (view,) = views(flight)
    assert not len(view.rows)
