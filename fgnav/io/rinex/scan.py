"""The compiled reading of the body of a RINEX observation file: one pass, line by line.

An epoch that breaks a rule is left out; reading goes on at the next line that begins one.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.io.gps_time import TICKS_PER_S
from fgnav.io.rinex.text import Bytes
from fgnav.kernels.compiled import kernel

# Rules that an epoch may break.
NO_EPOCH, COUNT, CUT, SATELLITE, VALUE = range(1, 6)
TICKS, FLAG, ANNOUNCED, SHIFT = range(4)  # of a line that begins an epoch or event
A_LINE = 5  # fields of RINEX 2
_NAMES = 12  # satellites that a line of RINEX 2 names
_NUMBER, _FIELD = 14, 16  # columns: F14.3 and two indicators
_BLANK, _MINUS, _DOT, _ZERO, _NINE, _GREATER, _G, _RETURN = (ord(c) for c in " -.09>G\r")
_GPS_DAY = 723_125  # 1980-01-06, days since 0000-03-01 of the Gregorian calendar


class Body(NamedTuple):
    """The text behind a header by its lines, and what the header says of them."""

    text: Bytes
    begins: IntArray  # of lines, (l,)
    ends: IntArray  # without the blanks that end them
    rows: int  # lines of a satellite of RINEX 2; 0 of RINEX 3 and 4
    types: IntArray  # (128,), fields by the letter of a constellation
    units: FloatArray  # (128, t), thousandths in a unit


class ScanArrays(NamedTuple):
    """Arrays that a scan fills."""

    epochs: IntArray  # (l, 4), as ``TICKS`` and ``FLAG``
    records: IntArray  # (l, 3): number of the epoch, letter and number of the satellite
    faults: IntArray  # (l, 3): rule, line, column
    events: IntArray  # (l, 4): flag, records, line, the line after
    values: FloatArray  # (l, t), 0 where there is none
    locks: IntArray  # (l, t), loss-of-lock indicators


@kernel
def _char(body: Body, line: int, at: int) -> int:
    """Return a character of a line; blanks stand behind its end."""
    k = body.begins[line] + at
    return body.text[k] if k < body.ends[line] else _BLANK


@kernel
def _is_blank(body: Body, line: int, at: int, width: int) -> bool:
    blank = True
    for k in range(at, at + width):
        blank &= _char(body, line, k) == _BLANK
    return blank


@kernel
def _whole(body: Body, line: int, at: int, width: int) -> int:
    """Return a whole number, right-adjusted in its columns; -1 where blank, -2 where none."""
    value = -1
    for k in range(at, at + width):
        c = _char(body, line, k)
        if _ZERO <= c <= _NINE:
            value = 10 * max(value, 0) + (c - _ZERO)
        elif c != _BLANK or value >= 0:
            return -2
    return value


@kernel
def _ticks(body: Body, line: int, q: int, width: int) -> int:
    """Return a date whose year ends at q, in 1e-7 s since 1980-01-06; -1 of none."""
    year, month = _whole(body, line, q - width, width), _whole(body, line, q + 1, 2)
    day, hour = _whole(body, line, q + 4, 2), _whole(body, line, q + 7, 2)
    minute, second = _whole(body, line, q + 10, 2), _whole(body, line, q + 12, 3)
    fraction = _whole(body, line, q + 16, 7)
    if second == -2 and _is_blank(body, line, q + 14, 1):  # not adjusted
        second = _whole(body, line, q + 12, 2)
    if width == 2 and year >= 0:
        year += 1900 if year >= 80 else 2000
    is_date = year >= 1980 and 1 <= month <= 12 and _char(body, line, q + 15) == _DOT
    is_date &= 0 <= hour < 24 and 0 <= minute < 60 and 0 <= second < 60 and fraction >= 0
    for k in (q, q + 3, q + 6, q + 9):
        is_date &= _is_blank(body, line, k, 1)
    is_leap = year % 4 == 0 and (year % 100 != 0 or year % 400 == 0)
    length = 30 if month in (4, 6, 9, 11) else 31
    if not is_date or not 1 <= day <= (28 + is_leap if month == 2 else length):
        return -1
    y = year - (month <= 2)  # of years that begin in March
    days = 365 * y + y // 4 - y // 100 + y // 400 - _GPS_DAY
    days += (153 * (month + (9 if month <= 2 else -3)) + 2) // 5 + day - 1
    return (((days * 24 + hour) * 60 + minute) * 60 + second) * TICKS_PER_S + fraction


@kernel
def _may_begin(body: Body, line: int) -> bool:
    """Return True if a line looks like the beginning of an epoch or event."""
    if not body.rows:
        return _char(body, line, 0) == _GREATER
    if _char(body, line, 18) == _DOT or _char(body, line, 19) == _DOT:
        return True
    return body.ends[line] > body.begins[line] + 26 and _is_blank(body, line, 0, 26)


@kernel
def _begins(body: Body, line: int, mark: IntArray) -> bool:
    """Read the beginning of an epoch or event; a date, or all behind it, may stand a column late.

    Returns
    -------
    bool
        Whether the line is one; then ``mark`` has its time, flag, number of satellites or records,
        and by how many columns satellites stand late.
    """
    if not _may_begin(body, line):
        return False
    q, width = (3, 2) if body.rows else (6, 4)
    is_undated = _is_blank(body, line, 1, q + 24)
    for shift, late in ((0, 0), (1, 1), (0, 1)):
        at = q + shift + 25
        ticks, flag = _ticks(body, line, q + late, width), _whole(body, line, at, 1)
        announced = _whole(body, line, at + 1, 3)
        if body.rows and flag == -1:
            flag = 0
        if announced == -2 and _is_blank(body, line, at + 3, 1):  # not adjusted
            announced = _whole(body, line, at + 1, 2)
        is_dated = ticks >= 0 or (flag >= 2 and is_undated and late == 0)
        if is_dated and 0 <= flag <= 6 and announced >= (0 if flag <= 1 else -1):
            mark[TICKS], mark[FLAG], mark[ANNOUNCED], mark[SHIFT] = ticks, flag, announced, shift
            return True
    return False


@kernel
def _next_epoch(body: Body, line: int) -> int:
    """Return the next line that begins an epoch; of RINEX 2 values may look like an event."""
    mark = np.empty(4, np.int64)
    for k in range(line, len(body.begins)):
        if body.rows == 0 and _may_begin(body, k):
            return k
        if body.rows and _begins(body, k, mark) and mark[FLAG] <= 1:
            return k
    return len(body.begins)


@kernel
def _next_line(body: Body, line: int) -> int:
    """Return the first line from one on that is not blank."""
    while line < len(body.begins) and body.ends[line] == body.begins[line]:
        line += 1
    return line


@kernel
def _rows_of_names(body: Body, mark: IntArray) -> int:
    return max((mark[ANNOUNCED] + _NAMES - 1) // _NAMES, 1) if body.rows else 1


@kernel
def _after(body: Body, line: int, mark: IntArray) -> int:
    """Return the line behind an epoch or event."""
    announced = max(int(mark[ANNOUNCED]), 0)
    if body.rows and (mark[FLAG] <= 1 or mark[FLAG] == 6):  # cycle slips are written as an epoch
        return line + _rows_of_names(body, mark) + body.rows * announced
    return line + 1 + announced


@kernel
def _extent(body: Body, line: int, after: int) -> tuple[int, int, int]:
    """Return the rule that an epoch breaks by its lines, where, and the line to go on at."""
    n, ahead = len(body.begins), _next_epoch(body, line + 1)
    following = _next_line(body, max(after, line))
    if after < 0:
        return NO_EPOCH, line, ahead
    if ahead < after:
        return COUNT, ahead, ahead
    if after > n:
        return CUT, n, n
    if following < n and not _may_begin(body, following):
        return COUNT, following, ahead
    return 0, line, following


@kernel
def _thousandths(text: Bytes, start: int, stop: int) -> tuple[int, int]:
    """Return a number in thousandths, and 0 if blank, 1 if a number, 2 if broken."""
    i, end = start, min(start + _NUMBER, stop)
    while i < end and text[i] == _BLANK:
        i += 1
    if i >= end:
        return 0, 0
    negative = text[i] == _MINUS
    if negative:
        i += 1
    dot = start + _NUMBER - 4
    if end < start + _NUMBER or text[dot] != _DOT or i > dot:
        return 0, 2
    value = 0
    for k in range(i, start + _NUMBER):
        if k == dot:
            continue
        if text[k] < _ZERO or text[k] > _NINE:
            return 0, 2
        value = value * 10 + (text[k] - _ZERO)
    return (-value if negative else value), 1


@kernel
def _fields(
    body: Body, line: int, skipped: int, letter: int, values: FloatArray, locks: IntArray
) -> tuple[int, int]:
    """Read a satellite's fields; return line and column of the first broken one, column 0 of none.

    Behind a number stand two digits or blanks: loss of lock, and signal strength.
    """
    types = body.types[letter]
    a_line = A_LINE if body.rows else types
    for k in range(types):
        row, at = line + k // a_line, skipped + _FIELD * (k % a_line)
        start, stop = body.begins[row] + at, body.ends[row]
        value, state = _thousandths(body.text, start, stop)
        lock, strength = _whole(body, row, at + _NUMBER, 1), _whole(body, row, at + _NUMBER + 1, 1)
        if state == 2 or lock == -2 or strength == -2:
            return row, at + 1
        if (k % a_line == a_line - 1 or k == types - 1) and stop > start + _FIELD:
            return row, at + _FIELD + 1
        values[k], locks[k] = value / body.units[letter, k], max(lock, 0)
    return line, 0


@kernel
def _satellites(
    body: Body, line: int, mark: IntArray, seen: IntArray, arrays: ScanArrays, epoch: int, new: int
) -> tuple[int, int, int]:
    """Read the satellites of an epoch; return rule, line and column of the first broken one."""
    is_2 = body.rows > 0
    for k in range(mark[ANNOUNCED]):
        named, position, late = line + 1 + k, 0, 0
        if is_2:
            named, position = line + k // _NAMES, 32 + 3 * (k % _NAMES)
            late = mark[SHIFT] if k < _NAMES else 0
        letter = _char(body, named, position + late)
        number = _whole(body, named, position + late + 1, 2)
        letter = _G if is_2 and letter == _BLANK else letter
        is_named = number > 0 and (k < _NAMES or _is_blank(body, named, 0, 32))
        if is_2 and not is_named:
            return COUNT, named, 0
        at = line + _rows_of_names(body, mark) + k * body.rows if is_2 else named
        if letter >= 128 or body.types[letter] == 0 or number < 1 or seen[letter, number] == line:
            return SATELLITE, at, 0
        seen[letter, number] = line
        values, locks = arrays.values[new + k], arrays.locks[new + k]
        row, column = _fields(body, at, 0 if is_2 else 3, letter, values, locks)
        if column:
            return VALUE, row, column
        record = arrays.records[new + k]
        record[0], record[1], record[2] = epoch, letter, number
    return 0, line, 0


@kernel
def scan(body: Body, arrays: ScanArrays) -> IntArray:
    """Read epochs, the satellites of each and their fields.

    Returns
    -------
    ndarray, (4,)
        How many epochs, records, faults and events were found.
    """
    epochs, records, faults, events = 0, 0, 0, 0
    mark = np.zeros(4, np.int64)
    index_of = np.full((128, 100), -1)  # the line of the latest epoch of each satellite
    line = _next_line(body, 0)
    while line < len(body.begins):
        is_mark = _begins(body, line, mark)
        after = _after(body, line, mark) if is_mark else -1
        if is_mark and mark[FLAG] > 1:
            event = arrays.events[events]
            event[0], event[1], event[2], event[3] = mark[FLAG], mark[ANNOUNCED], line, after
            events += 1
            line = _next_line(body, after)
            continue
        rule, at, ahead = _extent(body, line, after)
        column = 0
        if rule == 0:
            rule, at, column = _satellites(body, line, mark, index_of, arrays, epochs, records)
        if rule:
            fault = arrays.faults[faults]
            fault[0], fault[1], fault[2] = rule, at, column
            faults += 1
        else:
            for k in range(4):  # to assign a row would compile the texts of its errors, too
                arrays.epochs[epochs, k] = mark[k]
            epochs += 1
            records += mark[ANNOUNCED]
        line = ahead
    return np.array([epochs, records, faults, events])


@kernel
def line_ends(text: Bytes, begins: IntArray, ends: IntArray) -> None:
    """Move the ends of lines, (l,), before the blanks that end them."""
    for k in range(len(ends)):
        while ends[k] > begins[k] and text[ends[k] - 1] in (_BLANK, _RETURN):
            ends[k] -= 1
