"""A few satellites chosen: how many, how well they lie, and how long they stay."""

from itertools import combinations

import numpy as np
import pytest

from fgnav_sim.gnss.selection import chosen
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.motion import Arc, Motion, Straight
from fgnav_sim.scenario import Scenario
from fgnav_sim.simulate import simulate


def gdop(elevation_rad, azimuth_rad):
    flat = np.cos(elevation_rad)
    rows = np.column_stack(
        [
            flat * np.cos(azimuth_rad),
            flat * np.sin(azimuth_rad),
            np.sin(elevation_rad),
            np.ones_like(flat),
        ]
    )
    return np.sqrt(np.trace(np.linalg.inv(rows.T @ rows)))


def test_the_choice_is_nearly_as_good_as_the_best_there_is():
    rng = np.random.default_rng(3)
    excess = []
    for _ in range(30):
        elevation = np.radians(rng.uniform(10, 85, (1, 10)))
        azimuth = rng.uniform(0, 2 * np.pi, (1, 10))
        kept = chosen(6, np.ones((1, 10), dtype=bool), elevation, azimuth, np.zeros(1))[0]
        assert kept.sum() == 6
        best = min(
            gdop(elevation[0, list(k)], azimuth[0, list(k)]) for k in combinations(range(10), 6)
        )
        excess.append(gdop(elevation[0, kept], azimuth[0, kept]) / best)
    assert np.median(excess) < 1.02
    assert max(excess) < 1.25


def test_satellites_that_last_are_preferred_and_the_choice_lasts():
    t_s = np.arange(0.0, 1800.0, 30.0)
    rng = np.random.default_rng(1)
    elevation = np.repeat(np.radians(rng.uniform(10, 85, (1, 9))), len(t_s), axis=0)
    azimuth = np.repeat(rng.uniform(0, 2 * np.pi, (1, 9)), len(t_s), axis=0)
    above = np.ones(elevation.shape, dtype=bool)
    above[20:, 4] = False  # sets after 10 min
    kept = chosen(6, above, elevation, azimuth, t_s)
    assert not kept[:, 4].any()
    assert (kept.sum(axis=1) == 6).all()
    assert (kept[:30] == kept[0]).all()
    assert (kept[30:] == kept[30]).all()


def test_where_too_few_last_those_in_view_at_first_are_taken():
    above = np.ones((3, 5), dtype=bool)
    above[1:, 3] = False
    elevation = np.tile(np.radians([30.0, 50, 70, 20, 40]), (3, 1))
    azimuth = np.tile(np.radians([0.0, 80, 150, 220, 300]), (3, 1))
    kept = chosen(5, above, elevation, azimuth, np.arange(3.0))
    assert np.array_equal(kept, above)


def test_satellites_in_one_direction_are_no_solution_and_no_crash():
    alike = np.full((1, 7), 0.8)
    assert chosen(4, alike > 0, alike, alike, np.zeros(1)).sum() == 4


@pytest.mark.parametrize("choose", [6, 4])
def test_receivers_track_so_many_on_all_signals(choose):
    gnss = GnssTable(signals={"G": ("1C", "5Q"), "E": ("1C",)}, choose=choose)
    scenario = Scenario(duration_s=5.0, motion=Motion(path=Arc()), gnss=gnss)
    seen = simulate(scenario, np.random.default_rng(1)).observations
    assert seen.tracked.all()
    assert len(set(seen.satellites)) == choose
    for satellite in set(seen.satellites):
        signals = {
            s for name, s in zip(seen.satellites, seen.signals, strict=True) if name == satellite
        }
        assert signals == ({"1C", "5Q"} if satellite[0] == "G" else {"1C"})


def test_over_a_day_six_are_tracked_and_changes_are_announced():
    gnss = GnssTable(rate_hz=1 / 300, choose=6)
    scenario = Scenario(duration_s=86400.0, motion=Motion(path=Straight(speed_mps=0.0)), gnss=gnss)
    seen = simulate(scenario, np.random.default_rng(1)).observations
    assert np.median(seen.tracked[:, 0].sum(axis=1)) == 6
    assert seen.tracked[:, 0].sum(axis=1).max() == 6
    begins = np.zeros_like(seen.tracked)
    begins[1:] = seen.tracked[1:] & ~seen.tracked[:-1]
    assert np.array_equal(seen.lock_flags == 1, begins)
