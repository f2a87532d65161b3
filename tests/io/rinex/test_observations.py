"""Whole epochs are read, the others counted with their rule and first line."""

from pathlib import Path

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import read_header
from fgnav.io.rinex.observations import to_observations
from fgnav.types.observations import HALF_CYCLE
from tests.io.rinex_texts import SATELLITES, epoch_3, head_3, line, observation_2, observation_3

PATH = Path("a.rnx")
START_GPS_S = 1_277_078_400.0
GOOD = observation_3()


def read(text):
    """Return the observations of one antenna."""
    content = np.frombuffer(text.encode("latin-1"), np.uint8)
    header = read_header(PATH, content, "observations")
    return to_observations(header, content, START_GPS_S, {})


def lost(got):
    return {f"{one.what}: {one.reason}": one.count for one in got.losses}


def values(got, letter, quantity):
    """Return how many values a constellation has, by signal."""
    counts = {}
    for satellite, signal, count in zip(
        got.satellites,
        got.signals,
        np.isfinite(getattr(got, quantity)).sum(axis=(0, 1)),
        strict=True,
    ):
        if satellite[0] == letter:
            counts[signal] = counts.get(signal, 0) + int(count)
    return counts


def lines_with(number: int, new: str, text: str = GOOD) -> str:
    """Return the text with one line replaced, counted from 1."""
    lines = text.splitlines(keepends=True)
    lines[number - 1] = new
    return "".join(lines)


def test_dates_agree_with_the_calendar():
    dates = np.arange("1980-01-06", "2079-12-31", 37, dtype="M8[D]")
    heads = [f"> {day} 00 00 00.0000000  0  0" for day in dates.astype(str)]
    text = head_3() + "".join(f"{head.replace('-', ' ')}\n" for head in heads)
    np.testing.assert_array_equal(
        read(text).t_s + START_GPS_S, 86_400.0 * (dates - dates[0]).astype(float)
    )


def test_numbers_may_touch_and_lack_their_leading_zero():
    assert GOOD.splitlines()[8].startswith("G05")
    new = "G05" + f"{-123456789.125:14.3f}  " + "          .125  " + "         -.125"
    got = read(lines_with(9, new + "\n"))
    m = got.satellites.index("G05")
    row = [got.code_m[0, 0, m], got.phase_cycles[0, 0, m], got.doppler_hz[0, 0, m]]
    assert row == [-123456789.125, 0.125, -0.125]
    assert np.isnan(got.cn0_dbhz[0, 0, m])


def test_zero_and_blank_count_as_missing():
    got = read(lines_with(9, "G05" + f"{0:14.3f}  " + " " * 16 + f"{5:14.3f}" + "\n"))
    assert [values(got, "G", name)["1C"] for name in ("code_m", "phase_cycles", "doppler_hz")] == [
        *(7, 7, 8)
    ]


def test_carriage_returns_and_trailing_blanks_do_not_matter():
    np.testing.assert_array_equal(read(GOOD.replace("\n", "  \r\n")).code_m, read(GOOD).code_m)


def test_header_that_announces_a_later_end_is_a_counted_loss():
    last = line("  2020     6    25     0     0    9.0000000     GPS", "TIME OF LAST OBS")
    text = head_3(extra=last) + "".join(epoch_3(k) for k in range(4))
    loss = read(text).losses[-1]
    assert (loss.what, loss.count) == ("a.rnx epoch", 6)
    assert "may be cut" in loss.reason


EVENT_4 = f"> {'':29s}4  1\n" + line("a remark", "COMMENT")
EVENT_6 = epoch_3(2, flag=6, satellites=SATELLITES[:2])


@pytest.mark.parametrize(
    ("event", "what", "count"),
    [
        (EVENT_4, "event 4 record", 1),
        (EVENT_6, "event 6 record", 2),
        (f"> {'':29s}2  0\n", "event 2 record", 1),
        ("> 2020 06 25 00 00 01.5000000  5  0\n", "event 5 record", 1),
    ],
)
def test_events_are_passed_over_and_counted(event, what, count):
    got = read(head_3() + epoch_3(0) + epoch_3(1) + event + epoch_3(3))
    assert len(got.t_s) == 3
    assert (what, count) in [(loss.what, loss.count) for loss in got.losses]


def test_numbers_of_epochs_that_are_not_adjusted_are_read():
    for old, new in (("  0  5\n", "  0 5\n"), ("  0  5\n", "  0 5       -0.123456789012\n")):
        np.testing.assert_array_equal(read(GOOD.replace(old, new)).code_m, read(GOOD).code_m)


def test_phases_of_half_wavelengths_have_half_cycles():
    factors = line("     1     1", "WAVELENGTH FACT L1/2")
    factors += line("     1     2     2   G01   G 3", "WAVELENGTH FACT L1/2")
    got = read(TWO.replace(line("", "END OF HEADER"), factors + line("", "END OF HEADER")))
    flags = dict(
        zip(zip(got.satellites, got.signals, strict=True), got.lock_flags[0, 0], strict=True)
    )
    assert {pair for pair, flag in flags.items() if flag & HALF_CYCLE} == {
        *(("G01", "2W"), ("G03", "2W"))
    }


def test_header_lines_inside_may_repeat_the_types():
    types = "".join(one for one in head_3().splitlines(keepends=True) if "OBS TYPES" in one)
    event = f"> {'':29s}4  {types.count(chr(10))}\n" + types
    assert len(read(head_3() + epoch_3(0) + event + epoch_3(1)).t_s) == 2


@pytest.mark.parametrize("label", ["SYS / # / OBS TYPES", "SYS / SCALE FACTOR"])
def test_header_lines_inside_that_change_the_meaning_are_refused(label):
    event = f"> {'':29s}3  1\n" + line("G    1 C1C", label)
    with pytest.raises(
        BadInputError, match=r"line 15: header inside the body must not change .*split"
    ):
        read(head_3() + epoch_3(0) + event + epoch_3(1))


NO_EPOCH = (
    "no epoch begins where one must (date, event flag or number of satellites), line {} first"
)
NAMED = "names a satellite that the header does not, or twice, line {} first"
VALUE = "a value must be a number with three decimals, column {}, line {} first"
TWO = observation_2()


@pytest.mark.parametrize(
    ("text", "epochs", "rule"),
    [
        (lines_with(8, "x" + GOOD.splitlines()[7][1:] + "\n"), [1, 2, 3], NO_EPOCH.format(8)),
        (lines_with(8, "> 2020\n"), [1, 2, 3], NO_EPOCH.format(8)),
        (GOOD.replace("2020 06 25 00 00  0", "2020 06 31 00 00  0"), [1, 2, 3], NO_EPOCH.format(8)),
        (GOOD.replace("00 00  2.0", "00 0x  2.0"), [0, 1, 3], NO_EPOCH.format(20)),
        (GOOD.replace("00  3.0", "00  1.5"), [0, 1, 2], "its time does not increase"),
        (GOOD.replace("00 00  0.0", "00 59  0.0"), [1, 2, 3], "its time does not increase"),
        (GOOD.replace("E07", "Z07", 1), [1, 2, 3], NAMED.format(11)),
        (GOOD.replace("E07", "Exx", 1), [1, 2, 3], NAMED.format(11)),
        (GOOD.replace("G12", "G05", 1), [1, 2, 3], NAMED.format(10)),
        (GOOD.replace("21000000.125", "2100000O.125", 1), [1, 2, 3], VALUE.format(4, 9)),
        (GOOD.replace("21000000.125", "21000000,125", 1), [1, 2, 3], VALUE.format(4, 9)),
        (GOOD.replace("21000000.125 7", "21000000.125x7", 1), [1, 2, 3], VALUE.format(4, 9)),
        (lines_with(9, "G05" + f"{1:14.3f}  " * 9 + "\n"), [1, 2, 3], VALUE.format(132, 9)),
        (lines_with(9, "G05     20000000.1\n"), [1, 2, 3], VALUE.format(4, 9)),
        (TWO.replace("  0 14G01", "  x 14G01", 1), [1, 2], NO_EPOCH.format(5)),
        (TWO.replace("22000000.000", "22000000x000", 1), [1, 2], VALUE.format(1, 7)),
        (TWO.replace("G13", "G12", 1), [1, 2], NAMED.format(31)),
    ],
)  # fmt: skip
def test_epochs_that_break_a_rule_are_counted_with_it(text, epochs, rule):
    got = read(text)
    assert got.t_s.tolist() == epochs
    assert lost(got) == {f"a.rnx epoch: {rule}": 1}


def test_a_file_without_a_whole_epoch_is_named():
    with pytest.raises(BadInputError, match=r"a.rnx: must hold an epoch, has none after its"):
        read(head_3())
    with pytest.raises(BadInputError, match="must hold an epoch, cut at the end"):
        read(GOOD[: GOOD.index("\n>") + 200])


@pytest.mark.parametrize("text", [GOOD, TWO])
def test_dates_may_stand_a_column_late(text):
    late = text.replace("> 2020", ">  2020").replace("\n 20  6 25", "\n  20  6 25")
    got = read(late)
    assert got.losses == ()
    np.testing.assert_array_equal(got.code_m, read(text).code_m)
    np.testing.assert_array_equal(got.t_s, read(text).t_s)


def without_last_line(text):
    return "".join(text.splitlines(keepends=True)[:-1])


COUNT = "a.rnx epoch: announces another number of satellites than it has, line {} first"
CUT = "a.rnx epoch: cut at the end of the file, line {} first"
ONE, OTHER = "25  0  0  1.0000000  0 14", "25  0  0  1.0000000  0 {}"


@pytest.mark.parametrize(
    ("text", "epochs", "loss"),
    [
        (GOOD.replace("1.0000000  0  5", "1.0000000  0  6"), [0, 2, 3], COUNT.format(20)),
        (GOOD.replace("1.0000000  0  5", "1.0000000  0  4"), [0, 2, 3], COUNT.format(19)),
        (without_last_line(GOOD), [0, 1, 2], CUT.format(31)),
        (GOOD[:-5], [0, 1, 2], CUT.format(31)),
        (TWO.replace(ONE, OTHER.format(13)), [0, 2], COUNT.format(63)),
        (TWO.replace(ONE, OTHER.format(15)), [0, 2], COUNT.format(65)),
        (without_last_line(TWO), [0, 1], CUT.format(94)),
        (TWO[: TWO.index(" 20  6 25  0  0  2") + 40], [0, 1], CUT.format(66)),
    ],
)
def test_epochs_that_are_not_whole_are_left_out_and_counted(text, epochs, loss):
    got = read(text)
    assert got.t_s.tolist() == epochs
    assert lost(got) == {loss: 1}


@pytest.mark.parametrize("text", [GOOD, TWO])
@pytest.mark.parametrize("end", ["\n", "  \n\n", "\x1a", "\r\n\x1a\r\n", "\0" * 100])
def test_what_follows_the_last_line_changes_nothing(text, end):
    got = read(text + end)
    np.testing.assert_array_equal(got.code_m, read(text).code_m)
    assert got.losses == ()


def test_a_blank_line_may_be_the_last_of_a_satellite():
    last = TWO.splitlines(keepends=True)[-1]
    got = read(TWO[: -len(last)] + "\n")
    assert got.losses == ()
    assert len(got.t_s) == 3
    assert np.isnan(got.cn0_dbhz[2, 0, got.satellites.index("G14")])


@pytest.mark.parametrize("text", [GOOD, TWO])
def test_a_missing_line_end_is_noted(text):
    got = read(text.rstrip())
    np.testing.assert_array_equal(got.code_m, read(text).code_m)
    assert [one.reason for one in got.losses] == ["the last line has no line end: it may be cut"]


def test_values_are_divided_by_their_scale_factor():
    scale = line("G   10  2 L1C D1C", "SYS / SCALE FACTOR")
    scale += line("E    1", "SYS / SCALE FACTOR")
    got, plain = read(head_3(extra=scale) + epoch_3(0)), read(GOOD)
    for name, factor in (("code_m", 1), ("phase_cycles", 10), ("doppler_hz", 10)):
        m = got.satellites.index("G05")
        ratio = getattr(plain, name)[0, 0, m] / getattr(got, name)[0, 0, m]
        np.testing.assert_allclose(ratio, factor, rtol=1e-15)
    m = got.satellites.index("E07")
    assert got.phase_cycles[0, 0, m] == plain.phase_cycles[0, 0, m]


BANDS = ("C1", "L1", "D1", "S1", "L5", "C5", "L7", "C7", "L8", "C8", "P1", "C2", "P2", "L2")


def test_rinex_2_names_signals_by_constellation_and_code():
    text = line(f"{'2.11':>9s}{'':11s}{'OBSERVATION DATA':20s}M", "RINEX VERSION / TYPE")
    rows = [BANDS[:9], BANDS[9:]]
    for k, row in enumerate(rows):
        count = f"{len(BANDS):6d}" if k == 0 else " " * 6
        text += line(count + "".join(f"    {name}" for name in row), "# / TYPES OF OBSERV")
    text += line("  2020     6    25     0     0    0.0000000     GPS", "TIME OF FIRST OBS")
    text += line("", "END OF HEADER") + " 20  6 25  0  0  0.0000000  0  3G01E02G03\n"
    for blank in ((), ("P1", "C2", "P2", "L2"), ("C1", "P2", "L5", "C5")):
        fields = [
            " " * 16 if name in blank else f"{2e7 + k:14.3f}  " for k, name in enumerate(BANDS)
        ]
        text += "".join(
            "".join(fields[k : k + 5]).rstrip() + "\n" for k in range(0, len(fields), 5)
        )
    got = read(text)
    place = {name: 2e7 + k for k, name in enumerate(BANDS)}
    code = {
        (satellite, signal): got.code_m[0, 0, m]
        for m, (satellite, signal) in enumerate(zip(got.satellites, got.signals, strict=True))
        if np.isfinite(got.code_m[0, 0, m])
    }
    assert code == {
        ("G01", "1C"): place["C1"],
        ("G01", "2W"): place["P2"],
        ("G01", "5X"): place["C5"],
        ("E02", "1X"): place["C1"],
        ("E02", "7X"): place["C7"],
        ("E02", "5X"): place["C5"],
        **{(one, "1W"): place["P1"] for one in ("G01", "G03")},
        **{(one, "2X"): place["C2"] for one in ("G01", "G03")},
    }
    phases = {
        pair: got.phase_cycles[0, 0, m]
        for m, pair in enumerate(zip(got.satellites, got.signals, strict=True))
    }
    assert phases["E02", "1X"] == phases["G01", "1C"] == phases["G03", "1W"] == place["L1"]
    assert phases["G01", "2W"] == phases["G03", "2X"] == place["L2"]
    assert np.isnan([phases["G01", "1W"], phases["G01", "2X"]]).all()
    assert {one.what: one.count for one in got.losses} == {
        "E 8X observation": 1,
        "G 7 observation": 2,
        "G 8 observation": 2,
    }
