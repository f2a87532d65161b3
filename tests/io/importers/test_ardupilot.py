"""DataFlash logs: made as ArduPilot's FMT messages say."""

import struct

import numpy as np
import pytest

from fgnav.geometry.earth import ecef
from tests.io.importers.helpers import AROUND, imported, refused

WEEK, MS = 2374, 243_258_500
FORMATS = {  # type: name, format, columns; the codes of struct
    1: ("IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "<QB6f"),
    2: (
        "GPS",
        "QBBIHBcLLeffffB",
        "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U",
        "<QBBIHBhiiiffffB",
    ),
    3: ("GPA", "QBCCCCBIHfHB", "TimeUS,I,VDop,HAcc,VAcc,SAcc,VV,SMS,Delta,Und,RTCMFU,x", ""),
}
FORMATS[4] = ("BARO", "QBff", "TimeUS,I,Alt,Press", "<QB2f")
FORMATS[5] = ("MAG", "QBhhh", "TimeUS,I,MagX,MagY,MagZ", "<QB3h")
FORMATS[3] = (*FORMATS[3][:3], "<QBHHHHBIHfHB")


def record(kind, *values):
    if kind == 128:
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", *values)
    return b"\xa3\x95" + bytes([kind]) + struct.pack(FORMATS[kind][3], *values)


def log(*, accuracy=True, status=3, around=False):
    """Two seconds: two units at 50 Hz, a fix a second."""
    out = record(128, 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    for kind, (name, form, columns, code) in FORMATS.items():
        size = struct.calcsize(code) + 3
        out += record(128, kind, size, name.encode(), form.encode(), columns.encode())
    for k in range(100):
        for unit in (0, 1):
            out += record(1, 20_000 * k, unit, 0.1, 0.2, 0.3 + unit, 1.0, 2.0, -9.75)
    for k in range(3):
        t_us = 1_000_000 * k
        place = (470_000_000, 80_000_000, 45_000)
        gps = (
            t_us,
            0,
            status if k else 1,
            MS + 1000 * k,
            WEEK,
            12,
            80,
            *place,
            5.0,
            90.0,
            0.5,
            0.0,
            1,
        )
        out += record(2, *gps)
        if around:
            out += record(4, t_us, 0, 1.5, 96_000.0) + record(5, t_us, 0, 250, -125, 500)
        if accuracy:
            out += record(3, t_us, 0, 100, 150, 250, 25, 1, t_us // 1000, 200, 47.5, 0, 0)
    return out


def test_the_first_unit_and_fixes_come_out_as_logged(tmp_path):
    (tmp_path / "log.BIN").write_bytes(log())
    whole, flight = imported(tmp_path, "ardupilot", tmp_path / "log.BIN")
    assert flight.start_gps_s == WEEK * 604800 + MS / 1e3 + 1
    assert len(flight.imu.t_s) == 100
    np.testing.assert_allclose(flight.imu.t_s[[0, 1]], [-1, -0.98], atol=1e-6)
    np.testing.assert_allclose(flight.imu.w_b_radps[50], [0.1, 0.2, 0.3], rtol=1e-6)
    np.testing.assert_allclose(flight.imu.f_b_mps2[50], [1, 2, -9.75], rtol=1e-6)
    p_e_m = ecef(np.radians([47.0]), np.radians([8.0]), np.array([497.5]))[0]
    np.testing.assert_allclose(flight.origin.to_e(flight.fixes[0].p_n_m)[0], p_e_m, atol=1e-3)
    np.testing.assert_allclose(flight.fixes[0].v_n_mps[0], [0, 5, 0.5], atol=1e-6)
    np.testing.assert_allclose(flight.fixes[0].position_sigma_m[0], [1.5, 1.5, 2.5])
    np.testing.assert_allclose(flight.fixes[0].velocity_sigma_mps[0], [0.25] * 3)
    lost = {loss.reason: loss.count for loss in whole.losses}
    assert lost == {"has no height (Status)": 1, "of another instance": 100, "of no fix's time": 1}


def test_a_log_of_2014_counts_milliseconds(tmp_path):
    columns = "Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ,T"
    formats = {
        1: ("IMU", "Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "<I6f"),
        2: ("GPS", "BIHBcLLeeEefI", columns, "<BIHBhiiiiIifI"),
    }
    out = record(128, 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    for kind, (name, form, names, code) in formats.items():
        size = struct.calcsize(code) + 3
        out += record(128, kind, size, name.encode(), form.encode(), names.encode())
    for k in range(100):
        body = struct.pack("<I6f", 5000 + 20 * k, 0.1, 0.2, 0.3, 1.0, 2.0, -9.75)
        out += b"\xa3\x95\x01" + body
    for k in range(2):
        place = (470_000_000, 80_000_000, 100, 45_000, 500, 9000, 0.5)
        fix = struct.pack("<BIHBhiiiiIifI", 3, MS + 1000 * k, WEEK, 12, 80, *place, 5000 + 1000 * k)
        out += b"\xa3\x95\x02" + fix
    (tmp_path / "log.BIN").write_bytes(out)
    _, flight = imported(tmp_path, "ardupilot", tmp_path / "log.BIN")
    assert flight.start_gps_s == WEEK * 604800 + MS / 1e3
    np.testing.assert_allclose(flight.imu.t_s[[0, -1]], [0, 1.98], atol=1e-6)
    np.testing.assert_allclose(flight.fixes[0].t_s, [0, 1], atol=1e-6)
    np.testing.assert_allclose(flight.fixes[0].v_n_mps[0], [0, 5, 0.5], atol=1e-6)
    assert flight.origin.height_m == pytest.approx(450)


def test_barometer_and_magnetometer_come_with_their_stated_noise(tmp_path):
    (tmp_path / "log.BIN").write_bytes(log(around=True))
    _, flight = imported(tmp_path, "ardupilot", tmp_path / "log.BIN", toml=AROUND)
    np.testing.assert_allclose(flight.barometer.height_m, 1.5)
    np.testing.assert_allclose(flight.barometer.t_s, [-1, 0, 1], atol=1e-6)
    np.testing.assert_allclose(flight.magnetometer.field_b_ut[0], [25, -12.5, 50])


def test_messages_that_are_not_read_are_counted(tmp_path):
    (tmp_path / "log.BIN").write_bytes(log(around=True).replace(b"MAG\0", b"MGX\0"))
    whole, _ = imported(tmp_path, "ardupilot", tmp_path / "log.BIN")
    assert {one.what: one.count for one in whole.losses}["MGX message"] == 3


def test_without_undulation_heights_are_above_the_sea_and_that_is_said(tmp_path):
    (tmp_path / "log.BIN").write_bytes(log(accuracy=False))
    whole, flight = imported(tmp_path, "ardupilot", tmp_path / "log.BIN")
    assert flight.origin.height_m == pytest.approx(450)
    assert flight.fixes[0].unstated == ("position", "velocity")
    assert "above the sea" in whole.notes["fixes"]


def test_bytes_that_are_no_message_are_counted_and_passed(tmp_path):
    content = log()
    middle = content.index(b"\xa3\x95\x01", len(content) // 2)
    (tmp_path / "log.BIN").write_bytes(content[:middle] + b"\0" * 50 + content[middle:])
    whole, flight = imported(tmp_path, "ardupilot", tmp_path / "log.BIN")
    assert len(flight.imu.t_s) == 100
    lost = {loss.reason: loss.count for loss in whole.losses}
    assert lost["in no message: the log is damaged there"] == 50


def test_without_a_fix_the_unit_keeps_its_own_clock(tmp_path):
    (tmp_path / "log.BIN").write_bytes(log(status=1))
    whole, flight = imported(tmp_path, "ardupilot", tmp_path / "log.BIN")
    assert (len(flight.imu.t_s), flight.fixes) == (100, ())
    assert "imu.clock_offset_s" in whole.missing


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"\xa3\x95\x80" + bytes(5), "log.BIN: holds nothing that a flight could use"),
        (
            log().replace(b"GPS\0", b"GPX\0").replace(b"IMU\0", b"IMX\0"),
            "holds nothing that a flight could use",
        ),
        (log().replace(b"Status", b"Statue"), "message GPS: field Status is missing"),
        (log().replace(b"AccZ", b"AccX"), "message IMU: field AccZ is missing"),
        (log().replace(b"QBffffff", b"QBfffff\0"), "message IMU: its FMT is damaged"),
    ],
)
def test_damage_is_one_line(tmp_path, capsys, content, text):
    (tmp_path / "log.BIN").write_bytes(content)
    assert text in refused(capsys, tmp_path, tmp_path / "log.BIN")
