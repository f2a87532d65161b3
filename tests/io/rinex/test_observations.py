"""Observation files: every field as it stands, whole epochs alone, what is lost with its rule."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from hatanaka import crx2rnx

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import read_header
from fgnav.io.rinex.observations import to_observations
from fgnav.io.rinex.reader import read_rinex
from fgnav.types.observations import HALF_CYCLE, LOST_LOCK
from tests.io.rinex_texts import (
    SATELLITES,
    epoch_3,
    head_3,
    line,
    observation_2,
    observation_3,
    values_3,
)

START_GPS_S = 1_277_078_400.0  # 2020-06-25
GOOD, TWO = observation_3(), observation_2()
FIELDS = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")
PATH = Path("a.rnx")


def read(text, start_gps_s=START_GPS_S, wanted=None):
    """Return the observations of one antenna."""
    content = np.frombuffer(text.encode("latin-1"), np.uint8)
    header = read_header(PATH, content, "observations")
    return to_observations(header, content, start_gps_s, wanted or {})


def lost(got):
    return {f"{one.what}: {one.reason}": one.count for one in got.unused}


def assert_as_it_stands(got, text):
    """Every kept value equals the field of the file; nothing else was invented."""
    column = {pair: m for m, pair in enumerate(zip(got.satellites, got.signals, strict=True))}
    expected = np.full((*got.code_m.shape, 5), np.nan)
    expected[..., 4] = 0
    for (epoch, satellite, signal), row in values_3(text).items():
        if (satellite, signal) in column:
            expected[epoch, 0, column[satellite, signal]] = row
    for k, name in enumerate(FIELDS):
        values = getattr(got, name)
        np.testing.assert_array_equal(values, expected[..., k].astype(values.dtype))


def same(got, want):
    for name in ("t_s", *FIELDS):
        np.testing.assert_array_equal(getattr(got, name), getattr(want, name))
    assert (got.satellites, got.signals) == (want.satellites, want.signals)


def with_line(number, new, text=GOOD):
    """Return the text with one line replaced, counted from 1."""
    lines = text.splitlines(keepends=True)
    return "".join([*lines[: number - 1], new, *lines[number:]])


@pytest.mark.parametrize("version", ["3.00", "3.02", "3.03", "3.04", "3.05", "4.00", "4.02"])
def test_every_version_of_rinex_3_and_4_is_read_as_it_stands(version):
    got = read(observation_3(version=version))
    assert got.t_s.tolist() == [0, 1, 2, 3]
    assert got.satellites == ("C11", "E07", "E07", "G05", "G05", "G05", "G12", "G12", "G12", "R03")
    assert got.signals == ("2I", "1X", "5X", "1C", "2W", "5Q", "1C", "2W", "5Q", "1C")
    assert_as_it_stands(got, GOOD)
    assert got.lock_flags[1, 0, 3] == LOST_LOCK
    assert got.unused == ()


def test_real_1_hz_file_is_read_as_it_stands(shared):
    path = shared / "rinex" / "GRAS00FRA_R_20223151700_15M_01S_MO.crx.gz"
    got = read_rinex([], [path], 1_352_221_200.0)[1][0]  # 2022-11-11 17:00
    assert got.t_s.tolist() == list(range(900))
    assert_as_it_stands(got, crx2rnx(gzip.decompress(path.read_bytes())).decode())
    names = {s[0] + signal for s, signal in zip(got.satellites, got.signals, strict=True)}
    names -= {"R1C", "R2C", "R1P", "R2P"}
    assert names == {"G1C", "G2W", "G2X", "G5X", "E1X", "E5X", "E7X", "C2I", "C7I"}
    of = np.array(got.satellites)
    tracked = np.isfinite(got.code_m[:, 0]) | np.isfinite(got.phase_cycles[:, 0])
    glonass = {name for name in got.satellites if name[0] == "R"}
    records = sum(tracked[:, of == name].any(axis=1).sum() for name in glonass)
    assert records == 7714  # grep -c ^R of the plain file, less the header
    assert {one.what: one.count for one in got.unused}["SBAS observation"] == 900


def test_dates_agree_with_the_calendar():
    dates = np.arange("1980-01-06", "2079-12-31", 37, dtype="M8[D]")
    heads = [f"> {day} 00 00 00.0000000  0  0\n".replace("-", " ") for day in dates.astype(str)]
    days = (dates - dates[0]).astype(float)
    np.testing.assert_array_equal(read(head_3() + "".join(heads)).t_s + START_GPS_S, 86_400 * days)


@pytest.mark.parametrize(("system", "later_s"), [("GAL", 0), ("QZS", 0), ("BDT", 14), ("GLO", 18)])
def test_other_time_systems_become_gps_time(system, later_s):
    got = read(observation_3(system=system))
    np.testing.assert_allclose(got.t_s, np.arange(4) + later_s, rtol=0, atol=1e-9)


def test_start_with_fraction_and_clock_error_give_nominal_epochs_and_tags():
    got = read(GOOD.replace(".0000000  0", ".0004321  0"), START_GPS_S - 0.25)
    np.testing.assert_allclose(got.t_s, np.arange(4) + 0.25, rtol=0, atol=1e-9)
    np.testing.assert_allclose(got.tag_s[:, 0], got.t_s + 432.1e-6, rtol=0, atol=1e-9)


def test_numbers_may_touch_and_zero_and_blank_are_missing():
    assert GOOD.splitlines()[8].startswith("G05")
    new = "G05" + f"{-123456789.125:14.3f}  " + "          .125  " + "         -.125"
    got = read(with_line(9, new + "\n"))
    m = got.satellites.index("G05")
    row = [getattr(got, name)[0, 0, m] for name in FIELDS[:3]]
    assert row == [-123456789.125, 0.125, -0.125]
    assert np.isnan(got.cn0_dbhz[0, 0, m])
    got = read(with_line(9, "G05" + f"{0:14.3f}  " + " " * 14 + "1 " + f"{5:14.3f}" + "\n"))
    assert [np.isfinite(getattr(got, name)[0, 0, m]) for name in FIELDS[:3]] == [0, 0, 1]
    assert got.lock_flags[0, 0, m] == LOST_LOCK  # without a phase, too


def test_values_are_divided_by_their_scale_factor():
    scale = line("G   10  2 L1C D1C", "SYS / SCALE FACTOR") + line("E    1", "SYS / SCALE FACTOR")
    got, plain = read(head_3(extra=scale) + epoch_3(0)), read(GOOD)
    for satellite, factors in (("G05", (1, 10, 10)), ("E07", (1, 1, np.nan))):
        m = got.satellites.index(satellite)
        for name, factor in zip(FIELDS[:3], factors, strict=True):
            ratio = getattr(plain, name)[0, 0, m] / getattr(got, name)[0, 0, m]
            np.testing.assert_allclose(ratio, factor, rtol=1e-15)


def test_power_failures_and_half_wavelengths_flag_phases():
    got = read(head_3() + epoch_3(0) + epoch_3(2, flag=1) + epoch_3(3))
    assert (got.lock_flags[1] & LOST_LOCK == LOST_LOCK).all()
    assert not got.lock_flags[0].any()
    factors = line("     1     1", "WAVELENGTH FACT L1/2")
    factors += line("     1     2     2   G01   G 3", "WAVELENGTH FACT L1/2")
    got = read(TWO.replace(line("", "END OF HEADER"), factors + line("", "END OF HEADER")))
    pairs = zip(got.satellites, got.signals, got.lock_flags[0, 0] & HALF_CYCLE, strict=True)
    assert {pair[:2] for pair in pairs if pair[2]} == {("G01", "2W"), ("G03", "2W")}


def test_wanted_signals_are_kept_and_no_others():
    got = read(GOOD.replace("C11", "C59"), wanted={"G": ["2W"], "E": ["5X"]})
    pairs = set(zip(got.satellites, got.signals, strict=True))
    assert pairs == {("G05", "2W"), ("G12", "2W"), ("E07", "5X")}
    assert_as_it_stands(got, GOOD)
    unused = {one.what: one.count for one in got.unused}
    assert (unused["G 1C observation"], unused["C59 observation"]) == (8, 4)


def test_a_signal_that_no_file_has_is_refused(tmp_path):
    (tmp_path / "a.rnx").write_text(GOOD)
    text = "key gnss.signals: no E signal 8X was observed; there are C 2I, E 1X, E 5X, G 1C, G 2W, "
    with pytest.raises(BadInputError, match=text):
        read_rinex([], [tmp_path / "a.rnx"], START_GPS_S, {"E": ["8X"]})


BANDS = ("C1", "L1", "D1", "S1", "L5", "C5", "L7", "C7", "L8", "C8", "P1", "C2", "P2", "L2")


def test_rinex_2_names_signals_by_constellation_and_code():
    text = line(f"{'2.11':>9s}{'':11s}{'OBSERVATION DATA':20s}M", "RINEX VERSION / TYPE")
    for k, row in enumerate((BANDS[:9], BANDS[9:])):
        count = f"{len(BANDS):6d}" if k == 0 else " " * 6
        text += line(count + "".join(f"    {name}" for name in row), "# / TYPES OF OBSERV")
    text += line("  2020     6    25     0     0    0.0000000     GPS", "TIME OF FIRST OBS")
    text += line("", "END OF HEADER") + " 20  6 25  0  0  0.0000000  0  3G01E02G03\n"
    for blank in ((), ("P1", "C2", "P2", "L2"), ("C1", "P2", "L5", "C5")):
        row = [" " * 16 if n in blank else f"{2e7 + k:14.3f}  " for k, n in enumerate(BANDS)]
        text += "".join("".join(row[k : k + 5]).rstrip() + "\n" for k in range(0, len(row), 5))
    got = read(text)
    place = {name: 2e7 + k for k, name in enumerate(BANDS)}
    pairs = list(zip(got.satellites, got.signals, strict=True))

    def named(field):
        values = getattr(got, field)[0, 0]
        return {pair: x for pair, x in zip(pairs, values, strict=True) if np.isfinite(x)}

    first = {"1C": "C1", "1W": "P1", "2W": "P2", "2X": "C2", "5X": "C5"}
    third = {"1W": "P1", "2X": "C2"}
    codes = {("G01", signal): place[name] for signal, name in first.items()}
    codes |= {("E02", f"{k}X"): place[f"C{k}"] for k in (1, 5, 7)}
    assert named("code_m") == codes | {("G03", s): place[name] for s, name in third.items()}
    phases = {("G01", "1C"): "L1", ("G01", "2W"): "L2", ("G01", "5X"): "L5", ("G03", "1W"): "L1"}
    phases |= {("G03", "2X"): "L2", **{("E02", f"{k}X"): f"L{k}" for k in (1, 5, 7)}}
    assert named("phase_cycles") == {pair: place[name] for pair, name in phases.items()}
    unused = {one.what: one.count for one in got.unused}
    assert unused == {"E 8X observation": 1, "G 7 observation": 2, "G 8 observation": 2}


LATE = {"> 2020": ">  2020", "\n 20  6 25": "\n  20  6 25"}  # dates a column late
SHORT = {"  0  5\n": "  0 5       -0.123456789012\n", "\n": "  \r\n"}  # no columns filled


@pytest.mark.parametrize("text", [GOOD, TWO], ids=["3", "2"])
@pytest.mark.parametrize("spelling", [LATE, SHORT], ids=["late", "not adjusted"])
def test_spelling_changes_nothing(text, spelling):
    spelt = text
    for old, new in spelling.items():
        spelt = spelt.replace(old, new)
    same(read(spelt), read(text))


@pytest.mark.parametrize("text", [GOOD, TWO], ids=["3", "2"])
@pytest.mark.parametrize("end", ["\n", "  \n\n", "\x1a", "\r\n\x1a\r\n", "\0" * 100])
def test_what_follows_the_last_line_changes_nothing(text, end):
    same(read(text + end), read(text))
    assert read(text + end).unused == ()
    unended = read(text.rstrip())
    same(unended, read(text))
    assert [one.reason for one in unended.unused] == [
        "the last line has no line end: it may be cut"
    ]


def test_a_blank_line_may_be_the_last_of_a_satellite():
    last = TWO.splitlines(keepends=True)[-1]
    got = read(TWO[: -len(last)] + "\n")
    assert (len(got.t_s), got.unused) == (3, ())
    assert np.isnan(got.cn0_dbhz[2, 0, got.satellites.index("G14")])


EVENT_4 = f"> {'':29s}4  1\n" + line("a remark", "COMMENT")
EVENT_6 = epoch_3(2, flag=6, satellites=SATELLITES[:2])
SITE = f"> {'':29s}3  1\n" + line("X", "MARKER NAME")
TYPES = "".join(one for one in head_3().splitlines(keepends=True) if "OBS TYPES" in one)


@pytest.mark.parametrize(
    ("event", "loss"),
    [
        (EVENT_4, {"event 4 record: header lines: not used": 1}),
        (f"> {'':29s}4  4\n" + TYPES, {"event 4 record: header lines: not used": 4}),
        (EVENT_6, {"event 6 record: cycle slip records: not used": 2}),
        (SITE, {"event 3 record: new site: not used": 1}),
        (f"> {'':29s}2  0\n", {"event 2 record: antenna starts to move: not used": 1}),
        (
            "> 2020 06 25 00 00 01.5000000  5  0\n",
            {"event 5 record: external event: not used": 1},
        ),
    ],
)
def test_events_are_passed_over_and_counted(event, loss):
    got = read(head_3() + epoch_3(0) + epoch_3(1) + event + epoch_3(2) + epoch_3(3))
    same(got, read(GOOD))
    assert lost(got) == loss


@pytest.mark.parametrize("label", ["SYS / # / OBS TYPES", "SYS / SCALE FACTOR"])
def test_header_lines_inside_that_change_the_meaning_are_refused(label):
    event = f"> {'':29s}3  1\n" + line("G    1 C1C", label)
    text = r"line 15: header inside the body must not change .*split"
    with pytest.raises(BadInputError, match=text):
        read(head_3() + epoch_3(0) + event + epoch_3(1))


NO_EPOCH = (
    "no epoch begins where one must (date, event flag or number of satellites), line {} first"
)
NAMED = "names a satellite that the header does not, or twice, line {} first"
VALUE = "a value must be a number with three decimals, column {}, line {} first"
COUNT = "announces another number of satellites than it has, line {} first"
CUT = "cut at the end of the file, line {} first"
ORDER = "its time does not increase"
ONE, OTHER = "25  0  0  1.0000000  0 14", "25  0  0  1.0000000  0 {}"
LINES, LINES_2 = (text.splitlines(keepends=True) for text in (GOOD, TWO))


@pytest.mark.parametrize(
    ("text", "epochs", "rule"),
    [
        (with_line(8, "x" + LINES[7][1:]), [1, 2, 3], NO_EPOCH.format(8)),
        (with_line(8, "> 2020\n"), [1, 2, 3], NO_EPOCH.format(8)),
        (GOOD.replace("2020 06 25 00 00  0", "2020 06 31 00 00  0"), [1, 2, 3], NO_EPOCH.format(8)),
        (GOOD.replace("00 00  2.0", "00 0x  2.0"), [0, 1, 3], NO_EPOCH.format(20)),
        (GOOD.replace("00  3.0", "00  1.5"), [0, 1, 2], ORDER),
        (GOOD.replace("00 00  0.0", "00 59  0.0"), [1, 2, 3], ORDER),
        (GOOD.replace("E07", "Z07", 1), [1, 2, 3], NAMED.format(11)),
        (GOOD.replace("E07", "Exx", 1), [1, 2, 3], NAMED.format(11)),
        (GOOD.replace("G12", "G05", 1), [1, 2, 3], NAMED.format(10)),
        (GOOD.replace("21000000.125", "2100000O.125", 1), [1, 2, 3], VALUE.format(4, 9)),
        (GOOD.replace("21000000.125", "21000000,125", 1), [1, 2, 3], VALUE.format(4, 9)),
        (GOOD.replace("21000000.125 7", "21000000.125x7", 1), [1, 2, 3], VALUE.format(4, 9)),
        (with_line(9, "G05" + f"{1:14.3f}  " * 9 + "\n"), [1, 2, 3], VALUE.format(132, 9)),
        (with_line(9, "G05     20000000.1\n"), [1, 2, 3], VALUE.format(4, 9)),
        (GOOD.replace("1.0000000  0  5", "1.0000000  0  6"), [0, 2, 3], COUNT.format(20)),
        (GOOD.replace("1.0000000  0  5", "1.0000000  0  4"), [0, 2, 3], COUNT.format(19)),
        ("".join(LINES[:-1]), [0, 1, 2], CUT.format(31)),
        (GOOD[:-5], [0, 1, 2], CUT.format(31)),
        (TWO.replace("  0 14G01", "  x 14G01", 1), [1, 2], NO_EPOCH.format(5)),
        (TWO.replace("22000000.000", "22000000x000", 1), [1, 2], VALUE.format(1, 7)),
        (TWO.replace("G13", "G12", 1), [1, 2], NAMED.format(31)),
        (TWO.replace(ONE, OTHER.format(13)), [0, 2], COUNT.format(63)),
        (TWO.replace(ONE, OTHER.format(15)), [0, 2], COUNT.format(65)),
        ("".join(LINES_2[:-1]), [0, 1], CUT.format(94)),
        (TWO[: TWO.index(" 20  6 25  0  0  2") + 40], [0, 1], CUT.format(66)),
    ],
)  # fmt: skip
def test_epochs_that_break_a_rule_are_counted_with_it(text, epochs, rule):
    got = read(text)
    assert got.t_s.tolist() == epochs
    assert lost(got) == {f"a.rnx epoch: {rule}": 1}


def test_an_epoch_without_satellites_is_one_of_gaps_and_a_file_without_epochs_is_named():
    got = read(head_3() + epoch_3(0) + epoch_3(1, satellites=()) + epoch_3(2))
    assert got.t_s.tolist() == [0, 1, 2]
    assert np.isnan(got.code_m[1]).all()
    with pytest.raises(BadInputError, match=r"a.rnx: must hold an epoch, has none after its"):
        read(head_3())
    with pytest.raises(BadInputError, match="must hold an epoch, cut at the end"):
        read(GOOD[: GOOD.index("\n>") + 200])


@pytest.mark.parametrize(
    ("interval", "epochs", "count"),
    [("     0.500", 1, 18), ("     1.000", 1, 9), ("          ", 1, 1), ("  -1", 4, 6)],
)
def test_a_header_that_announces_a_later_end_is_a_counted_loss(interval, epochs, count):
    last = line("  2020     6    25     0     0    9.0000000     GPS", "TIME OF LAST OBS")
    text = head_3(extra=last + line(interval, "INTERVAL"))
    got = read(text + "".join(epoch_3(k) for k in range(epochs)))
    assert lost(got) == {
        "a.rnx epoch: the header announces a later end: the file may be cut": count
    }
