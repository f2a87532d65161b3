from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import Unused
from fgnav.diagnostics.contents import contents as describe
from fgnav.geometry.earth import Origin
from fgnav.types.flight import Antenna, Flight, Imu, Truth
from fgnav.types.observations import Observations
from fgnav.types.orbits import EPHEMERIS_DTYPE, BroadcastOrbits, PreciseOrbits
from tests.imu import imu_of

MADRID = Origin(latitude_rad=0.704, longitude_rad=-0.068, height_m=700.0)
PLANE_B_M = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def observations(antennas=3, satellites=("G01", "G02", "G03", "G04", "E05"), t_s=None, unused=()):
    t_s = np.arange(0, 10, 0.1) if t_s is None else t_s
    shape = (len(t_s), antennas, len(satellites))
    return Observations(
        t_s=t_s,
        tag_s=np.tile(t_s[:, None], (1, antennas)),
        satellites=satellites,
        signals=("1C",) * len(satellites),
        code_m=np.full(shape, 2e7),
        phase_cycles=np.full(shape, 1e8),
        doppler_hz=np.zeros(shape),
        cn0_dbhz=np.full(shape, 45.0),
        lock_flags=np.zeros(shape),
        unused=unused,
    )


def broadcast(satellites=("G01", "G02", "G03", "G04", "E05"), toe_s=0.0) -> BroadcastOrbits:
    records = np.zeros(len(satellites), dtype=EPHEMERIS_DTYPE)
    records["satellite"], records["toe_s"] = satellites, toe_s
    return BroadcastOrbits(records=records, klobuchar=np.zeros(8))


def imu(t_s=None, size_mps2=9.81) -> Imu:
    t_s = np.arange(0, 10, 0.01) if t_s is None else t_s
    return imu_of(t_s, np.tile([0, 0, -size_mps2], (len(t_s), 1)))


def flight(places_b_m=PLANE_B_M, **parts) -> Flight:
    antennas = tuple(
        Antenna(name=f"a{i}", position_b_m=np.array(p)) for i, p in enumerate(places_b_m, 1)
    )
    given = {"observations": observations(len(antennas)), "broadcast": broadcast(), **parts}
    return Flight(name="test", start_gps_s=1e9, origin=MADRID, antennas=antennas, **given)


def findings(given: Flight) -> dict[str, str]:
    return {finding.name: finding.text for finding in describe(given).findings}


def test_a_sound_flight_has_no_findings():
    set_up = describe(flight(imu=imu()))
    assert set_up.findings == ()
    assert set_up.antennas == ("a1", "a2", "a3")
    assert set_up.channels == {"GPS 1C": 4, "Galileo 1C": 1}
    assert set_up.orbits == ("broadcast",)
    assert not set_up.gyroscope
    assert set_up.series["gnss"].samples == 100
    assert set_up.series["gnss"].rate_hz == pytest.approx(10)
    assert set_up.series["imu"].rate_hz == pytest.approx(100)
    assert set(set_up.series) == {"gnss", "imu"}


def test_a_flight_of_nothing_is_described():
    set_up = describe(Flight(name="empty", start_gps_s=1e9, origin=MADRID))
    assert set_up.findings == ()
    assert set_up.series == {}


def test_antennas_at_one_place_are_named():
    text = findings(flight([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 5e-4]]))["duplicate antennas"]
    assert text == "a2 and a4 are 0.5 mm apart"


@pytest.mark.parametrize(
    ("places_b_m", "angle"),
    [
        ([[0, 0, 0], [1.6, 0, 0]], "roll"),
        ([[0, 0, 0], [0, 1, 0], [0, -2, 0]], "pitch"),
        ([[3, 3, 0], [3, 3, 1]], "yaw"),
        ([[0, 0, 0], [1, 1, 0]], "rotation about the body axis"),
    ],
)
def test_antennas_on_one_line_leave_an_angle_open(places_b_m, angle):
    text = findings(flight(places_b_m))["collinear antennas"]
    assert text.startswith(f"all on one line, so phase leaves unobservable: {angle}")


def test_gaps_of_each_sensor_are_counted_with_the_longest():
    t_s = np.concatenate([np.arange(0, 3, 0.1), np.arange(5, 10, 0.1)])
    gap_t_s = np.delete(np.arange(0, 10, 0.01), [500, 501, 700])
    found = findings(flight(observations=observations(t_s=t_s), imu=imu(gap_t_s)))
    assert found["gnss gaps"] == "steps longer than 1.5 intervals: 1, longest 2.100 s"
    assert found["imu gaps"] == "steps longer than 1.5 intervals: 2, longest 0.030 s"


def test_a_constellation_without_orbits_is_named_with_its_satellites():
    found = findings(flight(broadcast=broadcast(("G01", "G02", "G03", "G04"))))
    text = "tracked, but without an orbit at that time: E05"
    assert found == {"no orbits for Galileo": text}


def test_orbits_of_another_day_are_no_orbits():
    found = findings(flight(broadcast=broadcast(toe_s=-86_400.0)))
    assert set(found) == {"no orbits for GPS", "no orbits for Galileo", "few satellites"}


def test_precise_orbits_count_where_they_are_filled():
    p_e_m = np.full((3, 2, 3), 2e7)
    p_e_m[:, 1] = np.nan
    orbits = PreciseOrbits(
        t_s=np.array([-900.0, 0, 900]),
        satellites=("E05", "G04"),
        p_e_m=p_e_m,
        clock_s=np.zeros((3, 2)),
    )
    found = findings(flight(broadcast=broadcast(("G01", "G02", "G03")), precise=orbits))
    assert found["no orbits for GPS"].endswith("G04")
    assert "no orbits for Galileo" not in found


def test_epochs_with_few_satellites_are_counted():
    seen = observations()
    code_m = seen.code_m.copy()
    code_m[:7, 0, :2] = np.nan
    text = findings(flight(observations=replace(seen, code_m=code_m)))["few satellites"]
    assert text.startswith("7 of 100 epochs have fewer than 4 satellites")


def test_a_sensor_of_another_time_is_named():
    t_s = np.array([3600.0, 3601.0])
    truth = Truth(
        t_s=t_s,
        p_n_m=np.zeros((2, 3)),
        v_n_mps=np.zeros((2, 3)),
        R_nb=np.tile(np.eye(3), (2, 1, 1)),
    )
    text = findings(flight(truth=truth))["truth at another time"]
    assert text == "3600.000 to 3601.000 s, GNSS 0.000 to 9.900 s"


def test_losses_of_files_and_observations_are_told_once():
    loss = Unused(what="GLONASS observation", reason="not used", count=12)
    given = flight(observations=observations(unused=(loss,)), unused=(loss,))
    assert describe(given).unused == (loss,)


def test_everything_can_be_written_as_plain_types():
    content = describe(flight([[0, 0, 0], [1.6, 0, 0]], imu=imu())).to_dict()
    assert content["findings"][0]["name"] == "collinear antennas"
    assert content["series"]["imu"]["samples"] == 1000
