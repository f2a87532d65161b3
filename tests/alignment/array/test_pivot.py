"""Another antenna as the reference while the flight's own tracks nothing."""

import dataclasses

import numpy as np

from fgnav.alignment.array.pivot import pivot_notes, pivot_unused, pivot_views
from fgnav.checks import Unused
from fgnav_sim.gnss.tables import OutageTable
from tests.methods.simulated import flown_with


def flown(*outages, span_s=10.0):
    return flown_with("demo", span_s, outages=outages)


def gone(from_s, until_s, *antennas):
    return OutageTable(from_s=from_s, until_s=until_s, antennas=antennas)


def test_a_flight_whose_reference_is_never_gone_is_its_own_view():
    flight = flown(span_s=5.0)
    (view,) = pivot_views(flight)
    assert view.flight is flight
    assert len(view.rows) == len(flight.observations.t_s)
    assert not [*pivot_notes((view,))]


def test_others_stand_in_one_after_another_with_their_own_antennas_first():
    others = [f"a{k}" for k in range(3, 9)]
    flight = flown(gone(5.0, 9.0, "a1"), gone(5.0, 6.0, *others), gone(6.0, 9.0, "a2"))
    whole, second, third = pivot_views(flight)
    assert whole.flight is flight
    assert {view.flight.antennas[0].name for view in (second, third)} == {"a2", "a3"}
    np.testing.assert_array_equal(np.sort([*second.rows, *third.rows]), np.arange(50, 90))
    for view in (second, third):
        column = flight.antennas.index(view.flight.antennas[0])
        seen, own = flight.observations, view.flight.observations
        np.testing.assert_array_equal(own.code_m[:, 0], seen.code_m[view.rows, column])
        np.testing.assert_array_equal(own.tag_s[:, 0], seen.tag_s[view.rows, column])


def test_a_reference_that_never_tracks_is_replaced_for_good():
    flight = flown(gone(0.0, 30.0, "a1"), span_s=5.0)
    (view,) = pivot_views(flight)
    assert view.flight.antennas[0].name != "a1"
    assert len(view.rows) == len(flight.observations.t_s)


def test_a_span_without_the_reference_is_noted_with_who_stands_in():
    flight = flown(gone(5.0, 9.0, "a1"))
    views = pivot_views(flight)
    name = views[1].flight.antennas[0].name
    assert [*pivot_notes(views)] == [
        f"No observations of the reference antenna a1 from 4.90 to 9.00 s: {name} stands in."
    ]


def test_losses_of_all_views_are_added_up_less_what_another_reference_makes_up_for():
    flight = flown(gone(5.0, 9.0, "a1"))
    views = pivot_views(flight)
    below, against = "below the elevation mask", "not tracked by the reference antenna"
    seen = np.isfinite(flight.observations.code_m[views[1].rows])
    made_up = int((seen & ~seen[:, :1])[:, 1].sum())  # of antenna a2
    unused = (
        Unused(what="a2 link", reason=below, count=60),
        Unused(what="a2 link", reason=below, count=40),
        Unused(what="a2 link", reason=against, count=made_up + 3),
        Unused(what="a3 link", reason=against, count=1),
    )
    total = {(loss.what, loss.reason): loss.count for loss in pivot_unused(views, unused)}
    assert total == {("a2 link", below): 100, ("a2 link", against): 3}
    assert pivot_unused(views, ()) == ()


def test_a_flight_without_observations_has_one_view():
    flight = dataclasses.replace(flown(span_s=5.0), observations=None)
    (view,) = pivot_views(flight)
    assert not len(view.rows)
