"""The built-in satellites look like the real ones from the ground."""

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.gnss.orbits.satellites import look_angles, satellite_states
from fgnav_sim.gnss.constellation import built_in_orbits
from fgnav_sim.scenario import Scenario

DAY_S = 86400.0
START_GPS_S = Scenario().start_gps_s
MICROMETRE = 1e-6


def states(letter, t_s):
    orbits = built_in_orbits((letter,), START_GPS_S, DAY_S)
    names = tuple(str(name) for name in np.unique(orbits.records["satellite"]))
    return names, satellite_states(orbits, names, np.repeat(t_s[:, None], len(names), axis=1))


@pytest.mark.parametrize(
    ("letter", "satellites", "fewest", "most"),
    [("G", 30, 7, 11), ("E", 24, 5, 10), ("C", 24, 5, 10)],
)
def test_as_many_satellites_over_madrid_as_in_reality(letter, satellites, fewest, most):
    t_s = np.arange(0.0, DAY_S, 600.0)
    names, seen = states(letter, t_s)
    assert len(names) == satellites
    p_e_m = np.tile(Scenario().origin.frame.p_e_m, (len(t_s), 1))
    _, elevation_rad, _ = look_angles(p_e_m, seen.p_e_m)
    above = (elevation_rad > np.radians(10.0)).sum(axis=1)
    assert fewest <= above.min()
    assert above.max() <= most


@pytest.mark.parametrize("letter", ["G", "E", "C"])
def test_an_orbit_does_not_jump_where_one_message_follows_another(letter):
    step_s = 1e-3
    switches_s = 14.0 * (letter == "C") + 1800.0 * np.arange(1, 40)  # half-way between messages
    t_s = (switches_s[:, None] + step_s * np.array([-1, 1])).ravel()
    _, seen = states(letter, t_s)
    moved_m = seen.p_e_m[1::2] - seen.p_e_m[::2]
    speed_mps = 0.5 * (seen.v_e_mps[1::2] + seen.v_e_mps[::2])
    assert np.abs(moved_m - 2 * step_s * speed_mps).max() < 1.0 * MICROMETRE
    drift_s = np.diff(seen.clock_s, axis=0)[::2]
    assert np.abs(drift_s - 2 * step_s * seen.clock_drift_sps[::2]).max() < 1e-14


def test_orbits_hold_from_the_first_to_the_last_second_of_a_day_across_the_weeks_end():
    saturday_noon = 2112 * 7 * DAY_S - DAY_S / 2
    orbits = built_in_orbits(("G", "E", "C"), saturday_noon, DAY_S)
    names = tuple(str(name) for name in np.unique(orbits.records["satellite"]))
    t_s = np.linspace(-0.1, DAY_S, 200)
    seen = satellite_states(orbits, names, np.repeat(t_s[:, None], len(names), axis=1))
    assert np.isfinite(seen.p_e_m).all()
    by_difference = np.diff(seen.p_e_m, axis=0) / np.diff(t_s)[:, None, None]
    mean = 0.5 * (seen.v_e_mps[1:] + seen.v_e_mps[:-1])
    assert np.abs(by_difference - mean).max() < 10.0  # m/s; a wrong week turns the orbit by degrees


def test_a_constellation_without_almanac_is_refused_by_name():
    with pytest.raises(BadInputError, match="no built-in almanac of constellation 'J'"):
        built_in_orbits(("G", "J"), START_GPS_S, 60.0)
