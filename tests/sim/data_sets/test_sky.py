"""Skies of data sets: the right satellites in the right directions at the right places."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from fgnav.gnss.difference import double_differences
from fgnav.gnss.orbits.satellites import satellite_states
from fgnav_sim.data_sets.sky import skies
from fgnav_sim.data_sets.world import (
    AnySites,
    AnyTimes,
    DayTimes,
    RunsTable,
    SatellitesTable,
    World,
)
from fgnav_sim.gnss.constellation import built_in_orbits, built_in_positions
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.motion import Motion, Straight
from fgnav_sim.scenario import Scenario
from fgnav_sim.simulate import simulate

START_GPS_S = 1_277_078_400.0


def seen(world, runs, seed=1):
    return skies(world, runs, rng=np.random.default_rng(seed))


def test_positions_of_the_almanac_are_those_of_its_messages():
    t_s = np.random.default_rng(1).uniform(0.0, 86_400.0, 50)
    names, p_e_m = built_in_positions(("G", "C"), START_GPS_S, t_s)
    orbits = built_in_orbits(("G", "C"), START_GPS_S, 86_400.0)
    times_s = np.repeat(t_s[:, None], len(names), axis=1)
    assert_allclose(p_e_m, satellite_states(orbits, names, times_s).p_e_m, rtol=0, atol=1e-3)


def test_directions_are_those_that_a_simulated_flight_has():
    standing = Scenario(
        duration_s=60.0,
        motion=Motion(path=Straight(speed_mps=0.0)),
        gnss=GnssTable(rate_hz=1 / 15, atmosphere=False),
    )
    flown = double_differences(simulate(standing, np.random.default_rng(1)))
    everything = SatellitesTable(choose="all")
    world = World(times=DayTimes(duration_s=60.0), runs=RunsTable(epochs=4), satellites=everything)
    sky = seen(world, 1)
    names = sky.satellites[0][sky.satellites[0] != ""]
    assert len(names) >= 6
    for slot, name in enumerate(names):
        theirs = flown.e_n[:, flown.satellites.index(name)]
        # A signal is under way for 70 ms, in which a satellite moves by 280 m of 20,000 km.
        assert_allclose(sky.e_n[:, slot], theirs, rtol=0, atol=2e-5)


def test_places_anywhere_are_even_over_the_globe_and_see_satellites_above_the_mask():
    world = World(
        sites=AnySites(), times=AnyTimes(), satellites=SatellitesTable(choose="all", mask_deg=15.0)
    )
    sky = seen(world, 800)
    elevation_deg = np.degrees(sky.elevation_rad)
    assert np.nanmin(elevation_deg) >= 15.0
    count = (sky.satellites != "").sum(axis=1)
    assert 5 <= count.min() < count.max() <= 14
    assert_allclose(np.linalg.norm(sky.e_n[sky.satellites != ""], axis=1), 1.0, atol=1e-12)
    assert_allclose(
        np.sin(sky.elevation_rad), np.where(sky.satellites == "", np.nan, -sky.e_n[..., 2])
    )


def test_runs_at_any_time_share_moments_only_where_places_differ():
    anywhere = World(sites=AnySites(), times=AnyTimes(days=10.0, runs_per_moment=4))
    assert len(np.unique(seen(anywhere, 40).t_s)) == 10
    madrid = World(times=AnyTimes(days=10.0, runs_per_moment=4))
    t_s = seen(madrid, 40).t_s
    assert len(np.unique(t_s)) == 40
    assert 0.0 <= t_s.min() < t_s.max() <= 864_000.0


def test_a_run_of_a_day_begins_where_it_fits_in():
    world = World(times=DayTimes(duration_s=600.0), runs=RunsTable(epochs=10, step_s=15.0))
    t_s = seen(world, 300).t_s.reshape(300, 10)
    assert_array_equal(np.unique(t_s[:, 0]), 15.0 * np.arange(31))
    assert (np.diff(t_s, axis=1) == 15.0).all()


def test_a_choice_of_satellites_lasts_a_quarter_of_an_hour():
    sky = seen(World(runs=RunsTable(epochs=5760)), 1)
    changes = (sky.satellites[1:] != sky.satellites[:-1]).any(axis=1)
    assert 40 < changes.sum() < 96
    assert not (np.flatnonzero(changes) + 1)[(np.flatnonzero(changes) + 1) % 60 != 0].size


def test_random_choices_favour_no_satellite():
    world = World(satellites=SatellitesTable(choose=(2, 3), pick="random"))
    sky = seen(world, 3000)
    count = (sky.satellites != "").sum(axis=1)
    assert {2, 3} == set(count)
    names = sky.satellites[sky.satellites != ""]
    assert len(np.unique(names)) == 30


def test_runs_under_one_sky_draw_their_own_satellites():
    one_moment = DayTimes(duration_s=15.0)
    drawn = SatellitesTable(choose=5, pick="random")
    sky = seen(World(times=one_moment, satellites=drawn), 100)
    assert len({tuple(row) for row in sky.satellites}) > 20
    numbers = SatellitesTable(choose=(4, 6))
    sky = seen(World(times=one_moment, satellites=numbers), 100)
    assert set((sky.satellites != "").sum(axis=1)) == {4, 5, 6}
    assert len({tuple(row) for row in sky.satellites}) == 3  # the best four, five and six
