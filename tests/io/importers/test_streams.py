"""Streams of receivers: raw measurements by RTKLIB, solutions value by value, what is not used."""

import sys

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav.geometry.earth import ecef
from fgnav.io.flight.folder import load_flight
from fgnav.io.importers import importer_named
from fgnav.io.importers.assemble import assemble
from fgnav.io.importers.formats.streams import messages
from fgnav.io.importers.recognise import recognise_format
from fgnav.io.importers.settings import Settings, read_settings
from fgnav.io.rinex.reader import read_rinex
from fgnav.io.rtklib_convert import convert
from tests.io.importers import streams
from tests.io.importers.helpers import imported, refused, whole_of
from tests.io.importers.streams import EPOCHS, PLACE, SIGMA, VECTOR, VELOCITY, gga, rmc, sentence
from tests.io.rinex_texts import message, navigation_head

RAW = {name: getattr(streams, f"raw_{name}") for name in ("ubx", "sbf", "novatel", "rtcm3")}
DAY_S = 2295 * 604_800 + 86_400 + 18  # 2024-01-01 is day 1 of GPS week 2295


def read(tmp_path, name, content, toml=None):
    """Return the flight of a stream, what of it is not used, and all that was assembled."""
    content = content if isinstance(content, bytes) else content.encode()
    (tmp_path / f"a.{name}").write_bytes(content)
    whole, flight = imported(tmp_path, name, tmp_path / f"a.{name}", toml=toml)
    return flight, {f"{one.what}: {one.reason}": one.count for one in whole.unused}, whole


def decoded(tmp_path, name, content, settings=None):
    """Return what is found in raw measurements, and their observations."""
    (tmp_path / f"rover.{name}").write_bytes(content)
    (tmp_path / "scratch").mkdir()
    settings = settings or Settings()
    found = importer_named(name)(tmp_path / f"rover.{name}", settings, tmp_path / "scratch")
    return found, read_rinex([], [found.observations[0]], streams.START_GPS_S)[1][0]


@pytest.mark.parametrize("name", RAW)
def test_raw_measurements_come_out_as_they_were_sent(tmp_path, name):
    """SBF and RTCM 3 have codes in steps, and phases against them."""
    (tmp_path / "s.toml").write_text('start = "2020-06-26T12:00:00"\n')
    _, seen = decoded(tmp_path, name, RAW[name](), read_settings(tmp_path / "s.toml"))
    assert seen.satellites == tuple(f"G{n:02}" for n in range(5, 11))
    np.testing.assert_allclose(seen.t_s, np.arange(10.0), atol=1e-6)
    k = np.arange(10)[:, None]
    is_exact = name in ("ubx", "novatel")
    codes_m = streams.CODES_M + 10 * k
    np.testing.assert_allclose(seen.code_m[:, 0], codes_m, rtol=0, atol=1e-3 if is_exact else 0.011)
    if is_exact:
        phase = streams.PHASES_CYCLES + 50 * k
        np.testing.assert_allclose(np.abs(seen.phase_cycles[:, 0]), phase, rtol=0, atol=1e-3)
        np.testing.assert_allclose(seen.doppler_hz[:, 0], np.tile(-50.0 + np.arange(6), (10, 1)))
    else:
        phase = seen.phase_cycles[:, 0] - seen.code_m[:, 0] / (299_792_458.0 / 1575.42e6)
        near = np.arange(6.0) if name == "sbf" else np.zeros(6)
        np.testing.assert_allclose(phase, np.tile(near, (10, 1)), rtol=0, atol=0.02)


@pytest.mark.parametrize(("name", "lost"), [("ubx", 216), ("sbf", 140), ("novatel", 300)])
def test_a_damaged_epoch_is_left_out_and_its_bytes_are_counted(tmp_path, name, lost):
    content = bytearray(RAW[name]())
    content[len(content) // 2 + 40] ^= 0xFF
    found, seen = decoded(tmp_path, name, bytes(content))
    assert len(seen.t_s) == 9
    counts = {loss.what: loss.count for loss in found.unused}
    assert counts == {"byte": lost} | ({"EndOfMeas message": 10} if name == "sbf" else {})


@pytest.mark.parametrize("name", RAW)
def test_only_what_is_damaged_lies_outside_messages(name):
    def outside(stream):
        return len(stream) - sum(len(message.raw) for message in messages(stream)[0])

    content, between, rng = RAW[name](), b"$GPHDT,1.0,T*34\r\n", np.random.default_rng(5)
    assert messages(between + content)[0][0].name == "HDT"
    assert outside(between + content + between) == 0
    assert outside(b"noise" + content + b"noise") == 10
    for at in rng.integers(len(content), size=100):
        changed = bytearray(content)
        changed[at] ^= int(rng.integers(1, 256))
        assert 0 < outside(bytes(changed)) <= len(content) // 10  # an epoch


def test_raw_measurements_with_messages_go_before_a_solution(tmp_path, capsys):
    content = streams.raw_ubx() + streams.ubx()
    flight, unused, _ = read(tmp_path, "ubx", content)
    assert_fixes(flight)  # no broadcast messages in it
    text = "the receiver's solution is taken; solution = false in --settings takes it"
    assert unused == {f"RXM-RAWX message: {text}": 10}
    (tmp_path / "brdc.nav").write_text(navigation_head() + message())
    (tmp_path / "s.toml").write_text("solution = false\n")
    files = [str(tmp_path / name) for name in ("a.ubx", "a.ubx", "brdc.nav")]
    words = ["--settings", str(tmp_path / "s.toml"), "--out", str(tmp_path / "raw")]
    assert main(["import", *files, *words]) == 0
    assert "antenna.position_b_m: " in capsys.readouterr().out
    flight = load_flight(tmp_path / "raw")
    assert flight.observations.tag_s.shape == (10, 2)  # two receivers of one name
    assert (flight.fixes, flight.baselines) == ((), ())


def test_without_a_place_in_the_header_code_gives_the_origin(shared, tmp_path):
    folder = shared / "wettzell"
    lines = (folder / "WTZR00DEU_R_20201770000_01D_30S_MO_120epoch.rnx").read_text().splitlines()
    station = next(line for line in lines if "APPROX POSITION XYZ" in line)
    blank = f"{0:14.4f}{0:14.4f}{0:14.4f}".ljust(60) + "APPROX POSITION XYZ"
    text = "\n".join(blank if line == station else line for line in lines) + "\n"
    (tmp_path / "wtzr.rnx").write_text(text)
    orbits = folder.parent / "orbits" / "ESBC00DNK_R_20201770000_01D_MN.rnx"
    found = [
        importer_named("rinex")(file, Settings(), tmp_path)
        for file in (tmp_path / "wtzr.rnx", orbits)
    ]
    whole = whole_of(found, Settings())
    known = np.array([float(word) for word in station.split()[:3]])
    assert np.linalg.norm(whole.flight.origin.p_e_m - known) < 10  # m, of a code solution
    assert "origin" not in whole.missing
    assert "origin" in assemble(found[:1], Settings()).missing


def assert_fixes(flight):
    (fixes,) = flight.fixes
    assert flight.start_gps_s == streams.START_GPS_S
    np.testing.assert_allclose(fixes.t_s, np.arange(EPOCHS), atol=1e-6)
    p_e_m = ecef(*np.radians([[PLACE[0]], [PLACE[1]]]), np.array([PLACE[2]]))[0]
    np.testing.assert_allclose(flight.origin.to_e(fixes.p_n_m), [p_e_m] * EPOCHS, atol=2e-3)
    np.testing.assert_allclose(fixes.position_sigma_m, [SIGMA] * EPOCHS, rtol=1e-6)
    np.testing.assert_allclose(fixes.v_n_mps, [VELOCITY] * EPOCHS, atol=1e-6)


def assert_heading(flight):
    (baseline,) = flight.baselines
    np.testing.assert_allclose(np.degrees(baseline.heading_rad), 123.5, rtol=1e-9)
    np.testing.assert_allclose(np.degrees(baseline.heading_sigma_rad), 0.3, rtol=1e-5)
    assert (baseline.measured, baseline.antennas) == ("direction", ("gps1", "gps2"))


@pytest.mark.parametrize("order", [1, -1])
def test_u_blox_gives_fixes_and_the_vector_to_their_antenna(tmp_path, order):
    """A vector before the first date has the week of it."""
    pairs = ((streams.pvt(k), streams.relative(k))[::order] for k in range(EPOCHS))
    content = gga("235942.00").encode() + b"".join(one for pair in pairs for one in pair)
    flight, unused, _ = read(tmp_path, "ubx", content)
    assert_fixes(flight)
    assert unused == {"latitude_deg of nmea: ubx has it, too": 1}
    np.testing.assert_allclose(flight.fixes[0].velocity_sigma_mps, 0.035)
    (baseline,) = flight.baselines
    np.testing.assert_allclose(baseline.t_s, flight.fixes[0].t_s, atol=1e-6)
    np.testing.assert_allclose(baseline.vector_n_m, [VECTOR] * EPOCHS, atol=1e-9)
    sigma = np.sqrt(np.einsum("kii->ki", baseline.covariance_m2))
    np.testing.assert_allclose(sigma, [[0.004, 0.005, 0.009]] * EPOCHS, rtol=1e-9)
    assert (baseline.antennas, flight.fixes[0].antenna) == (("gps2", "gps1"), "gps1")


@pytest.mark.parametrize(
    ("flags", "reason"),
    [
        (0b1_0001_0111, "from a base that does not move with the vehicle, or without a length"),
        (0b1_0010_0011, "no baseline of carrier phases"),
    ],
)
def test_vectors_that_are_none_of_the_vehicle_are_counted(tmp_path, flags, reason):
    flight, unused, _ = read(tmp_path, "ubx", streams.ubx(flags=flags))
    assert flight.baselines == ()
    assert unused == {f"NAV-RELPOSNED message: {reason}": EPOCHS}


@pytest.mark.parametrize(
    ("name", "make", "unstated"),
    [
        ("sbf", streams.sbf, ()),
        ("novatel", streams.novatel, ("velocity",)),
        ("novatel", streams.novatel_ascii, ("velocity",)),
    ],
)
def test_septentrio_and_novatel_give_fixes_sigmas_and_headings(tmp_path, name, make, unstated):
    flight, unused, _ = read(tmp_path, name, make())
    assert_fixes(flight)
    assert_heading(flight)
    assert flight.fixes[0].unstated == unstated
    if name == "sbf":
        np.testing.assert_allclose(flight.fixes[0].velocity_sigma_mps, 0.035, rtol=1e-6)
    assert unused == {}


def test_a_cut_file_is_read_to_its_last_whole_epoch(tmp_path):
    content = streams.sbf()
    last = len(content) * (EPOCHS - 1) // EPOCHS + int.from_bytes(content[6:8], "little")
    flight, unused, _ = read(tmp_path, "sbf", content[: last + 30])  # a place is whole
    assert len(flight.fixes[0].t_s) == EPOCHS - 1
    assert unused["fixes row: has no sigma_n_m, as most have"] == 1


def test_fixes_of_no_dimension_or_with_an_error_are_counted(tmp_path):
    flight, unused, _ = read(tmp_path, "ubx", streams.pvt(0, fix_type=2) + streams.pvt(1))
    assert len(flight.fixes[0].t_s) == 1
    assert unused == {"NAV-PVT message: the receiver had no fix of three dimensions": 1}
    (tmp_path / "sbf").mkdir()
    flight, unused, _ = read(tmp_path / "sbf", "sbf", streams.sbf(error=1))
    assert len(flight.fixes[0].t_s) == EPOCHS - 1
    assert unused["PVTGeodetic message: no solution was computed"] == 1


def test_sentences_are_dated_across_midnight_with_sigmas_and_headings(tmp_path):
    """HDT and THS have the time of the sentence before them; GNS is a fix as GGA is."""
    texts = [gga("235959.50"), sentence("GPGST,235959.50,1,2,3,45,0.01,0.02,0.03")]
    texts += [sentence("GPHDT,123.5,T"), gga("000000.50"), rmc("000000.50", "020124")]
    texts += [sentence("GPGST,000000.50,1,2,3,45,0.01,0.02,0.03"), sentence("GNTHS,123.5,A")]
    texts += [sentence("GNGNS,000001.50,4019.8,N,00352.8,W,AN,12,0.8,650.0,50.0,,")]
    texts += [sentence("GNGST,000001.50,1,2,3,45,0.01,0.02,0.03")]
    texts += [sentence("GNGNS,000002.50,4019.8,N,00352.8,W,NN,12,0.8,650.0,50.0,,")]
    flight, unused, whole = read(tmp_path, "nmea", "2024-01-01 23:59:59 ".join(["", *texts]))
    assert unused["GNS message: the receiver had no fix"] == 1
    assert "the time of the sentence before" in whole.notes["baseline"]
    assert flight.start_gps_s == pytest.approx(DAY_S + 86_399.5)
    np.testing.assert_allclose(flight.fixes[0].t_s, [0, 1, 2], atol=1e-6)
    np.testing.assert_allclose(flight.fixes[0].position_sigma_m, [[0.01, 0.02, 0.03]] * 3)
    (baseline,) = flight.baselines
    np.testing.assert_allclose(baseline.t_s, [0, 1], atol=1e-6)
    np.testing.assert_allclose(np.degrees(baseline.heading_rad), 123.5)
    assert (baseline.measured, baseline.unstated) == ("heading", ("baseline",))


def test_zda_dates_and_pashr_has_pitch_and_sigmas(tmp_path):
    pashr = "PASHR,12000{k}.00,123.50,T,-0.83,2.50,0.01,0.234,0.600,0.300,2,1"
    texts = [sentence("GPZDA,120000.00,01,01,2024,00,00"), gga("120000.00")]
    texts += [sentence(pashr.format(k=k)) for k in range(3)]
    flight, _, _ = read(tmp_path, "nmea", "".join(texts))
    assert flight.start_gps_s == DAY_S + 43_200
    assert_heading(flight)
    np.testing.assert_allclose(flight.baselines[0].t_s, [0, 1, 2], atol=1e-6)


def test_what_is_no_fix_damaged_or_not_read_is_counted(tmp_path):
    damaged = ["0,0001*4E\r\n", gga("120001.00").replace("648", "649")]
    texts = [*damaged, gga("115959.00", 0), gga("115959.50", 6), rmc("120000.00")]
    texts += [gga("120000.00"), sentence("GPGSV,1,1,00")]
    texts += [sentence("GNRMC,120001.00,A,4019.8,N,00352.8,W,fast,0.0,010124,,,R")]
    _, unused, _ = read(tmp_path, "nmea", "".join(texts))
    assert unused == {
        "byte: in no whole message: damaged, or of another format": sum(map(len, damaged)),
        "GGA message: the receiver had no fix": 1,
        "GGA message: dead reckoning": 1,
        "RMC message: speed and course without a vertical velocity": 1,
        "RMC message: cannot be decoded": 1,
        "GSV message: not read": 1,
    }


def test_sentences_without_checksums_are_read_where_none_has_one(tmp_path):
    texts = [rmc("120000.00"), gga("120000.00"), rmc("120001.00"), gga("120001.00")]
    bare = [f"{text.partition('*')[0]}\r\n" for text in texts]
    flight, unused, whole = read(tmp_path, "nmea", "".join([*bare, bare[0][:20]]))
    assert len(flight.fixes[0].t_s) == 2
    assert whole.notes["nmea"].startswith("its 4 sentences have no checksums")
    assert unused["byte: in no whole message: damaged, or of another format"] == 20
    (tmp_path / "a.nmea").rename(tmp_path / "a.log")
    assert recognise_format(tmp_path / "a.log", tmp_path)[0] == "nmea"
    (tmp_path / "mixed").mkdir()
    flight, unused, _ = read(tmp_path / "mixed", "nmea", "".join([*texts, bare[1]]))
    assert unused["byte: in no whole message: damaged, or of another format"] == len(bare[1])


@pytest.mark.parametrize("name", ["ubx", "sbf", "novatel"])
def test_a_log_that_does_not_begin_with_a_message_is_recognised_by_the_first_whole_one(
    tmp_path, name
):
    content = getattr(streams, name)()
    (tmp_path / "a.log").write_bytes(b"# a receiver's log\n" + content[9:])
    assert recognise_format(tmp_path / "a.log", tmp_path)[0] == name


@pytest.mark.parametrize("status", [True, False])
def test_positions_of_u_blox_serve_where_nothing_better_is_there(tmp_path, status):
    """NAV-POSLLH, NAV-VELNED; NAV-STATUS says which are none, NAV-TIMEGPS dates them."""
    content = b"".join(streams.old_ubx(k, status=status) for k in range(EPOCHS))
    flight, unused, _ = read(tmp_path, "ubx", content)
    (fixes,) = flight.fixes
    assert flight.start_gps_s == streams.START_GPS_S + status  # the first has no fix
    assert len(fixes.t_s) == EPOCHS - status
    np.testing.assert_allclose(fixes.position_sigma_m, [SIGMA] * len(fixes.t_s), rtol=1e-6)
    np.testing.assert_allclose(fixes.v_n_mps, [VELOCITY] * len(fixes.t_s), atol=1e-6)
    reason = "the receiver had no fix of three dimensions"
    names = ("NAV-POSLLH", "NAV-VELNED") if status else ()
    assert unused == {f"{name} message: {reason}": 1 for name in names}
    (tmp_path / "both").mkdir()
    flight, unused, _ = read(tmp_path / "both", "ubx", content + streams.ubx())
    assert_fixes(flight)
    assert unused["latitude_deg of NAV-POSLLH: ubx has it, too"] == EPOCHS - status


def test_a_start_dates_sentences_and_heights_may_lack_the_undulation(tmp_path):
    toml = 'start = "2024-01-02T03:00:00"'  # within half a day
    flight, _, whole = read(tmp_path, "nmea", gga("235959.00", undulation=""), toml)
    np.testing.assert_allclose(flight.fixes[0].t_s, -3 * 3600 - 1 + 18, atol=1e-6)
    assert "above the sea" in whole.notes["fixes"]


NO_FIX, NO_DATE = "has no fix of a receiver, as of NAV-PVT", "no RMC or ZDA sentence has a date"
NOISE = np.random.default_rng(3).bytes(5000)


@pytest.mark.parametrize(
    ("name", "content", "rule"),
    [
        ("nmea", rmc("120000.00").encode(), NO_FIX),
        ("nmea", gga("120000.00").encode(), f"{NO_DATE}; state start in --settings"),
        ("nmea", (rmc("120000.00", "990124") + gga("120000.00")).encode(), NO_DATE),
        ("ubx", streams.pvt(0, fix_type=2), NO_FIX),
        *((name, RAW[name]()[:40] + NOISE, NO_FIX) for name in ("ubx", "sbf", "novatel")),
        ("rtcm3", streams.raw_rtcm3(), "RTCM 3 has no week; state start in --settings"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, capsys, name, content, rule):
    (tmp_path / "rover").write_bytes(content)
    assert rule in refused(capsys, tmp_path, tmp_path / "rover", "--format", name)


@pytest.mark.parametrize(
    ("program", "text"),
    [
        ("import os; os.kill(os.getpid(), 11)", r"a.ubx: RTKLIB crashed .status -11.; the file"),
        ("import time; time.sleep(60)", "a.ubx: RTKLIB did not end within 0 s"),
        ("import sys; sys.exit('no pyrtklib5')", "RTKLIB cannot run: no pyrtklib5"),
    ],
)
def test_a_crash_or_a_hang_of_rtklib_names_the_file(tmp_path, program, text):
    path = tmp_path / "a.ubx"
    path.write_bytes(b"")
    with pytest.raises(BadInputError, match=text):
        convert(path, [], command=(sys.executable, "-c", program), timeout_s=0.3)
