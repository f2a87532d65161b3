"""Receivers' own solutions, made as their interface descriptions say: fixes and baselines."""

import binascii
import struct

import numpy as np
import pytest

from fgnav.cli import main
from fgnav.geometry.earth import ecef
from fgnav.io.flight.folder import load_flight
from tests.io.importers.helpers import imported, refused
from tests.io.importers.test_nmea import gga, rmc, sentence
from tests.io.importers.test_receivers import TOW_S, WEEK
from tests.io.importers.test_receivers import ubx as raw_ubx
from tests.io.rinex_texts import message, navigation_head

pytest.importorskip("pyubx2")
pytest.importorskip("pysbf2")

PLACE = (40.33, -3.88, 700.0)
VELOCITY = (1.5, -2.5, 0.25)  # north, east, down
SIGMA = (0.011, 0.011, 0.021)
VECTOR = (0.1234, -1.4567, 0.0321)  # north, east, down
EPOCHS = 5


def framed_ubx(kind, body):
    inner = struct.pack("<BBH", kind >> 8, kind & 255, len(body)) + body
    a = b = 0
    for byte in inner:
        a = (a + byte) & 255
        b = (b + a) & 255
    return b"\xb5\x62" + inner + bytes([a, b])


def pvt(k, fix_type=3):
    """Return NAV-PVT of u-blox F9's interface description, by UTC, 18 s behind GPS time."""
    body = struct.pack("<IHBBBBBB", int(TOW_S + k) * 1000, 2020, 6, 24, 23, 59, 42 + k, 7)
    body += struct.pack("<IiBBBB", 1, 0, fix_type, 1, 0, 12)
    place = (round(PLACE[1] * 1e7), round(PLACE[0] * 1e7), round(PLACE[2] * 1e3))
    body += struct.pack("<iiiiII", *place, 650_000, 11, 21)
    body += struct.pack("<iiiiiII", *(round(1e3 * v) for v in VELOCITY), 2915, 0, 35, 0)
    body += struct.pack("<HH4xihH", 100, 0, 0, 0, 0)
    return framed_ubx(0x0107, body)


def relative(k, flags=0b1_0011_0111 & ~0b1000 | 0b10100):
    """Return NAV-RELPOSNED, version 1: centimetres and tenths of millimetres."""
    tenths = [round(1e4 * one) for one in VECTOR]
    coarse = [int(one / 100) for one in tenths]
    fine = [one - 100 * whole for one, whole in zip(tenths, coarse, strict=True)]
    body = struct.pack("<BBHIiiiii4x", 1, 0, 0, int(TOW_S + k) * 1000, *coarse, 146, 27_515_000)
    body += struct.pack("<bbbbIIIII4xI", *fine, 0, 40, 50, 90, 60, 200_000, flags)
    return framed_ubx(0x013C, body)


def ubx(**changes):
    return b"".join(pvt(k) + relative(k, **changes) for k in range(EPOCHS))


def sbf_block(number, body):
    body += bytes(-(len(body) + 8) % 4)
    framed = struct.pack("<HH", number, len(body) + 8) + body
    return b"$@" + struct.pack("<H", binascii.crc_hqx(framed, 0)) + framed


def sbf(error=0):
    """Return PVTGeodetic, PosCovGeodetic, VelCovGeodetic, AttEuler, AttCovEuler."""
    out = b""
    for k in range(EPOCHS):
        time = struct.pack("<IH", int(TOW_S + k) * 1000, WEEK)
        body = time + struct.pack("<BBdddf", 4, error if k == 0 else 0, *np.radians(PLACE[:2]),
                                  PLACE[2], 50.0)  # fmt: skip
        body += struct.pack("<fffff", VELOCITY[0], VELOCITY[1], -VELOCITY[2], 0.0, 0.0)
        body += struct.pack("<fBBBBHHIBBHHHB", 0.0, 0, 0, 12, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0)
        out += sbf_block(4007, body)
        variances = [*(s**2 for s in SIGMA), 0, 0, 0, 0, 0, 0, 0]
        out += sbf_block(5906, time + struct.pack("<BB10f", 4, 0, *variances))
        out += sbf_block(5908, time + struct.pack("<BB10f", 4, 0, *[0.035**2] * 3, *[0.0] * 7))
        out += sbf_block(5938, time + struct.pack("<BBHBB6f", 12, 0, 2, 0, 0, 123.5, 2.5,
                                                  -2e10, 0, 0, 0))  # fmt: skip
        out += sbf_block(5939, time + struct.pack("<BB6f", 0, 0, 0.3**2, 0.6**2, -2e10, 0, 0, 0))
    return out


def novatel_log(number, body, k):
    head = struct.pack("<3sBHBBHHBBHIIHH", b"\xaa\x44\x12", 28, number, 0, 0x20, len(body), 0, 100,
                       180, WEEK, int((TOW_S + k) * 1000), 0, 0, 16000)  # fmt: skip
    return head + body + struct.pack("<I", ~binascii.crc32(head + body, 0xFFFFFFFF) & 0xFFFFFFFF)


def novatel():
    """Return BESTPOS, BESTVEL and HEADING2 of the OEM7 reference."""
    out = b""
    counts = bytes(8)
    speed, track = np.hypot(*VELOCITY[:2]), np.degrees(np.arctan2(VELOCITY[1], VELOCITY[0]))
    for k in range(EPOCHS):
        place = (*PLACE[:2], PLACE[2] - 50.0, 50.0)
        body = struct.pack("<IIdddfI3f4sff", 0, 50, *place, 61, *SIGMA, b"AAAA", 0, 0) + counts
        out += novatel_log(42, body, k)
        body = struct.pack("<IIffdddf", 0, 50, 0, 0, speed, track, -VELOCITY[2], 0)
        out += novatel_log(99, body, k)
        body = struct.pack("<II6f4s4s", 0, 50, 1.5, 123.5, 2.5, 0, 0.3, 0.6, b"ROVR", b"MAST")
        out += novatel_log(1335, body + counts, k)
    return out


def assert_fixes(flight, *, velocities=True):
    (fixes,) = flight.fixes
    assert flight.start_gps_s == WEEK * 604_800 + TOW_S
    np.testing.assert_allclose(fixes.t_s, np.arange(EPOCHS), atol=1e-6)
    p_e_m = ecef(*np.radians([[PLACE[0]], [PLACE[1]]]), np.array([PLACE[2]]))[0]
    np.testing.assert_allclose(flight.origin.to_e(fixes.p_n_m), [p_e_m] * EPOCHS, atol=2e-3)
    np.testing.assert_allclose(fixes.position_sigma_m, [SIGMA] * EPOCHS, rtol=1e-6)
    if velocities:
        np.testing.assert_allclose(fixes.v_n_mps, [VELOCITY] * EPOCHS, atol=1e-6)


def assert_heading(flight, *, pitch=True):
    (baseline,) = flight.baselines
    np.testing.assert_allclose(np.degrees(baseline.heading_rad), 123.5, rtol=1e-9)
    assert baseline.measured == ("direction" if pitch else "heading")
    np.testing.assert_allclose(np.degrees(baseline.heading_sigma_rad), 0.3, rtol=1e-5)
    assert baseline.antennas == ("gps1", "gps2")


def test_u_blox_gives_fixes_and_the_vector_to_their_antenna(tmp_path):
    (tmp_path / "rover.ubx").write_bytes(gga("235942.00").encode() + ubx())
    whole, flight = imported(tmp_path, "ubx", tmp_path / "rover.ubx")
    assert_fixes(flight)
    lost = {f"{one.what}: {one.reason}": one.count for one in whole.losses}
    assert lost == {"place of nmea: ubx has it, too": 1}
    np.testing.assert_allclose(flight.fixes[0].velocity_sigma_mps, 0.035)
    (baseline,) = flight.baselines
    np.testing.assert_allclose(baseline.vector_n_m, [VECTOR] * EPOCHS, atol=1e-9)
    sigma = np.sqrt(np.einsum("kii->ki", baseline.covariance_m2))
    np.testing.assert_allclose(sigma, [[0.004, 0.005, 0.009]] * EPOCHS, rtol=1e-9)
    assert baseline.antennas == ("gps2", "gps1")
    assert flight.fixes[0].antenna == "gps1"


def test_a_vector_before_the_first_date_has_the_week_after_it(tmp_path):
    (tmp_path / "rover.ubx").write_bytes(b"".join(relative(k) + pvt(k) for k in range(EPOCHS)))
    _, flight = imported(tmp_path, "ubx", tmp_path / "rover.ubx")
    np.testing.assert_allclose(flight.baselines[0].t_s, flight.fixes[0].t_s, atol=1e-6)


@pytest.mark.parametrize(
    ("flags", "reason"),
    [
        (0b1_0001_0111, "from a base that does not move"),
        (0b1_0010_0011, "no baseline of carrier phases"),
    ],
)
def test_vectors_that_are_none_of_the_vehicle_are_counted(tmp_path, flags, reason):
    (tmp_path / "rover.ubx").write_bytes(ubx(flags=flags))
    whole, flight = imported(tmp_path, "ubx", tmp_path / "rover.ubx")
    assert flight.baselines == ()
    (loss,) = whole.losses
    assert (loss.what, loss.count) == ("NAV-RELPOSNED message", EPOCHS)
    assert reason in loss.reason


def test_septentrio_gives_fixes_covariances_and_headings(tmp_path):
    (tmp_path / "rover.sbf").write_bytes(sbf())
    whole, flight = imported(tmp_path, "sbf", tmp_path / "rover.sbf")
    assert_fixes(flight)
    np.testing.assert_allclose(flight.fixes[0].velocity_sigma_mps, 0.035, rtol=1e-6)
    assert_heading(flight)
    assert whole.losses == ()


def ascii_log(name, text, k):
    head = f"{name}A,COM1,0,90.5,FINESTEERING,{WEEK},{TOW_S + k:.3f},02000000,b1f6,16000"
    body = f'{head};SOL_COMPUTED,NARROW_INT,{text},"AAAA",0.0,0.0'
    crc = ~binascii.crc32(body.encode(), 0xFFFFFFFF) & 0xFFFFFFFF
    return f"#{body}*{crc:08x}\r\n".encode()


def novatel_ascii():
    out = b""
    speed, track = np.hypot(*VELOCITY[:2]), np.degrees(np.arctan2(VELOCITY[1], VELOCITY[0]))
    for k in range(EPOCHS):
        place = f"{PLACE[0]},{PLACE[1]},{PLACE[2] - 50},50.0,WGS84,{SIGMA[0]},{SIGMA[1]},{SIGMA[2]}"
        out += ascii_log("BESTPOS", place, k)
        out += ascii_log("BESTVEL", f"0.0,0.0,{speed!s},{track!s},{-VELOCITY[2]},0.0", k)
        out += ascii_log("HEADING2", '1.5,123.5,2.5,0.0,0.3,0.6,"ROVR"', k)
    return out


def test_a_cut_file_is_read_to_its_last_whole_epoch(tmp_path):
    content = sbf()
    last = len(content) * (EPOCHS - 1) // EPOCHS + int.from_bytes(content[6:8], "little")
    (tmp_path / "rover.sbf").write_bytes(content[: last + 30])  # of the last epoch a place is whole
    whole, flight = imported(tmp_path, "sbf", tmp_path / "rover.sbf")
    assert len(flight.fixes[0].t_s) == EPOCHS - 1
    np.testing.assert_allclose(flight.fixes[0].position_sigma_m, [SIGMA] * (EPOCHS - 1), rtol=1e-6)
    lost = {one.reason: one.count for one in whole.losses}
    assert lost["has no sigma_n_m, as most have"] == 1


@pytest.mark.parametrize("make", [novatel, novatel_ascii])
def test_novatel_gives_fixes_velocities_and_headings(tmp_path, make):
    (tmp_path / "rover.gps").write_bytes(make())
    _, flight = imported(tmp_path, "novatel", tmp_path / "rover.gps")
    assert_fixes(flight)
    assert_heading(flight)
    assert flight.fixes[0].unstated == ("velocity",)


def test_sentences_give_headings_at_the_time_before_them(tmp_path):
    texts = []
    for k in range(3):
        texts += [rmc(f"12000{k}.00"), gga(f"12000{k}.00")]
        texts += [sentence("GPHDT,123.5,T"), sentence("GNTHS,123.5,A")][k % 2 : k % 2 + 1]
    (tmp_path / "a.nmea").write_text("".join(texts))
    _, flight = imported(tmp_path, "nmea", tmp_path / "a.nmea")
    (baseline,) = flight.baselines
    np.testing.assert_allclose(baseline.t_s, flight.fixes[0].t_s, atol=1e-6)
    np.testing.assert_allclose(np.degrees(baseline.heading_rad), 123.5)
    assert (baseline.measured, baseline.unstated) == ("heading", ("baseline",))


def test_pashr_has_pitch_and_sigmas(tmp_path):
    pashr = "PASHR,12000{k}.00,123.50,T,-0.83,2.50,0.01,0.234,0.600,0.300,2,1"
    texts = [rmc("120000.00"), *(sentence(pashr.format(k=k)) for k in range(3)), gga("120000.00")]
    (tmp_path / "a.nmea").write_text("".join(texts))
    _, flight = imported(tmp_path, "nmea", tmp_path / "a.nmea")
    assert_heading(flight)
    np.testing.assert_allclose(flight.baselines[0].t_s, [0, 1, 2], atol=1e-6)


def test_raw_measurements_with_messages_go_before_a_solution(tmp_path):
    (tmp_path / "rover.ubx").write_bytes(raw_ubx() + ubx())
    whole, flight = imported(tmp_path, "ubx", tmp_path / "rover.ubx")
    assert_fixes(flight)  # no broadcast messages in it
    lost = {one.what: one.reason for one in whole.losses}
    assert "solution = false in --settings takes it" in lost["RXM-RAWX message"]
    (tmp_path / "brdc.nav").write_text(navigation_head() + message())
    (tmp_path / "s.toml").write_text("solution = false\n")
    files = [str(tmp_path / name) for name in ("rover.ubx", "brdc.nav")]
    words = ["--settings", str(tmp_path / "s.toml"), "--out", str(tmp_path / "raw")]
    assert main(["import", *files, *words]) == 0
    flight = load_flight(tmp_path / "raw")
    assert flight.observations is not None
    assert (flight.fixes, flight.baselines) == ((), ())


def test_fixes_of_no_dimension_are_counted(tmp_path, capsys):
    (tmp_path / "a.ubx").write_bytes(pvt(0, fix_type=2) + pvt(1))
    whole, flight = imported(tmp_path, "ubx", tmp_path / "a.ubx")
    assert len(flight.fixes[0].t_s) == 1
    assert [one.reason for one in whole.losses] == ["the receiver had no fix of three dimensions"]
    (tmp_path / "b.ubx").write_bytes(pvt(0, fix_type=2))
    assert "b.ubx: has no fix of a receiver" in refused(capsys, tmp_path, tmp_path / "b.ubx")
    (tmp_path / "c.sbf").write_bytes(sbf(error=1))
    (tmp_path / "c").mkdir()
    _, flight = imported(tmp_path / "c", "sbf", tmp_path / "c.sbf")
    assert len(flight.fixes[0].t_s) == EPOCHS - 1
