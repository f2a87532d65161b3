"""Logs of PX4: made as its file format says, read and written again by pyulog."""

import struct

import numpy as np
import pytest

from fgnav.geometry.earth import ecef
from fgnav.geometry.rotations import to_euler
from tests.io.importers.helpers import AROUND, imported, refused

BOOT_UTC_S = 1_751_000_000  # 2025: GPS is 18 s ahead
ATTITUDE = "uint64_t timestamp;float[4] q;"
GLOBAL = "uint64_t timestamp;double lat;double lon;float alt;float alt_ellipsoid;"
LOCAL = "uint64_t timestamp;float vx;float vy;float vz;"
AIR = "uint64_t timestamp;float baro_alt_meter;"
MAGNET = "uint64_t timestamp;float[3] magnetometer_ga;"
IMU = "uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;"
SPEED = "float s_variance_m_s;float eph;float epv;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;"
SPEED += "uint64_t time_utc_usec;uint8_t fix_type;"
OLD = "uint64_t timestamp;int32_t lat;int32_t lon;int32_t alt_ellipsoid;" + SPEED
NEW = "uint64_t timestamp;double latitude_deg;double longitude_deg;double altitude_ellipsoid_m;"
NEW += SPEED


def message(kind, body):
    return struct.pack("<Hc", len(body), kind) + body


def log(gps_format, place, name, *, around=False):
    """Two seconds: 100 Hz of a still, level unit; a fix a second, the first without height."""
    formats = {"sensor_combined": IMU, name: gps_format}
    formats |= {"vehicle_attitude": ATTITUDE, "vehicle_global_position": GLOBAL}
    formats["vehicle_local_position"] = LOCAL
    if around:
        formats |= {"vehicle_air_data": AIR, "vehicle_magnetometer": MAGNET}
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    out += message(b"B", bytes(40))
    for topic, fields in formats.items():
        out += message(b"F", f"{topic}:{fields}".encode())
    for k, topic in enumerate(formats):
        out += message(b"A", struct.pack("<BH", 0, k) + topic.encode())
    for k in range(200):
        sample = struct.pack("<HQ6f", 0, 10_000 * k, 0.1, 0.2, 0.3, 1.0, 2.0, -9.75)
        out += message(b"D", sample)
    for k in range(3):
        t_us = 1_000_000 * k
        fix = struct.pack("<HQ", 1, t_us) + place
        fix += struct.pack("<6f", 0.25, 1.5, 2.5, 3.0, -4.0, 0.5)
        fix += struct.pack("<QB", (BOOT_UTC_S + k) * 1_000_000, 3 if k else 2)
        out += message(b"D", fix)
        out += message(b"D", struct.pack("<HQ4f", 2, t_us, np.cos(0.2), 0, 0, np.sin(0.2)))
        out += message(b"D", struct.pack("<HQddff", 3, t_us, 47.0, 8.0, 400.0, 450.0))
        out += message(b"D", struct.pack("<HQ3f", 4, t_us, 3.0, -4.0, 0.5))
        if around:
            out += message(b"D", struct.pack("<HQf", 5, t_us, 451.5))
            out += message(b"D", struct.pack("<HQ3f", 6, t_us, 0.25, -0.125, 0.5))
    return out


LOGS = {
    "of 2021": (OLD, struct.pack("<3i", 470_000_000, 80_000_000, 450_000), "vehicle_gps_position"),
    "of 2024": (NEW, struct.pack("<3d", 47.0, 8.0, 450.0), "sensor_gps"),
}


@pytest.fixture(params=LOGS)
def file(request, tmp_path):
    """A log that pyulog has written."""
    pyulog = pytest.importorskip("pyulog")
    made = tmp_path / "made.ulg"
    made.write_bytes(log(*LOGS[request.param]))
    pyulog.ULog(str(made)).write_ulog(str(tmp_path / "log.ulg"))
    return tmp_path / "log.ulg"


def test_samples_fixes_and_filter_come_out_as_logged(file, tmp_path):
    whole, flight = imported(tmp_path, "ulog", file)
    assert flight.start_gps_s == BOOT_UTC_S - 315_964_800 + 18 + 1
    np.testing.assert_allclose(flight.imu.t_s[[0, 1]], [-1, -0.99], atol=1e-6)
    np.testing.assert_allclose(flight.imu.f_b_mps2[7], [1, 2, -9.75], rtol=1e-6)
    np.testing.assert_allclose(flight.imu.w_b_radps[7], [0.1, 0.2, 0.3], rtol=1e-6)
    p_e_m = ecef(np.radians([47.0]), np.radians([8.0]), np.array([450.0]))[0]
    assert len(flight.fixes[0].t_s) == 2
    np.testing.assert_allclose(flight.origin.to_e(flight.fixes[0].p_n_m)[0], p_e_m, atol=1e-3)
    np.testing.assert_allclose(flight.fixes[0].v_n_mps[0], [3, -4, 0.5], atol=1e-6)
    np.testing.assert_allclose(flight.fixes[0].position_sigma_m[0], [1.5, 1.5, 2.5])
    np.testing.assert_allclose(flight.fixes[0].velocity_sigma_mps[0], [0.25] * 3)
    np.testing.assert_allclose(to_euler(flight.truth.R_nb)[0], [0, 0, 0.4], atol=1e-6)
    lost = {loss.reason: loss.count for loss in whole.losses}
    assert lost == {"has no height (fix_type)": 1}
    assert whole.flight.truth.is_reference
    assert whole.notes["truth"] == "the on-board filter's estimate, not truth"


def test_barometer_and_magnetometer_come_with_their_stated_noise(tmp_path):
    pytest.importorskip("pyulog")
    (tmp_path / "log.ulg").write_bytes(log(*LOGS["of 2024"], around=True))
    _, flight = imported(tmp_path, "ulog", tmp_path / "log.ulg", toml=AROUND)
    np.testing.assert_allclose(flight.barometer.height_m, 451.5)
    np.testing.assert_allclose(flight.barometer.t_s, [-1, 0, 1], atol=1e-6)
    np.testing.assert_allclose(flight.magnetometer.field_b_ut[0], [25, -12.5, 50])


RELATIVE = "uint64_t timestamp;float[3] position;float[3] position_accuracy;"
RELATIVE += "bool relative_position_valid;bool carrier_solution_fixed;bool moving_base_mode;"


def test_a_moving_base_is_a_baseline(tmp_path):
    content = log(*LOGS["of 2024"])
    head = 16 + len(message(b"B", bytes(40)))
    fields = message(b"F", f"sensor_gnss_relative:{RELATIVE}".encode())
    out = message(b"A", struct.pack("<BH", 0, 9) + b"sensor_gnss_relative")
    for k in range(3):
        values = (0.1, -1.5, 0.02, 0.01, 0.01, 0.02)
        out += message(b"D", struct.pack("<HQ6f3?", 9, 1_000_000 * k, *values, True, k != 1, True))
    (tmp_path / "log.ulg").write_bytes(content[:head] + fields + content[head:] + out)
    whole, flight = imported(tmp_path, "ulog", tmp_path / "log.ulg")
    (baseline,) = flight.baselines
    assert baseline.antennas == ("gps2", "gps1")
    np.testing.assert_allclose(baseline.t_s, [-1, 1], atol=1e-6)
    np.testing.assert_allclose(baseline.vector_n_m, [[0.1, -1.5, 0.02]] * 2, rtol=1e-6)
    lost = {loss.what: loss.count for loss in whole.losses}
    assert lost["baseline"] == 1


def test_a_log_that_ends_in_the_middle_is_read_up_to_there(file, tmp_path):
    content = file.read_bytes()
    file.write_bytes(content[:-20])
    _, flight = imported(tmp_path, "ulog", file)
    assert len(flight.fixes[0].t_s) == 2


def test_without_a_receiver_the_unit_keeps_its_own_clock(file, tmp_path):
    file.write_bytes(file.read_bytes().replace(b"_gps", b"_gpz"))
    whole, flight = imported(tmp_path, "ulog", file)
    assert (len(flight.imu.t_s), flight.fixes) == (200, ())
    assert "imu.clock_offset_s" in whole.missing


@pytest.mark.parametrize(
    ("damage", "text"),
    [
        (lambda content: content[:10], "cannot be read as ULog"),
        (lambda content: content.replace(b"fix_type", b"fix_tape"), "KeyError: 'fix_type'"),
        (
            lambda content: content.replace(b"sensor_", b"censor_").replace(
                b"vehicle_", b"wehicle_"
            ),
            "holds nothing that a flight could use",
        ),
    ],
)
def test_damage_is_one_line(file, tmp_path, capsys, damage, text):
    file.write_bytes(damage(file.read_bytes()))
    line = refused(capsys, tmp_path, file, "--format", "ulog")
    assert line.startswith(f"fgnav: {file}: ")
    assert text in line
