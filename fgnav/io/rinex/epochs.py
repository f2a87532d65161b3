"""Where the epochs, events and satellites of a RINEX observation file stand in its text.

An epoch that breaks a rule is left out; reading goes on at the next line that begins one.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from fgnav.checks import BoolArray, IntArray
from fgnav.io.gps_time import GPS_EPOCH, TICKS_PER_S
from fgnav.io.rinex.text import Bytes

# Rules that an epoch may break.
NO_EPOCH, COUNT, CUT, SATELLITE, VALUE = range(1, 6)
PADDING = 64  # blanks behind a body's text
_BLANK, _DOT, _ZERO, _GREATER = (ord(c) for c in " .0>")
_HEAD = 40  # columns that the beginning of an epoch takes
_NAMES, _FIELDS = 12, 5  # satellites that a line of RINEX 2 names, values that it holds
# Lines that seem to begin an epoch or event: ``ticks`` of 1e-7 s since 1980-01-06, -1 of no date;
# ``announced`` satellites or records; ``shift`` of columns that the satellites stand late.
_COLUMNS = ("line", "ticks", "flag", "announced", "shift", "is_valid")
_MARK = np.dtype([(name, np.int64) for name in _COLUMNS])


class Fault(NamedTuple):
    """A rule that an epoch breaks, the line, from 0 on, and the column where it does."""

    rule: int
    line: int
    column: int = 0


class Event(NamedTuple):
    """What is no epoch: its flag, announced records, its line and the line after."""

    flag: int
    announced: int
    line: int
    after: int


@dataclass(frozen=True, eq=False, slots=True)
class Body:
    """The text behind a header, by its lines."""

    text: Bytes  # with blanks behind it
    begins: IntArray  # of lines
    ends: IntArray  # without the blanks that end them
    types: int  # of observations, of a satellite of RINEX 2; 0 of RINEX 3 and 4

    def columns(self, lines: IntArray, first: IntArray | int, width: int) -> Bytes:
        """Return (k, width) characters of lines from a column on; blanks behind their ends."""
        begin, end = self.begins[lines] + first, self.ends[lines]
        chars = sliding_window_view(self.text, width)[np.minimum(begin, end)]
        return np.where(np.arange(width) < (end - begin)[:, None], chars, np.uint8(_BLANK))


@dataclass(frozen=True, eq=False, slots=True)
class Epochs:
    """Epochs that are whole by their form, their satellites in the order of the file; the rest."""

    ticks: IntArray  # (n,), 1e-7 s since 1980-01-06
    flag: IntArray  # (n,)
    epoch: IntArray  # (r,), number of each satellite's epoch
    letter: IntArray  # (r,)
    number: IntArray  # (r,), less than 1 of none
    line: IntArray  # (r,), the first of its values
    is_named: BoolArray  # (r,)
    events: list[Event]
    faults: list[Fault]


def find_epochs(body: Body) -> Epochs:
    """Return the epochs of a file's body."""
    marks = _marks(body)
    taken, events, faults = _whole(body, marks)
    marks = marks[taken]
    counts = marks["announced"]
    epoch = np.repeat(np.arange(len(marks)), counts)
    place = np.arange(len(epoch)) - np.repeat(np.cumsum(counts) - counts, counts)
    line, first = marks["line"][epoch] + 1 + place, np.zeros(len(epoch), np.int64)
    is_named = np.ones(len(epoch), np.bool_)
    named = line
    if body.types:
        row = place // _NAMES
        first = 32 + 3 * (place % _NAMES) + marks["shift"][epoch] * (row == 0)
        named = marks["line"][epoch] + row
        line = marks["line"][epoch] + _rows_of_names(counts)[epoch] + place * _rows(body)
        begins = (place % _NAMES == 0) & (row > 0)
        is_named[begins] = (body.columns(named[begins], 0, 32) == _BLANK).all(axis=1)
    chars = body.columns(named, first, 3)
    letter, number = chars[:, 0].astype(np.int64), _whole_numbers(chars[:, 1:])
    if body.types:
        letter[letter == _BLANK] = ord("G")
        is_named &= number > 0
        line = np.where(is_named, line, named)
    return Epochs(
        marks["ticks"], marks["flag"], epoch, letter, number, line, is_named, events, faults
    )


def _rows(body: Body) -> int:
    """Return how many lines the values of a satellite take."""
    return -(-body.types // _FIELDS) if body.types else 1


def _rows_of_names(counts: IntArray) -> IntArray:
    """Return how many lines the names of satellites take, of RINEX 2."""
    return np.maximum(-(-counts // _NAMES), 1)


def _lines_after(body: Body, marks: NDArray[Any]) -> IntArray:
    """Return the lines behind epochs and events."""
    line, flag, announced = (marks[name] for name in ("line", "flag", "announced"))
    after = line + 1 + np.maximum(announced, 0)
    if body.types:  # records of cycle slips are written as an epoch
        of_epoch = _rows_of_names(announced) + np.maximum(announced, 0) * _rows(body)
        after = np.where((flag <= 1) | (flag == 6), line + of_epoch, after)
    return np.asarray(after)


def _whole(body: Body, marks: NDArray[Any]) -> tuple[list[int], list[Event], list[Fault]]:
    """Return which marks begin whole epochs, the events between them, and what is neither."""
    n = len(body.begins)
    full = np.append(np.where(body.ends > body.begins, np.arange(n), n), n)
    full = np.minimum.accumulate(full[::-1])[::-1]  # the next line that is not blank
    # Lines of values may look like an event of RINEX 2: those count where an epoch must begin.
    is_sure = (marks["is_valid"] > 0) & (marks["flag"] <= 1) | (body.types == 0)
    sure = marks["line"][is_sure].tolist()
    by_line = dict(zip(marks["line"].tolist(), range(len(marks)), strict=True))
    columns = (marks["is_valid"], marks["flag"], marks["announced"], _lines_after(body, marks))
    rows = list(zip(*(column.tolist() for column in columns), strict=True))
    taken, events, faults = list[int](), list[Event](), list[Fault]()
    at, next_sure = int(full[0]), 0
    while at < n:
        while next_sure < len(sure) and sure[next_sure] <= at:
            next_sure += 1
        ahead = sure[next_sure] if next_sure < len(sure) else n
        mark = by_line.get(at, -1)
        is_valid, flag, announced, end = rows[mark] if mark >= 0 else (0, 0, 0, at)
        fault = None
        if not is_valid:
            fault = Fault(NO_EPOCH, at)
        elif flag > 1:
            events.append(Event(flag, announced, at, end))
        elif ahead < min(end, n):
            fault = Fault(COUNT, ahead)
        elif end > n:
            fault = Fault(CUT, n)
        elif full[end] < n and int(full[end]) not in by_line:
            fault = Fault(COUNT, int(full[end]))
        else:
            taken.append(mark)
        at = int(full[min(end, n)]) if fault is None else ahead
        faults += [] if fault is None else [fault]
    return taken, events, faults


def _marks(body: Body) -> NDArray[Any]:
    """Return the lines at which epochs and events seem to begin.

    A date, or all that is behind it, may stand a column late.
    """
    every = np.arange(len(body.begins))
    if body.types:
        dots = body.columns(every, 18, 2) == _DOT
        blank = (body.columns(every, 0, 26) == _BLANK).all(axis=1)
        is_mark = dots.any(axis=1) | (blank & (body.ends - body.begins > 26))
    else:
        is_mark = (body.text[body.begins] == _GREATER) & (body.ends > body.begins)
    marks = np.zeros(int(is_mark.sum()), _MARK)
    marks["line"] = every[is_mark]
    head = body.columns(marks["line"], 0, _HEAD)
    year_end, width = (3, 2) if body.types else (6, 4)
    is_undated = (head[:, 1 : year_end + 25] == _BLANK).all(axis=1)
    for shift, late in ((0, 0), (1, 1), (0, 1)):
        ticks = _ticks(head, year_end + late, width)
        at = year_end + shift + 25
        flag = _whole_numbers(head[:, at : at + 1])
        flag[(flag == -1) & bool(body.types)] = 0
        announced = _whole_numbers(head[:, at + 1 : at + 4])
        short = (head[:, at + 3] == _BLANK) & (announced == -2)  # not adjusted
        announced[short] = _whole_numbers(head[short, at + 1 : at + 3])
        is_epoch = (flag >= 0) & (flag <= 1) & (ticks >= 0) & (announced >= 0)
        is_event = (flag >= 2) & (flag <= 6) & (announced >= -1)
        is_event &= (is_undated & (late == 0)) | (ticks >= 0)
        new = (is_epoch | is_event) & (marks["is_valid"] == 0)
        values = (ticks, flag, announced, np.full(len(marks), shift), np.ones(len(marks)))
        for name, value in zip(_COLUMNS[1:], values, strict=True):
            marks[name][new] = value[new]
    return marks


def _ticks(head: Bytes, year_end: int, width: int) -> IntArray:
    """Return dates of heads in 1e-7 s since 1980-01-06; -1 of none."""
    q = year_end
    year = _whole_numbers(head[:, q - width : q])
    if width == 2:
        year = np.where(year < 0, year, year + np.where(year >= 80, 1900, 2000))
    month, day, hour, minute = (_whole_numbers(head[:, q + k : q + k + 2]) for k in (1, 4, 7, 10))
    second = _whole_numbers(head[:, q + 12 : q + 15])
    early = (second == -2) & (head[:, q + 14] == _BLANK)
    second[early] = _whole_numbers(head[early, q + 12 : q + 14])
    fraction = _whole_numbers(head[:, q + 16 : q + 23])
    first = np.datetime64("0000-01", "M") + (12 * year + month - 1)
    date = first.astype("datetime64[D]") + (day - 1)
    is_date = (year >= 1980) & (month >= 1) & (month <= 12) & (day >= 1)
    is_date &= date.astype("datetime64[M]") == first
    is_date &= (hour >= 0) & (hour < 24) & (minute >= 0) & (minute < 60)
    is_date &= (second >= 0) & (second < 60) & (fraction >= 0)
    is_date &= (head[:, [q, q + 3, q + 6, q + 9]] == _BLANK).all(axis=1)
    is_date &= head[:, q + 15] == _DOT
    days = (date - GPS_EPOCH.astype("datetime64[D]")).astype(np.int64)
    ticks = ((days * 24 + hour) * 60 + minute) * 60 + second
    return np.where(is_date, ticks * TICKS_PER_S + fraction, -1)


def _whole_numbers(chars: Bytes) -> IntArray:
    """Return (k,) whole numbers, right-adjusted in (k, w); -1 where blank, -2 where none."""
    value = np.full(len(chars), -1)
    for column in chars.T:
        digit = column - np.uint8(_ZERO)  # wraps: what is less is more than 9
        is_more = (digit < 10) & (value > -2)
        is_still_blank = (column == _BLANK) & (value == -1)
        grown = 10 * np.maximum(value, 0) + digit
        value = np.where(is_more, grown, np.where(is_still_blank, -1, -2))
    return value
