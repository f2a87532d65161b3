"""Receivers' own formats, made as their interface descriptions say, decoded by RTKLIB."""

import binascii
import struct

import numpy as np
import pytest

from fgnav.cli import main
from fgnav.io.importers import importer_named
from fgnav.io.importers.assemble import assemble
from fgnav.io.importers.formats.streams import messages
from fgnav.io.importers.settings import Settings, read_settings
from fgnav.io.rinex.reader import read_rinex
from tests.io.importers.helpers import refused, whole_of
from tests.io.rinex_texts import message, navigation_head

WEEK, TOW_S = 2111, 345_600.0  # 2020-06-25T00:00:00
START_GPS_S = WEEK * 604800 + TOW_S
CODES_M = 2.1e7 + 1000.0 * np.arange(6)
PHASES_CYCLES = 1.1e8 + np.arange(6.0)


def ubx():
    """Return ten epochs of six GPS satellites, L1 C/A: RXM-RAWX of u-blox F9's interface manual."""
    out = b""
    for k in range(10):
        body = struct.pack("<dHbBBB2x", TOW_S + k, WEEK, 18, 6, 1, 1)
        for i in range(6):
            body += struct.pack("<ddf", CODES_M[i] + 10 * k, PHASES_CYCLES[i] + 50 * k, -50.0 + i)
            body += struct.pack("<BBBBHBBBBBx", 0, 5 + i, 0, 0, 60000, 45, 4, 4, 6, 7)
        framed = struct.pack("<BBH", 2, 0x15, len(body)) + body
        a = b = 0
        for byte in framed:
            a = (a + byte) & 255
            b = (b + a) & 255
        out += b"\xb5\x62" + framed + bytes([a, b])
    return out


def novatel():
    """Return the same as RANGE of NovAtel's OEM6 reference: L1 C/A, locked, parity known."""
    status = 0x08001C04 | 1 << 10 | 1 << 12
    out = b""
    for k in range(10):
        body = struct.pack("<I", 6)
        for i in range(6):
            body += struct.pack("<HHdf", 5 + i, 0, CODES_M[i] + 10 * k, 0.05)
            body += struct.pack("<dff", -(PHASES_CYCLES[i] + 50 * k), 0.003, -50.0 + i)
            body += struct.pack("<ffI", 45.0, 600.0, status)
        ms = int((TOW_S + k) * 1000)
        head = struct.pack("<3sBHBBHHBBHIIHH", b"\xaa\x44\x12", 28, 43, 0, 0, len(body), 0, 0, 180,
                           WEEK, ms, 0, 0, 0)  # fmt: skip
        framed = head + body
        crc = ~binascii.crc32(framed, 0xFFFFFFFF) & 0xFFFFFFFF
        out += framed + struct.pack("<I", crc)
    return out


def sbf():
    """Return the same as MeasEpoch of Septentrio's reference guide; phases lie near the codes."""
    out = b""
    for k in range(10):
        body = struct.pack("<IHBBBBBB", int((TOW_S + k) * 1000), WEEK, 6, 20, 12, 0, 0, 0)
        for i in range(6):
            code = round((CODES_M[i] + 10 * k) * 1000)
            body += struct.pack("<BBBBI", i + 1, 0, 5 + i, code >> 32, code & 0xFFFFFFFF)
            body += struct.pack("<iHbBHBB", round(1e4 * (-50.0 + i)), 1000 * i, 0, 140, 600, 0, 0)
        end = struct.pack("<IHBB", int((TOW_S + k) * 1000), WEEK, 0, 0)
        for number, content in ((4027, body), (5922, end)):  # MeasEpoch, EndOfMeas
            framed = struct.pack("<HH", number, len(content) + 8) + content
            out += b"$@" + struct.pack("<H", binascii.crc_hqx(framed, 0)) + framed
    return out


def bits(*fields):
    """Return numbers of so many bits one behind the other, filled up to bytes."""
    text = "".join(format(value & (1 << width) - 1, f"0{width}b") for value, width in fields)
    text += "0" * (-len(text) % 8)
    return int(text, 2).to_bytes(len(text) // 8, "big")


def rtcm3():
    """Return the same as message 1002 of RTCM 10403: ten epochs, phases equal to the codes."""
    out = b""
    for k in range(10):
        fields = [(1002, 12), (1, 12), (int((TOW_S + k) * 1000), 30), (0, 1), (6, 5), (0, 4)]
        for i in range(6):
            turns, rest = divmod(CODES_M[i] + 10 * k, 299_792.458)
            fields += [(5 + i, 6), (0, 1), (round(rest / 0.02), 24), (0, 20)]
            fields += [(100, 7), (int(turns), 8), (180, 8)]
        body = bits(*fields)
        framed = b"\xd3" + struct.pack(">H", len(body)) + body
        crc = 0
        for byte in framed:  # CRC-24Q
            crc ^= byte << 16
            for _ in range(8):
                crc = crc << 1 ^ (0x1864CFB if crc & 0x800000 else 0)
        out += framed + (crc & 0xFFFFFF).to_bytes(3, "big")
    return out


def decoded(tmp_path, name, content, settings=None):
    file = tmp_path / f"rover.{name}"
    file.write_bytes(content)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    found = importer_named(name)(file, settings or Settings(), scratch)
    return found, read_rinex([], [found.observations[0]], START_GPS_S)[1][0]


@pytest.mark.parametrize(("name", "made"), [("ubx", ubx), ("novatel", novatel)])
def test_observations_come_out_as_they_were_sent(tmp_path, name, made):
    found, seen = decoded(tmp_path, name, made())
    assert found.observations[0].name == "rover.obs"
    assert seen.satellites == tuple(f"G{n:02}" for n in range(5, 11))
    np.testing.assert_allclose(seen.t_s, np.arange(10.0), atol=1e-6)
    k = np.arange(10)[:, None]
    np.testing.assert_allclose(seen.code_m[:, 0], CODES_M + 10 * k, rtol=0, atol=1e-3)
    phase = np.abs(seen.phase_cycles[:, 0])
    np.testing.assert_allclose(phase, PHASES_CYCLES + 50 * k, rtol=0, atol=1e-3)
    np.testing.assert_allclose(seen.doppler_hz[:, 0], np.tile(-50.0 + np.arange(6), (10, 1)))


@pytest.mark.parametrize(("name", "made"), [("sbf", sbf), ("rtcm3", rtcm3)])
def test_codes_and_the_phases_beside_them_come_out(tmp_path, name, made):
    (tmp_path / "s.toml").write_text('start = "2020-06-26T12:00:00"\n')
    _, seen = decoded(tmp_path, name, made(), read_settings(tmp_path / "s.toml"))
    assert seen.satellites == tuple(f"G{n:02}" for n in range(5, 11))
    np.testing.assert_allclose(seen.t_s, np.arange(10.0), atol=1e-6)
    codes_m = CODES_M + 10 * np.arange(10)[:, None]
    np.testing.assert_allclose(seen.code_m[:, 0], codes_m, rtol=0, atol=0.011)
    beside_cycles = np.arange(6.0) if name == "sbf" else np.zeros(6)
    wavelength_m = 299_792_458.0 / 1575.42e6
    phase = seen.phase_cycles[:, 0] - seen.code_m[:, 0] / wavelength_m
    np.testing.assert_allclose(phase, np.tile(beside_cycles, (10, 1)), rtol=0, atol=0.02)


@pytest.mark.parametrize("name", ["ubx", "sbf", "novatel"])
def test_a_file_without_observations_is_one_line(tmp_path, capsys, name):
    made = {"ubx": ubx, "sbf": sbf, "novatel": novatel}[name]()
    noise = np.random.default_rng(3).bytes(5000)
    (tmp_path / "rover").write_bytes(made[:40] + noise)
    line = refused(capsys, tmp_path, tmp_path / "rover", "--format", name)
    assert "rover: has no fix of a receiver" in line


@pytest.mark.parametrize(
    ("name", "made", "lost"), [("ubx", ubx, 216), ("sbf", sbf, 140), ("novatel", novatel, 300)]
)
def test_a_damaged_epoch_is_left_out_and_its_bytes_are_counted(tmp_path, name, made, lost):
    content = bytearray(made())
    content[len(content) // 2 + 40] ^= 0xFF
    found, seen = decoded(tmp_path, name, bytes(content))
    assert len(seen.t_s) == 9
    counts = {loss.what: loss.count for loss in found.losses}
    assert counts == {"byte": lost} | ({"EndOfMeas message": 10} if name == "sbf" else {})


@pytest.mark.parametrize("name", ["ubx", "sbf", "novatel", "rtcm3"])
def test_only_what_is_damaged_lies_outside_messages(name):
    def outside(stream):
        return len(stream) - sum(len(one.raw) for one in messages(stream))

    content = {"ubx": ubx, "sbf": sbf, "novatel": novatel, "rtcm3": rtcm3}[name]()
    epoch, rng = len(content) // 10, np.random.default_rng(5)
    sentence = b"$GPHDT,1.0,T*34\r\n"
    assert next(one.name for one in messages(sentence + content)) == "HDT"
    assert outside(sentence + content + sentence) == 0
    assert outside(b"noise" + content + b"noise") == 10
    for at in rng.integers(len(content), size=100):
        changed = bytearray(content)
        changed[at] ^= int(rng.integers(1, 256))
        assert 0 < outside(bytes(changed)) <= epoch
    for at in range(1, epoch):
        assert outside(content[:-at]) in range(1, epoch) or (name, at) == ("sbf", 16)


def test_a_receivers_file_with_navigation_becomes_a_flight(tmp_path, capsys):
    (tmp_path / "rover.ubx").write_bytes(ubx())
    (tmp_path / "brdc.nav").write_text(navigation_head() + message())
    files = [str(tmp_path / name) for name in ("rover.ubx", "brdc.nav")]
    assert main(["import", *files, "--out", str(tmp_path / "flight")]) == 0
    assert "antenna.position_b_m: " in capsys.readouterr().out
    text = (tmp_path / "flight" / "flight.toml").read_text()
    assert 'observations = "rover.obs"' in text
    assert 'navigation = ["brdc.nav"]' in text


def test_without_a_place_in_the_header_code_tells_the_origin(shared, tmp_path):
    folder = shared / "wettzell"
    lines = (folder / "WTZR00DEU_R_20201770000_01D_30S_MO_120epoch.rnx").read_text().splitlines()
    station = next(line for line in lines if "APPROX POSITION XYZ" in line)
    blank = f"{0:14.4f}{0:14.4f}{0:14.4f}".ljust(60) + "APPROX POSITION XYZ"
    text = "\n".join(blank if line == station else line for line in lines) + "\n"
    (tmp_path / "wtzr.rnx").write_text(text)
    messages = folder.parent / "orbits" / "ESBC00DNK_R_20201770000_01D_MN.rnx"
    settings, scratch = Settings(), tmp_path
    read = importer_named("rinex")
    found = [read(file, settings, scratch) for file in (tmp_path / "wtzr.rnx", messages)]
    whole = whole_of(found, settings)
    known = np.array([float(word) for word in station.split()[:3]])
    assert np.linalg.norm(whole.flight.origin.p_e_m - known) < 10  # m, of a code solution
    assert "origin" not in whole.missing
    assert "origin" in assemble(found[:1], settings).missing
