"""Logs of PX4, ArduPilot and ROS: the same values out of each; damage is one line."""

import numpy as np
import pytest

from fgnav.geometry.earth import ecef
from fgnav.geometry.rotations import to_euler
from fgnav.io.importers.recognise import recognise_format
from tests.io.importers import logs
from tests.io.importers.helpers import AROUND, imported, refused


def written(tmp_path, name):
    """Return a log's place and format."""
    kind, _, variant = name.partition(" ")
    place = tmp_path / f"log.{kind}"
    if kind in ("bag", "mcap", "db3"):
        logs.bag(place, kind)
        return place, "rosbag"
    make = {"ulg": logs.ulog, "BIN": logs.ardupilot}[kind]
    place.write_bytes(make(year=int(variant or 2024)))
    if kind == "ulg":  # read and written again by the library
        pytest.importorskip("pyulog").ULog(str(place)).write_ulog(str(place))
    return place, {"ulg": "ulog", "BIN": "ardupilot"}[kind]


NO_HEIGHT = {"ulg": "has no height (fix_type)", "BIN": "has no height (Status)"}
LOSSES = {  # of what all have: the first fix
    "ulg 2021": {"is not valid, of a float solution or of a still base": 1},
    "ulg 2024": {"is not valid, of a float solution or of a still base": 1},
    "BIN 2024": {"of another instance": 100, "of no time of fixes": 1},
    "BIN 2014": {},
}
LOSSES |= {name: {"has no sigma_n_m, as most have": 1} for name in ("bag", "mcap", "db3")}


@pytest.mark.parametrize("name", LOSSES)
def test_every_value_comes_out_as_logged(tmp_path, name):
    place, format_ = written(tmp_path, name)
    whole, flight = imported(tmp_path, format_, place, toml=AROUND)
    first_s = 0.0 if "2014" in name else 0.1 if format_ == "rosbag" else 1.0
    assert flight.start_gps_s == pytest.approx(logs.START_GPS_S + first_s, abs=1e-6)
    step_s = {"ulog": 0.01, "ardupilot": 0.02, "rosbag": 0.1}[format_]
    count = round(2 / step_s)
    np.testing.assert_allclose(flight.imu.t_s, step_s * np.arange(count) - first_s, atol=1e-6)
    np.testing.assert_allclose(flight.imu.f_b_mps2, [logs.FORCE] * count, rtol=1e-6)
    np.testing.assert_allclose(flight.imu.w_b_radps, [logs.RATE] * count, rtol=1e-6)
    (fixes,) = flight.fixes
    assert len(fixes.t_s) == (18 if format_ == "rosbag" else 2)
    p_e_m = ecef(*np.radians([[logs.PLACE[0]], [logs.PLACE[1]]]), np.array([logs.PLACE[2]]))
    np.testing.assert_allclose(flight.origin.to_e(fixes.p_n_m) - p_e_m, 0, atol=1e-3)
    if "2014" not in name:
        np.testing.assert_allclose(fixes.position_sigma_m - logs.SIGMA, 0, atol=1e-9)
        np.testing.assert_allclose(flight.barometer.height_m, logs.HEIGHT_M, atol=0.02)
        np.testing.assert_allclose(flight.magnetometer.field_b_ut - logs.FIELD_UT, 0, atol=1e-5)
    if format_ != "rosbag":
        np.testing.assert_allclose(fixes.v_n_mps - logs.VELOCITY, 0, atol=1e-4)
    lost = {loss.reason: loss.count for loss in whole.unused}
    first = {"rosbag": "the receiver had none (status)"}.get(format_, NO_HEIGHT.get(name[:3]))
    assert lost == LOSSES[name] | ({} if "2014" in name else {first: 1})


def test_a_filter_of_px4_is_a_reference_and_a_moving_base_a_baseline(tmp_path):
    place, _ = written(tmp_path, "ulg")
    whole, flight = imported(tmp_path, "ulog", place)
    np.testing.assert_allclose(to_euler(flight.truth.R_nb), [[0, 0, 0.4]] * 3, atol=1e-6)
    assert flight.truth.is_reference
    assert whole.notes["truth"] == "the on-board filter's estimate, not truth"
    (baseline,) = flight.baselines
    assert baseline.antennas == ("gps2", "gps1")
    np.testing.assert_allclose(baseline.t_s, [-1, 1], atol=1e-6)
    np.testing.assert_allclose(baseline.vector_n_m, [[0.1, -1.5, 0.02]] * 2, rtol=1e-6)


@pytest.mark.parametrize("name", ["ulg", "BIN", "mcap"])
def test_instruments_of_unstated_noise_and_messages_not_read_are_counted(tmp_path, name):
    place, format_ = written(tmp_path, name)
    if name != "mcap":
        old, new = {"ulg": (b"vehicle_mag", b"wehicle_mag"), "BIN": (b"MAG\0", b"MGX\0")}[name]
        place.write_bytes(place.read_bytes().replace(old, new))
    whole, flight = imported(tmp_path, format_, place)
    assert (flight.barometer, flight.magnetometer) == (None, None)
    lost = {loss.what: loss.count for loss in whole.unused}
    count = 20 if name == "mcap" else 3
    names = {"ulg": "wehicle_magnetometer message", "BIN": "MGX message"}
    assert lost["barometer row"] == lost[names.get(name, "magnetometer row")] == count


@pytest.mark.parametrize("name", ["ulg", "BIN"])
def test_without_a_fix_the_unit_keeps_its_own_clock(tmp_path, name):
    place, format_ = written(tmp_path, name)
    if name == "ulg":
        place.write_bytes(place.read_bytes().replace(b"_gps", b"_gpz"))
    else:
        place.write_bytes(logs.ardupilot(status=1))
    whole, flight = imported(tmp_path, format_, place)
    assert (len(flight.imu.t_s), flight.fixes) == (200 if name == "ulg" else 100, ())
    assert "imu.clock_offset_s" in whole.missing


def test_without_undulation_heights_are_above_the_sea_and_that_is_said(tmp_path):
    (tmp_path / "log.BIN").write_bytes(logs.ardupilot(accuracy=False))
    whole, flight = imported(tmp_path, "ardupilot", tmp_path / "log.BIN")
    assert flight.origin.height_m == pytest.approx(logs.PLACE[2] - 47.5)
    assert flight.fixes[0].unstated == ("position", "velocity")
    assert "above the sea" in whole.notes["fixes"]


def test_bytes_that_are_no_message_are_counted_and_passed(tmp_path):
    content = logs.ardupilot()
    middle = content.index(b"\xa3\x95\x01", len(content) // 2)
    (tmp_path / "log.BIN").write_bytes(content[:middle] + b"\0" * 50 + content[middle:])
    whole, flight = imported(tmp_path, "ardupilot", tmp_path / "log.BIN")
    assert len(flight.imu.t_s) == 100
    lost = {loss.reason: loss.count for loss in whole.unused}
    assert lost["in no message: the log is damaged there"] == 50


def test_of_two_units_the_settings_name_one(tmp_path, capsys):
    logs.bag(tmp_path / "log", "mcap", topics=("/front", "/rear"))
    assert recognise_format(tmp_path / "log", tmp_path)[0] == "rosbag"
    assert recognise_format(next((tmp_path / "log").glob("*.mcap")), tmp_path)[0] == "mcap"
    line = refused(capsys, tmp_path, tmp_path / "log")
    assert "has 2 topics of sensor_msgs/msg/Imu, /front, /rear; name one as imu in [ros]" in line
    _, flight = imported(tmp_path, "rosbag", tmp_path / "log", toml='[ros]\nimu = "/rear"\n')
    assert len(flight.imu.t_s) == 20
    (tmp_path / "s.toml").write_text('[ros]\nimu = "/left"\n')
    line = refused(capsys, tmp_path, tmp_path / "log", "--settings", str(tmp_path / "s.toml"))
    assert "key ros.imu: '/left' is not one of /front, /rear" in line


def replaced(old, new):
    return lambda content: content.replace(old, new)


NOTHING = "holds nothing that a flight could use"


@pytest.mark.parametrize(
    ("name", "damage", "text"),
    [
        ("ulg", lambda content: content[:10], "cannot be read as ULog"),
        ("ulg", replaced(b"fix_type", b"fix_tape"), "KeyError: 'fix_type'"),
        (
            "ulg",
            lambda c: c.replace(b"sensor_", b"censor_").replace(b"vehicle_", b"wehicle_"),
            NOTHING,
        ),
        ("BIN", lambda _: b"\xa3\x95\x80" + bytes(5), NOTHING),
        ("BIN", replaced(b"Status", b"Statue"), "message GPS: field Status is missing"),
        ("BIN", replaced(b"AccZ", b"AccX"), "message IMU: field AccZ is missing"),
        ("BIN", replaced(b"QBffffff", b"QBfffff\0"), "message IMU: its FMT is damaged"),
        ("bag", lambda content: content[:40], "cannot be read as a bag"),
        ("bag", lambda content: content[:2000], "cannot be read as a bag"),
    ],
)
def test_damage_is_one_line(tmp_path, capsys, name, damage, text):
    place, format_ = written(tmp_path, name)
    place.write_bytes(damage(place.read_bytes()))
    line = refused(capsys, tmp_path, place, "--format", format_)
    assert line.startswith(f"fgnav: {place}: ")
    assert text in line
