"""The strict check of observation files, without RTKLIB."""

from pathlib import Path

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import read_header
from fgnav.io.rinex.kernels import days
from fgnav.io.rinex.scan import scan_observations
from tests.io.rinex_texts import SATELLITES, epoch_3, head_3, line, observation_2, observation_3

PATH = Path("a.rnx")
GOOD = observation_3()


def scan(text: str):
    content = np.frombuffer(text.encode("latin-1"), np.uint8)
    return scan_observations(read_header(PATH, content, "observations"), content)


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
    assert got.kept.tolist() == [5, 5, 5, 5]
    assert got.tally[ord("E"), 0, 0] == 4
    assert got.tally[ord("G"), 1].tolist()[::2] == [8, 2]  # phases of two satellites, one slip each
    assert got.losses == ()


def test_sums_are_those_of_the_numbers():
    got = scan(GOOD)
    values = [2.1e7 + 1e5 * s + 100 * k + 0.125 for s in (0, 1) for k in range(4)]
    assert got.tally[ord("G"), 0, 1] == round(sum(values) * 1000)


def test_rinex_2_with_continued_satellites_and_records_is_counted():
    got = scan(observation_2(epochs=3, satellites=30))
    assert got.kept.tolist() == [30, 30, 30]
    assert got.tally[ord("G"), :6, 0].tolist() == [90] * 6


def test_numbers_may_touch_and_lack_their_leading_zero():
    old = GOOD.splitlines()[8]
    assert old.startswith("G05")
    new = "G05" + f"{-123456789.125:14.3f}  " + "          .125  " + "         -.125"
    got = scan(lines_with(9, new + "\n"))
    before = scan(GOOD).tally[ord("G"), 2, 1]
    assert got.tally[ord("G"), 2].tolist()[:2] == [8, before + 2_099_875 - 125]


def test_zero_and_blank_count_as_missing():
    got = scan(lines_with(9, "G05" + f"{0:14.3f}  " + " " * 16 + f"{5:14.3f}" + "\n"))
    assert got.tally[ord("G"), :3, 0].tolist() == [7, 7, 8]


def test_satellites_that_rtklib_does_not_know_are_lost_by_name():
    text = GOOD.replace("C11", "C59")
    got = scan(text)
    assert ("C59 observation", 4) in [(loss.what, loss.count) for loss in got.losses]
    assert got.kept.tolist() == [4, 4, 4, 4]


def test_carriage_returns_and_trailing_blanks_do_not_matter():
    text = GOOD.replace("\n", "  \r\n")
    np.testing.assert_array_equal(scan(text).tally, scan(GOOD).tally)


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
    assert len(got.events) == 1
    start, end = got.events[0]
    assert (head_3() + epoch_3(0) + epoch_3(1) + event + epoch_3(3))[start:end] == event
    assert (what, count) in [(loss.what, loss.count) for loss in got.losses]


def test_events_of_rinex_2_are_passed_over():
    text = observation_2()
    body = text.index(" 20  6 25  0  0  1")
    event = f"{'':28s}4  1\n" + line("a remark", "COMMENT")
    got = scan(text[:body] + event + text[body:])
    assert len(got.ticks) == 3
    assert got.losses[0].what == "event 4 record"


@pytest.mark.parametrize("label", ["SYS / # / OBS TYPES", "MARKER NAME", "ANTENNA: DELTA H/E/N"])
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
        (GOOD.replace("1.0000000  0  5", "1.0000000  0  6"), "line 20: the epoch ends after 5"),
        (GOOD.replace("1.0000000  0  5", "1.0000000  0  4"), "line 19: an epoch line must start"),
        ("".join(GOOD.splitlines(keepends=True)[:-1]), "the epoch ends after 4 .*is truncated"),
        (GOOD[:-3], "the last line is cut, it has no line end, got 'R03.*fetch the file again"),
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
        ("".join(TWO.splitlines(keepends=True)[:-1]), "the epoch ends after 13"),
        (TWO[:-2], "the last line is cut"),
    ],
)
def test_faults_of_rinex_2_are_named(text, rule):
    with pytest.raises(BadInputError, match=rule):
        scan(text)
