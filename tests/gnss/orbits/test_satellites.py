from dataclasses import replace

import numpy as np
import pytest
from pymap3d import ecef2aer

from fgnav.checks import FloatArray
from fgnav.geometry.earth import C_MPS, EARTH_RATE_RADPS
from fgnav.gnss.orbits.satellites import (
    accuracy_m,
    group_delay_s,
    look_angles,
    satellite_states,
    signal_paths,
    states_at_clock,
)
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits
from tests.gnss import recordings, rtklib
from tests.gnss.flights import ORIGIN, walker_orbits

MM = 1e-3
NS = 1e-9


def only(orbits: BroadcastOrbits, **changes: object) -> BroadcastOrbits:
    """Return the first record alone, with some fields changed."""
    records = orbits.records[:1].copy()
    for name, value in changes.items():
        records[name] = value
    return BroadcastOrbits(records=records, klobuchar=np.zeros(8))


def stacked(*parts: BroadcastOrbits) -> BroadcastOrbits:
    records = np.concatenate([part.records for part in parts])
    return BroadcastOrbits(records=records, klobuchar=np.zeros(8))


def x_m(orbits: BroadcastOrbits | PreciseOrbits, satellite: str, t_s: list[float]) -> FloatArray:
    return satellite_states(orbits, (satellite,), np.array(t_s)[:, None]).p_e_m[:, 0, 0]


def test_broadcast_states_are_rtklibs_from_the_same_message(shared):
    records = recordings.broadcast(shared).records[::9]
    assert {"G", "E", "C"} <= {str(s)[0] for s in records["satellite"]}
    assert "C05" in records["satellite"]  # a geostationary one, with its own axes
    for record in records:
        orbits = BroadcastOrbits(records=record[None], klobuchar=np.zeros(8))
        t_s = float(record["toe_s"]) + 1234.567
        ours = satellite_states(
            only(orbits, health=0), (str(record["satellite"]),), np.array([[t_s]])
        )
        position, clock = rtklib.broadcast_state(record, t_s)
        assert np.abs(ours.p_e_m[0, 0] - position).max() < 0.001 * MM
        assert abs(ours.clock_s[0, 0] - clock) < 1e-5 * NS


def test_precise_states_are_rtklibs_from_the_same_table(shared):
    table = recordings.precise(shared)
    nav = rtklib.tables(shared / "orbits" / "COD0MGXFIN_20201770000_01D_05M_ORB.SP3")
    t_s = np.array([-0.07, 0.0, 150.0, 3600.1, 43333.3, 86399.9])
    satellites = ("G01", "G32", "E11", "E24", "C06", "C14", "J01")
    ours = satellite_states(table, satellites, np.repeat(t_s[:, None], len(satellites), axis=1))
    compared = 0
    for k, t in enumerate(t_s):
        for j, satellite in enumerate(satellites):
            state, clock = rtklib.table_state(nav, satellite, t)
            if len(state):
                assert np.abs(ours.p_e_m[k, j] - state[:3]).max() < 0.001 * MM
                # RTKLIB differentiates over 1 ms, which leaves up to 0.3 mm/s.
                assert np.abs(ours.v_e_mps[k, j] - state[3:]).max() < 0.5 * MM
                no_clock = clock[0] == 0.0  # how RTKLIB writes a missing one
                assert no_clock or abs(ours.clock_s[k, j] - clock[0]) < 1e-3 * NS
                assert not (no_clock and np.isfinite(ours.clock_s[k, j]))
                compared += 1
    assert compared > 30


def test_broadcast_orbits_agree_with_precise_ones_where_the_station_sees_them(shared):
    orbits, table = recordings.broadcast(shared), recordings.precise(shared)
    t_s = np.arange(600.0, 86_000.0, 900.0)
    station = np.repeat(recordings.esbjerg_e_m()[None], len(t_s), axis=0)
    every = []
    # Antennas stand off the centre of mass, which tables speak of: by 1 to 3 m on BeiDou-2. Clocks
    # of a constellation share an offset; those of BeiDou differ by group delays, too.
    for letter, rms_m, clock_rms_m in (("G", 2.0, 1.0), ("E", 1.2, 0.6), ("C", 3.0, 8.0)):
        satellites = tuple(s for s in table.satellites if s[0] == letter)
        at = np.repeat(t_s[:, None], len(satellites), axis=1)
        ours, true = (satellite_states(o, satellites, at) for o in (orbits, table))
        seen = look_angles(station, true.p_e_m)[1] > np.radians(10.0)
        error_m = np.where(seen, np.linalg.norm(ours.p_e_m - true.p_e_m, axis=2), np.nan)
        assert np.isfinite(error_m).sum() > 250
        assert np.sqrt(np.nanmean(error_m**2)) < rms_m
        clock_m = np.where(seen, C_MPS * (ours.clock_s - true.clock_s), np.nan)
        clock_m = clock_m[np.isfinite(clock_m).any(axis=1)]
        spread = clock_m - np.nanmedian(clock_m, axis=1, keepdims=True)
        assert np.sqrt(np.nanmean(spread**2)) < clock_rms_m
        every.append(error_m[np.isfinite(error_m)])
    assert np.sqrt(np.mean(np.concatenate(every) ** 2)) < 2.5


def test_velocity_and_drift_are_the_derivatives():
    orbits = walker_orbits("GEC")
    satellites = ("G08", "E10", "C12")
    h = 0.5
    before, now, after = (
        satellite_states(orbits, satellites, np.full((1, 3), 500.0 + d)) for d in (-h, 0.0, h)
    )
    np.testing.assert_allclose(now.v_e_mps, (after.p_e_m - before.p_e_m) / (2 * h), atol=0.02 * MM)
    np.testing.assert_allclose(
        now.clock_drift_sps, (after.clock_s - before.clock_s) / (2 * h), atol=1e-16
    )


def test_nearest_message_counts_and_its_age_is_limited():
    early = walker_orbits("G")
    late = only(early, toe_s=6000.0, toc_s=6000.0, mean_anomaly_rad=1.0)
    both = stacked(only(early), late)
    name = str(early.records["satellite"][0])
    t_s = [-7199.0, 2999.0, 3001.0, 13_199.0]
    by_early, by_late = x_m(only(early), name, t_s), x_m(late, name, t_s)
    got = x_m(both, name, t_s)
    np.testing.assert_array_equal(got[:2], by_early[:2])
    np.testing.assert_array_equal(got[2:], by_late[2:])
    assert np.isnan(x_m(both, name, [-7201.0, 13_201.0])).all()


@pytest.mark.parametrize(("letter", "hours"), [("G", 2), ("E", 4), ("C", 6)])
def test_age_limits_are_rtklibs(letter, hours):
    orbits = walker_orbits(letter)
    name = str(orbits.records["satellite"][0])
    x = x_m(orbits, name, [hours * 3600.0 - 1, hours * 3600.0 + 1])
    np.testing.assert_array_equal(np.isfinite(x), [True, False])


def test_of_equal_messages_the_latest_transmission_counts():
    orbits = walker_orbits("G")
    newer = only(orbits, transmission_s=100.0, mean_anomaly_rad=1.0)
    name = str(orbits.records["satellite"][0])
    for parts in ((only(orbits), newer), (newer, only(orbits))):
        np.testing.assert_array_equal(x_m(stacked(*parts), name, [0.0]), x_m(newer, name, [0.0]))


def test_galileo_prefers_inav_messages_even_older_ones():
    orbits = walker_orbits("E")
    fnav = only(orbits, data_source=258, mean_anomaly_rad=1.0)
    inav = only(orbits, data_source=517, toe_s=-600.0, toc_s=-600.0)
    name = str(orbits.records["satellite"][0])
    np.testing.assert_array_equal(x_m(stacked(fnav, inav), name, [0.0]), x_m(inav, name, [0.0]))
    assert np.isfinite(x_m(fnav, name, [0.0])).all()


def test_unhealthy_and_unknown_satellites_are_absent_and_told_apart():
    orbits = only(walker_orbits("G"), health=1)
    name = str(orbits.records["satellite"][0])
    states = satellite_states(orbits, (name, "G99", "R01"), np.zeros((2, 3)))
    assert np.isnan(states.p_e_m).all()
    assert np.isnan(states.clock_s).all()
    np.testing.assert_array_equal(states.unhealthy, [[True, False, False]] * 2)


def test_qzss_lex_health_is_ignored():
    orbits = only(walker_orbits("G"), satellite="J02", health=1)
    assert np.isfinite(x_m(orbits, "J02", [0.0])).all()
    assert np.isnan(x_m(only(orbits, health=2), "J02", [0.0])).all()


def test_absent_times_give_absent_states():
    orbits = walker_orbits("G")
    states = satellite_states(orbits, ("G06",), np.array([[0.0], [np.nan]]))
    np.testing.assert_array_equal(np.isfinite(states.clock_s[:, 0]), [True, False])


@pytest.mark.parametrize("empty", [{"semi_major_axis_m": 0.0}, {"eccentricity": 1.0}])
def test_a_message_that_is_no_orbit_is_not_used(empty):
    assert np.isnan(x_m(only(walker_orbits("G"), **empty), "G06", [0.0])).all()


def test_keplers_equation_holds_for_eccentric_orbits():
    # Perigee and apogee distances follow from geometry alone.
    for mean_anomaly, distance in ((0.0, 0.4), (np.pi, 1.6), (2 * np.pi, 0.4)):
        orbits = only(
            walker_orbits("G"),
            eccentricity=0.6,
            mean_anomaly_rad=mean_anomaly,
            crs_m=0.0,
            cuc_rad=0.0,
            cic_rad=0.0,
        )
        p_e_m = satellite_states(orbits, ("G06",), np.zeros((1, 1))).p_e_m[0, 0]
        assert abs(np.linalg.norm(p_e_m) - distance * 26_560e3) < MM


def test_a_table_is_exact_at_its_nodes_and_absent_beyond(shared):
    table = recordings.precise(shared)
    t_s = table.t_s[100:104]
    states = satellite_states(table, ("G05",), t_s[:, None])
    column = table.satellites.index("G05")
    np.testing.assert_allclose(
        states.p_e_m[:, 0], table.p_e_m[100:104, column], atol=0.001 * MM, rtol=0
    )
    outside = np.array([table.t_s[0] - 61.0, table.t_s[-1] + 61.0])
    assert np.isnan(satellite_states(table, ("G05",), outside[:, None]).p_e_m).all()


def test_a_missing_node_makes_a_gap_instead_of_a_wrong_orbit(shared):
    table = recordings.precise(shared)
    p_e_m = table.p_e_m.copy()
    column = table.satellites.index("G05")
    p_e_m[100, column] = np.nan
    holed = replace(table, p_e_m=p_e_m)
    t_s = np.array([90.5, 100.5, 110.5])[:, None] * 300.0
    found = np.isfinite(satellite_states(holed, ("G05",), t_s).p_e_m).all(axis=(1, 2))
    np.testing.assert_array_equal(found, [True, False, True])


def test_a_table_too_short_to_interpolate_knows_nothing():
    table = PreciseOrbits(
        t_s=np.arange(5) * 300.0,
        satellites=("G01",),
        p_e_m=np.full((5, 1, 3), 2e7),
        clock_s=np.zeros((5, 1)),
    )
    assert np.isnan(satellite_states(table, ("G01",), np.zeros((1, 1))).p_e_m).all()


def test_group_delays_follow_the_interface_documents():
    first, second = 4e-9, 7e-9
    records = np.concatenate([walker_orbits(c).records[:1] for c in "GEC"])
    records["group_delay_s"] = [first, second]
    orbits = BroadcastOrbits(records=records, klobuchar=np.zeros(8))
    g, e, c = (str(s) for s in orbits.records["satellite"][[2, 1, 0]])
    channels = [
        (g, "1C"),
        (g, "2W"),
        (e, "1C"),
        (e, "7Q"),
        (e, "5Q"),
        (c, "2I"),
        (c, "7I"),
        (c, "6I"),
    ]
    satellites, signals = zip(*channels, strict=True)
    at = np.zeros((1, len(channels)))
    gamma_2, gamma_7, gamma_5 = ((1575.42 / f) ** 2 for f in (1227.6, 1207.14, 1176.45))
    wanted = [first, gamma_2 * first, second, gamma_7 * second]
    wanted += [second + (gamma_5 - 1) * first, first, second, 0.0]
    np.testing.assert_allclose(group_delay_s(orbits, satellites, signals, at), [wanted], atol=1e-15)


def test_group_delays_against_precise_clocks_cancel_in_their_pairs():
    records = np.concatenate([walker_orbits(c).records[:1] for c in "GEC"])
    records["group_delay_s"] = [4e-9, 7e-9]
    orbits = BroadcastOrbits(records=records, klobuchar=np.zeros(8))
    for letter, one, other, f, g in (
        ("G", "1C", "2W", 1575.42, 1227.6),
        ("E", "1C", "5Q", 1575.42, 1176.45),
        ("C", "2I", "6I", 1561.098, 1268.52),
    ):
        satellite = next(str(s) for s in orbits.records["satellite"] if s[0] == letter)
        delays = group_delay_s(
            orbits, (satellite,) * 2, (one, other), np.zeros((1, 2)), precise_clocks=True
        )[0]
        free = (f**2 * delays[0] - g**2 * delays[1]) / (f**2 - g**2)
        assert abs(free) < 1e-6 * NS
        assert abs(delays[0]) > 1 * NS


def test_tables_state_neither_delays_nor_accuracies():
    table = PreciseOrbits(
        t_s=[0.0], satellites=("G01",), p_e_m=np.zeros((1, 1, 3)), clock_s=np.zeros((1, 1))
    )
    at = np.zeros((2, 1))
    assert (group_delay_s(table, ("G01",), ("1C",), at) == 0).all()
    assert (accuracy_m(table, ("G01",), at) == 0.05).all()


def test_accuracy_is_the_messages_and_zero_without_one():
    orbits = only(walker_orbits("G"), accuracy_m=2.4)
    np.testing.assert_array_equal(
        accuracy_m(orbits, ("G06", "G31"), np.zeros((1, 2))), [[2.4, 0.0]]
    )


def test_states_are_found_by_the_satellites_own_clock():
    orbits = only(walker_orbits("G"), af0_s=1e-3)
    shown = np.array([[100.0]])
    states = states_at_clock(orbits, ("G06",), shown)
    true_s = shown - states.clock_s
    np.testing.assert_allclose(
        states.p_e_m, satellite_states(orbits, ("G06",), true_s).p_e_m, atol=0.001 * MM
    )
    assert abs(float(states.clock_s[0, 0]) - 1e-3) < 100 * NS


def test_ranges_contain_the_earths_turn():
    orbits = walker_orbits("G")
    satellites = tuple(str(s) for s in orbits.records["satellite"])
    states = satellite_states(orbits, satellites, np.zeros((1, len(satellites))))
    p_e_m, v_e_mps = ORIGIN.p_e_m[None], np.zeros((1, 3))
    paths = signal_paths(states, p_e_m, v_e_mps)
    for j in range(len(satellites)):
        travel_s = 0.07
        for _ in range(5):
            angle = EARTH_RATE_RADPS * travel_s
            s, c = np.sin(angle), np.cos(angle)
            turned = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ states.p_e_m[0, j]
            travel_s = np.linalg.norm(turned - p_e_m[0]) / C_MPS
        assert abs(paths.range_m[0, j] - C_MPS * travel_s) < 0.1 * MM
        straight = (turned - p_e_m[0]) / (C_MPS * travel_s)
        assert np.abs(paths.e_e[0, j] - straight).max() < 1e-9


def test_look_angles_are_pymap3ds():
    orbits = walker_orbits("E")
    satellites = tuple(str(s) for s in orbits.records["satellite"])
    states = satellite_states(orbits, satellites, np.zeros((1, len(satellites))))
    e_e, elevation, azimuth = look_angles(ORIGIN.p_e_m[None], states.p_e_m)
    theirs = ecef2aer(
        *states.p_e_m[0].T, ORIGIN.latitude_rad, ORIGIN.longitude_rad, ORIGIN.height_m, deg=False
    )
    np.testing.assert_allclose(elevation[0], theirs[1], atol=1e-9)
    np.testing.assert_allclose(azimuth[0] % (2 * np.pi), theirs[0], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(e_e, axis=2), 1.0, atol=1e-12)
