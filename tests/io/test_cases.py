"""Small inputs after public reports: what is right is in each folder's EXPECT.txt."""

import re
from pathlib import Path

import numpy as np
import pytest

import fgnav
from fgnav.checks import BadInputError
from fgnav.geometry.earth import ecef
from fgnav.io.importers import importer_named
from fgnav.io.importers.guess import guess_table
from fgnav.io.importers.recognise import recognise_format
from fgnav.io.importers.settings import Settings, read_settings
from fgnav.io.rinex.reader import read_rinex
from tests.io.importers.helpers import whole_of

# GPS seconds: 2025-07-08 10:00:00, 18 s ahead of UTC.
START_S = 2374 * 604_800 + 208_800.0


@pytest.fixture
def case(shared):
    """Return the folder of a case by its number."""
    folder = shared / "cases"
    if not folder.is_dir():
        pytest.skip("FGNAV_SHARED: the folder of cases is absent")
    return lambda number: next(folder.glob(f"{number}-*"))


def new(path: Path, scratch: Path):
    """Return what ``fgnav new`` makes of a file."""
    name, path = recognise_format(path, scratch)
    settings = Settings(csv=(guess_table(path),) if name == "csv" else ())
    return whole_of([importer_named(name)(path, settings, scratch)], settings)


def lost(whole) -> dict[str, int]:
    return {f"{one.what}: {one.reason}": one.count for one in whole.unused}


@pytest.mark.parametrize("name", ["imu", "imu_bom", "imu_utf16", "fixes_bom", "fixes_eu"])
def test_encodings_and_decimal_commas_are_spelling(case, tmp_path, name):
    flight = new(case(11) / f"{name}.csv", tmp_path).flight
    if name.startswith("fixes"):
        assert (len(flight.fixes[0].t_s), flight.imu) == (150, None)
        assert np.degrees(flight.origin.latitude_rad) == pytest.approx(40.33, abs=1e-12)
        return
    np.testing.assert_allclose(flight.imu.t_s, 0.01 * np.arange(3000), atol=1e-9)
    np.testing.assert_allclose(flight.imu.f_b_mps2[1], [0.003, 0.199983, -9.80515], rtol=1e-12)
    np.testing.assert_allclose(flight.imu.w_b_radps[1], [0.0002, 0.01, 0.2], rtol=1e-12)


def test_decimal_commas_without_the_key_are_refused_with_it(case, tmp_path):
    path = case(11) / "imu.csv"
    (tmp_path / "s.toml").write_text(
        '[[csv]]\ntable = "imu"\ndelimiter = ";"\n[csv.columns]\nt_s = 1\nfx_mps2 = 2\n'
        "fy_mps2 = 3\nfz_mps2 = 4\n"
    )
    with pytest.raises(BadInputError, match=r"got '0,000000'; write decimal = \",\" in \[\[csv"):
        importer_named("csv")(path, read_settings(tmp_path / "s.toml"), tmp_path)


@pytest.mark.parametrize(
    ("name", "samples", "unused"),
    [
        ("duplicate", 3000, 1),
        ("backwards", 2990, 10),
        ("three_microseconds", 3000, 0),
        ("batched", 3000, 0),
        ("wrap32us", 3000, 0),
    ],
)
def test_timestamps_are_mended_or_counted(case, tmp_path, name, samples, unused):
    whole = new(case(12) / f"{name}.csv", tmp_path)
    t_s = whole.flight.imu.t_s
    assert len(t_s) == samples
    assert t_s[-1] == pytest.approx(29.99, abs=1e-6)
    counts = {"imu row: its time does not increase": unused} if unused else {}
    assert lost(whole) == {f"{text} ({name}.csv)": count for text, count in counts.items()}
    if name != "three_microseconds":
        assert np.ptp(t_s - 0.01 * np.round(t_s / 0.01)) < 1e-6
    assert ("share a timestamp" in whole.missing.get("imu.samples", "")) == (name == "batched")


@pytest.mark.parametrize("name", ["iso_z", "utc_name", "drive_fixes_z", "drive_imu"])
def test_a_time_zone_and_the_name_utc_mean_utc(case, tmp_path, name):
    start_s = START_S + (0 if name.startswith("drive") else 18)
    assert new(case(14) / f"{name}.csv", tmp_path).flight.start_gps_s == start_s


def test_integer_degrees_are_ten_millionths_and_millimetres(case, tmp_path):
    flight = new(case(14) / "time_1e7.csv", tmp_path).flight
    place = [*np.degrees([flight.origin.latitude_rad, flight.origin.longitude_rad])]
    np.testing.assert_allclose([*place, flight.origin.height_m], [40.33, -3.88, 700], rtol=1e-12)
    np.testing.assert_allclose(flight.fixes[0].t_s[:2], [0, 0.2], atol=1e-9)


def test_places_without_names_are_refused(case, tmp_path):
    with pytest.raises(BadInputError, match="columns 2 to 4 may be latitude, longitude, height"):
        new(case(14) / "madrid_places_no_header.csv", tmp_path)


@pytest.mark.parametrize(
    ("name", "start_s"), [("imu", 0), ("imu_unix_ms", START_S), ("imu_named", 0)]
)
def test_gentle_rates_without_a_unit_are_asked_for(case, tmp_path, name, start_s):
    whole = new(case(19) / f"{name}.csv", tmp_path)
    assert whole.flight.start_gps_s == start_s
    text = "unit of wx_radps, wy_radps, wz_radps is in doubt; rad/s was assumed"
    assert (text in whole.missing.get("imu.samples", "")) == (name != "imu_named")
    if name == "imu_named":  # ends in dps
        want = np.radians([0.02665, 0.02266, 0])
        np.testing.assert_allclose(whole.flight.imu.w_b_radps[0], want, atol=1e-12)


NAMES = ("gpst", "utc", "tow", "crlf", "oldwindows", "repeated", "semicolon", "jst")


@pytest.mark.parametrize("name", NAMES)
def test_solution_files_of_every_separator_and_time_system(case, tmp_path, name):
    whole = new(case("09") / f"{name}.pos", tmp_path)
    assert whole.flight.start_gps_s == START_S + (18 - 9 * 3600 if name == "jst" else 0)
    sigma = whole.flight.fixes[0].position_sigma_m
    np.testing.assert_allclose(sigma, np.tile([0.01, 0.01, 0.02], (150, 1)), rtol=1e-12)
    repeated = {"fixes row: its time does not increase (repeated.pos)": 1}
    text = f"{name}.pos columns Q, ns, sdne(m), sdeu(m), sdun(m), age(s), ratio"
    unused = {f"{text}: the flight has none": 150 + (name == "repeated")}
    assert lost(whole) == unused | (repeated if name == "repeated" else {})


@pytest.mark.parametrize("name", ["drive.nmea", "drive.ubx"])
def test_sentences_across_midnight_are_seconds_apart(case, tmp_path, name):
    whole = new(case(10) / name, tmp_path)
    (fixes,) = whole.flight.fixes
    assert len(fixes.t_s) == 60
    np.testing.assert_allclose(fixes.t_s, 0.2 * np.arange(60), atol=1e-6)
    # 2024-01-01 is day 1 of GPS week 2295; the first fix is at 23:59:55 UTC.
    assert whole.flight.start_gps_s == 2295 * 604_800 + 2 * 86_400 - 5 + 18
    assert whole.flight.origin.height_m == pytest.approx(700, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "option"), [("enu", "set out-solformat"), ("nohead", "switch on out-outhead")]
)
def test_solution_files_without_places_name_the_option(case, tmp_path, name, option):
    with pytest.raises(BadInputError, match=option):
        new(case("09") / f"{name}.pos", tmp_path)


@pytest.mark.parametrize(
    ("number", "name", "loss"),
    [
        (15, "bag", {}),
        (15, "split", {"/camera/gyro/sample message: has no specific force (covariance -1)": 1000}),
        (17, "bag_with_imu", {"/vrpn/pose message: geometry_msgs/msg/PoseStamped is not read": 50}),
    ],
)
def test_what_a_bag_has_not_is_no_measurement(case, tmp_path, number, name, loss):
    whole = new(case(number) / name, tmp_path)
    assert len(whole.flight.imu.t_s) == 1000
    assert (whole.flight.imu.w_b_radps is None) == (number == 15)
    assert lost(whole) == loss


def test_poses_alone_are_refused_with_the_types_that_are_read(case, tmp_path):
    with pytest.raises(BadInputError, match=r"sensor_msgs/msg/Imu, .*, has geometry_msgs/msg/Pose"):
        new(case(17) / "bag", tmp_path)


def test_fixes_of_two_receivers_are_those_of_two_antennas(case, tmp_path):
    folder = case(18)
    settings = read_settings(folder / "two.toml")
    found = [importer_named("csv")(folder / f"{one}.csv", settings, tmp_path) for one in "ab"]
    flight = whole_of(found, settings).flight
    assert [one.antenna for one in flight.fixes] == ["gps1", "gps2"]
    assert [len(one.t_s) for one in flight.fixes] == [150, 150]
    apart = np.linalg.norm(flight.fixes[1].p_n_m - flight.fixes[0].p_n_m, axis=1)
    places = [np.genfromtxt(folder / f"{one}.csv", delimiter=",", skip_header=1) for one in "ab"]
    ends = [ecef(*np.radians(place[:, 1:3].T), place[:, 3]) for place in places]
    np.testing.assert_allclose(apart, np.linalg.norm(ends[1] - ends[0], axis=1), atol=1e-6)


def observations(path):
    """Return what is read of a RINEX file, and its channels."""
    (read,) = read_rinex([], [path], 0.0)[1]
    return read, list(zip(read.satellites, read.signals, strict=True))


@pytest.mark.parametrize("name", ["station", "unavco"])
def test_galileo_of_rinex_2_has_its_own_bands(case, name):
    read, channels = observations(case("01") / f"{name}.21o")
    for signal, code, phase, density in (
        ("1X", 24000500.0, 126125913.080, 41.5),
        ("5X", 24000500.9, 94182396.107, 40.5),
        ("7X", 24000501.1, 96643714.263, 40.75),
    ):
        m = channels.index(("E04", signal))
        assert read.code_m[2, 0, m] == code
        assert read.phase_cycles[2, 0, m] == phase
        assert read.cn0_dbhz[2, 0, m] == density
    if name == "station":
        assert read.doppler_hz[0, 0, channels.index(("E04", "5X"))] == 1493.0
        assert read.doppler_hz[0, 0, channels.index(("E04", "7X"))] == 1532.0
    else:
        assert np.isnan(read.doppler_hz).all()
    assert {one.what: one.count for one in read.unused}["E 8X observation"] == 12


@pytest.mark.parametrize(
    ("number", "name", "unused"),
    [
        ("02", "a.21o", {}),
        ("02", "dos_eof.21o", {}),
        ("02", "nonewline.21o", {"nonewline.21o line end": 1}),
        ("04", "splice.21o", {"event 4 record": 2, "event 5 record": 1}),
        ("06", "a.rnx", {"a.rnx epoch": 597}),
        ("06", "v402.rnx", {"v402.rnx epoch": 597}),
        ("07", "roll.rnx", {}),
        ("08", "rinex2.21o", {}),
        ("08", "rinex3.rnx", {"rinex3.rnx epoch": 597}),
    ],
)
def test_three_epochs_of_nine_satellites_are_read(case, number, name, unused):
    read, channels = observations(case(number) / name)
    assert len(channels) == 9
    assert np.isfinite(read.phase_cycles).sum() == 27
    assert np.isfinite(read.code_m).sum() == (24 if number == "08" else 27)
    assert {one.what: one.count for one in read.unused} == unused
    if number == "07":
        np.testing.assert_array_equal(read.t_s, 2048 * 604_800 + np.array([-1, 0, 1]))
    if number == "06":
        assert read.code_m[0, 0, 0] == 21729222.175
        assert read.doppler_hz[0, 0, 0] == 2511.351


def test_unsteady_timestamps_and_a_loud_unit_are_solved(case):
    flight = fgnav.load_flight(case(21) / "flight")
    score = fgnav.compare(flight, [fgnav.Smoother()])["smoother"].score
    assert score.failure is None
    assert score.position_rmse_m < 0.02
    assert 1 < score.attitude_nees_mean < 6
    assert 1 < score.position_nees_mean < 6
    matches = (re.search(r"Gyroscope noise.* ([\d.]+) x the nominal", n) for n in score.notes)
    (factor,) = [float(match[1]) for match in matches if match]
    assert 15 < factor < 35
