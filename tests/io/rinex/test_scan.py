"""The strict reading of observation files."""

from pathlib import Path

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import read_header
from fgnav.io.rinex.kernels import days
from fgnav.io.rinex.scan import scan_observations
from fgnav.io.signal_choice import choose_signals
from tests.io.rinex_texts import SATELLITES, epoch_3, head_3, line, observation_2, observation_3

PATH = Path("a.rnx")
GOOD = observation_3()


def scan(text):
    content = np.frombuffer(text.encode("latin-1"), np.uint8)
    header = read_header(PATH, content, "observations")
    return scan_observations(header, content, choose_signals([header])[0])


def counts(got, letter):
    """Return how many values a constellation has, by carrier and quantity."""
    return (got.values[got.records[:, 1] == ord(letter)] != 0).sum(axis=0)


def lines_with(number: int, new: str, text: str = GOOD) -> str:
    """Return the text with one line replaced, counted from 1."""
    lines = text.splitlines(keepends=True)
    lines[number - 1] = new
    return "".join(lines)


def test_days_agree_with_the_calendar():
    dates = np.arange("1980-01-06", "2100-01-01", 37, dtype="M8[D]")
    for date in dates.tolist():
        assert days(date.year, date.month, date.day) == (date - dates[0].item()).days
    assert days(2021, 2, 29) == days(2020, 13, 1) == days(1979, 12, 31) == -1


def test_epochs_and_values_are_counted():
    got = scan(GOOD)
    assert (np.diff(got.ticks) == 10_000_000).all()
    assert np.bincount(got.records[:, 0]).tolist() == [5, 5, 5, 5]
    assert counts(got, "E")[0, 0] == 4
    assert counts(got, "G")[0, 1] == 8
    assert got.locks[got.records[:, 1] == ord("G"), 0].sum() == 2  # one slip each
    assert got.losses == ()


def test_values_are_those_of_the_numbers():
    got = scan(GOOD)
    values = [2.1e7 + 1e5 * s + 100 * k + 0.125 for k in range(4) for s in (0, 1)]
    assert got.values[got.records[:, 1] == ord("G"), 0, 0].tolist() == values


def test_rinex_2_with_continued_satellites_and_records_is_counted():
    got = scan(observation_2(epochs=3, satellites=30))
    assert np.bincount(got.records[:, 0]).tolist() == [30, 30, 30]
    assert counts(got, "G")[:2].tolist() == [[90] * 4, [90, 90, 0, 0]]


def test_numbers_may_touch_and_lack_their_leading_zero():
    old = GOOD.splitlines()[8]
    assert old.startswith("G05")
    new = "G05" + f"{-123456789.125:14.3f}  " + "          .125  " + "         -.125"
    got = scan(lines_with(9, new + "\n"))
    assert got.values[0, 0].tolist() == [-123456789.125, 0.125, -0.125, 0]


def test_zero_and_blank_count_as_missing():
    got = scan(lines_with(9, "G05" + f"{0:14.3f}  " + " " * 16 + f"{5:14.3f}" + "\n"))
    assert counts(got, "G")[0, :3].tolist() == [7, 7, 8]


def test_satellites_of_other_numbers_are_lost_by_name():
    text = GOOD.replace("C11", "C59")
    got = scan(text)
    assert ("C59 observation", 4) in [(loss.what, loss.count) for loss in got.losses]
    assert np.bincount(got.records[:, 0]).tolist() == [4, 4, 4, 4]


def test_carriage_returns_and_trailing_blanks_do_not_matter():
    text = GOOD.replace("\n", "  \r\n")
    np.testing.assert_array_equal(scan(text).values, scan(GOOD).values)


def test_header_that_announces_a_later_end_is_a_counted_loss():
    last = line("  2020     6    25     0     0    9.0000000     GPS", "TIME OF LAST OBS")
    text = head_3(extra=last) + "".join(epoch_3(k) for k in range(4))
    loss = scan(text).losses[-1]
    assert (loss.what, loss.count) == ("a.rnx epoch", 6)
    assert "may be cut" in loss.reason


@pytest.mark.parametrize(
    ("interval", "count"), [("     0.500", 18), ("     1.000", 9), ("          ", 1), ("  -1", 1)]
)
def test_a_file_cut_after_its_first_epoch_counts_its_loss_by_its_interval(interval, count):
    last = line("  2020     6    25     0     0    9.0000000     GPS", "TIME OF LAST OBS")
    text = head_3(extra=last + line(interval, "INTERVAL")) + epoch_3(0)
    assert [loss.count for loss in scan(text).losses if loss.what == "a.rnx epoch"] == [count]


def test_power_failure_is_noted():
    text = head_3() + epoch_3(0) + epoch_3(1, flag=1)
    assert scan(text).power_failure.tolist() == [False, True]


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
    got = scan(head_3() + epoch_3(0) + epoch_3(1) + event + epoch_3(3))
    assert len(got.ticks) == 3
    assert (what, count) in [(loss.what, loss.count) for loss in got.losses]


def test_events_of_rinex_2_are_passed_over():
    text = observation_2()
    body = text.index(" 20  6 25  0  0  1")
    event = f"{'':28s}4  1\n" + line("a remark", "COMMENT")
    got = scan(text[:body] + event + text[body:])
    assert len(got.ticks) == 3
    assert got.losses[0].what == "event 4 record"


@pytest.mark.parametrize("label", ["MARKER NAME", "ANTENNA: DELTA H/E/N", "APPROX POSITION XYZ"])
def test_a_new_site_in_a_kinematic_file_is_counted(label):
    event = f"> {'':29s}3  1\n" + line("X", label)
    got = scan(head_3() + epoch_3(0) + event + epoch_3(1))
    assert len(got.ticks) == 2
    assert [(one.what, one.reason) for one in got.losses] == [
        ("event 3 record", "new site: not used")
    ]


def test_header_lines_inside_may_repeat_the_types():
    types = "".join(one for one in head_3().splitlines(keepends=True) if "OBS TYPES" in one)
    event = f"> {'':29s}4  {types.count(chr(10))}\n" + types
    assert len(scan(head_3() + epoch_3(0) + event + epoch_3(1)).ticks) == 2


@pytest.mark.parametrize("label", ["SYS / # / OBS TYPES", "SYS / SCALE FACTOR"])
def test_header_lines_inside_that_change_the_meaning_are_refused(label):
    event = f"> {'':29s}3  1\n" + line("G    1 C1C", label)
    with pytest.raises(
        BadInputError, match=r"line 15: header inside the body must not change .*split"
    ):
        scan(head_3() + epoch_3(0) + event + epoch_3(1))


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        (
            lines_with(8, "x" + GOOD.splitlines()[7][1:] + "\n"),
            "line 8: an epoch line must start with '>'",
        ),
        (lines_with(8, "> 2020\n"), "line 8: an epoch line must start with '>'"),
        (
            GOOD.replace("2020 06 25 00 00  0", "2020 06 31 00 00  0"),
            "line 8: epoch line is malformed",
        ),
        (GOOD.replace("00 00  2.0", "00 0x  2.0"), "line 20: epoch line is malformed"),
        (GOOD.replace("2.0000000  0", "2.0000000  8"), "line 20: epoch line is malformed"),
        (GOOD.replace("2.0000000  0  5", "2.0000000  0   "), "line 20: epoch line is malformed"),
        (GOOD.replace("00  3.0", "00  1.5"), "line 26: time must increase from epoch to epoch"),
        (
            GOOD.replace("E07", "Z07", 1),
            "line 11: satellite must be of a constellation in the header",
        ),
        (
            GOOD.replace("E07", "Exx", 1),
            "line 11: satellite must be of a constellation in the header",
        ),
        (
            GOOD.replace("E07", "S07", 1),
            "line 11: satellite must be of a constellation in the header",
        ),
        (GOOD.replace("G12", "G05", 1), "line 10: satellite appears twice in one epoch"),
        (
            GOOD.replace("21000000.125", "2100000O.125", 1),
            "line 9: column 4: value must be a number",
        ),
        (
            GOOD.replace("21000000.125", "21000000,125", 1),
            "line 9: column 4: value must be a number",
        ),
        (
            GOOD.replace("21000000.125", "2100000.1250", 1),
            "line 9: column 4: value must be a number",
        ),
        (
            GOOD.replace("21000000.125", "210 0000.125", 1),
            "line 9: column 4: value must be a number",
        ),
        (GOOD.replace("21000000.125 7", "21000000.125x7", 1), "line 9: column 18: value"),
        (GOOD.replace("21000000.125 7", "21000000.125 x", 1), "line 9: column 19: value"),
        (lines_with(9, "G05" + f"{1:14.3f}  " * 9 + "\n"), "line 9: column 132: value"),
        (lines_with(9, "G05     20000000.1\n"), "line 9: column 4: value must be a number"),
        (head_3(), "a.rnx: must hold an epoch, has none after its header"),
    ],
)
def test_faults_are_named_with_line_rule_and_value(text, rule):
    with pytest.raises(BadInputError, match=rule):
        scan(text)


TWO = observation_2()


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        (TWO.replace("20  6 25  0  0  1", "20 16 25  0  0  1"), "epoch line is malformed"),
        (TWO.replace("  0 14G01", "  x 14G01", 1), "line 5: epoch line is malformed"),
        (TWO.replace("0  0  2.0", "0  0  0.5"), "time must increase"),
        (TWO.replace("G13", "G1x", 1), "satellite must be of a constellation"),
        (
            TWO.replace(" " * 32 + "G13", "x" + " " * 31 + "G13", 1),
            "satellite must be of a constellation",
        ),
        (TWO.replace("G13", "G12", 1), "satellite appears twice"),
        (TWO.replace("22000000.000", "22000000x000", 1), "line 7: column 1: value must be"),
    ],
)
def test_faults_of_rinex_2_are_named(text, rule):
    with pytest.raises(BadInputError, match=rule):
        scan(text)


def without_last_line(text):
    return "".join(text.splitlines(keepends=True)[:-1])


COUNT = "a.rnx epoch: announces another number of satellites than it has, line {} first"
CUT = "a.rnx epoch: cut at the end of the file, line {}"
ONE, OTHER = "25  0  0  1.0000000  0 14", "25  0  0  1.0000000  0 {}"


@pytest.mark.parametrize(
    ("text", "epochs", "loss"),
    [
        (GOOD.replace("1.0000000  0  5", "1.0000000  0  6"), [0, 2, 3], COUNT.format(20)),
        (GOOD.replace("1.0000000  0  5", "1.0000000  0  4"), [0, 2, 3], COUNT.format(19)),
        (without_last_line(GOOD), [0, 1, 2], CUT.format(31)),
        (GOOD[:-5], [0, 1, 2], CUT.format(31)),
        (TWO.replace(ONE, OTHER.format(13)), [0, 2], COUNT.format(63)),
        (TWO.replace(ONE, OTHER.format(15)), [0, 2], COUNT.format(35)),
        (without_last_line(TWO), [0, 1], CUT.format(94)),
        (TWO[: TWO.index(" 20  6 25  0  0  2") + 40], [0, 1], CUT.format(65)),
    ],
)
def test_epochs_that_are_not_whole_are_left_out_and_counted(text, epochs, loss):
    got = scan(text)
    assert (got.ticks / 1e7 - 1_277_078_400).tolist() == epochs
    assert {f"{one.what}: {one.reason}": one.count for one in got.losses} == {loss: 1}


@pytest.mark.parametrize("text", [GOOD, TWO])
@pytest.mark.parametrize("end", ["\n", "  \n\n", "\x1a", "\r\n\x1a\r\n", "\0" * 100])
def test_what_follows_the_last_line_changes_nothing(text, end):
    got = scan(text + end)
    np.testing.assert_array_equal(got.values, scan(text).values)
    assert got.losses == ()


@pytest.mark.parametrize("text", [GOOD, TWO])
def test_a_missing_line_end_is_noted(text):
    got = scan(text.rstrip())
    np.testing.assert_array_equal(got.values, scan(text).values)
    assert [one.reason for one in got.losses] == ["the last line has no line end: it may be cut"]


def test_values_are_divided_by_their_scale_factor():
    scale = line("G   10  2 L1C D1C", "SYS / SCALE FACTOR")
    got = scan(head_3(extra=scale) + epoch_3(0)).values[0, 0]
    np.testing.assert_allclose(got / scan(GOOD).values[0, 0], [1, 0.1, 0.1, 1], rtol=1e-15)


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
    got = scan(text)
    names = [[got.names[k] for k in row] for row in got.signals.tolist()]
    assert names == [["1C", "2W", "5X"], ["1X", "7X", "5X"], ["1W", "2X", "5X"]]
    place = {name: 2e7 + k for k, name in enumerate(BANDS)}
    assert got.values[1, :, 0].tolist() == [place[name] for name in ("C1", "C7", "C5")]
    assert got.values[1, :, 1].tolist() == [place[name] for name in ("L1", "L7", "L5")]
    assert got.values[2, :2, 0].tolist() == [place["P1"], place["C2"]]
    assert {one.what: one.count for one in got.losses} == {
        "E 8X observation": 1,
        "G 7 observation": 2,
        "G 8 observation": 2,
        "second code of a carrier": 2,
    }
