"""The compiled scan of RINEX observations: whole epochs are taken, the others counted.

An epoch that breaks a rule is left out; the scan goes on at the next line that begins an epoch.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.io.gps_time import TICKS_PER_S
from fgnav.io.rinex.text import Bytes
from fgnav.kernels.compiled import inlined, inner, kernel

# Columns of the table of epochs and events.
TICKS, FLAG, ANNOUNCED, LINE, END, SHIFT = range(6)
# Rules that an epoch may break.
NO_EPOCH, COUNT, CUT, SATELLITE, VALUE = range(1, 6)

_BLANK, _DOT, _MINUS, _ZERO, _NINE, _GREATER = 32, 46, 45, 48, 57, 62


class Plan(NamedTuple):
    """What becomes of each field."""

    limits: IntArray  # (128, 2), by letter: types announced (0: none), highest number in use
    fields: IntArray  # (128, types, 3): carrier or -1, place in its values, number of the signal
    units: FloatArray  # (128, types): thousandths in a unit, times the header's scale factor


class Scanned(NamedTuple):
    """What a body holds; records are those of satellites in use, one a satellite and epoch."""

    tally: IntArray  # (128, types), values of satellites in use
    satellites: IntArray  # (128, 100), records of each satellite
    epochs: IntArray  # (k, 6), one row per epoch or event; more rows than there are
    taken: IntArray  # (1,), number of records
    records: IntArray  # (r, 3), row of the epoch, letter, number
    signals: IntArray  # (r, s), by carrier: number of the signal whose code it is, from 1 on; 0
    values: FloatArray  # (r, s, 4), by carrier: code, phase, Doppler, density; 0: not measured
    locks: IntArray  # (r, s), loss-of-lock indicators of phases
    faults: IntArray  # (6, 3), by rule: epochs left out, line and column of the first


@inner
def _whole(text: Bytes, start: int, end: int, stop: int) -> int:
    """Return a right-adjusted whole number, -1 when blank, -2 when it is none.

    A line may end behind it.
    """
    value = -1
    for i in range(start, min(end, stop)):
        c = text[i]
        if _ZERO <= c <= _NINE:
            value = (value if value > 0 else 0) * 10 + (c - _ZERO)
        elif c != _BLANK or value >= 0:
            return -2
    return value


@kernel
def days(year: int, month: int, day: int) -> int:
    """Return days since 1980-01-06 in the Gregorian calendar, or -1 of no date."""
    long = month in (1, 3, 5, 7, 8, 10, 12)
    leap = year % 4 == 0 and (year % 100 != 0 or year % 400 == 0)
    last = 31 if long else (30 if month != 2 else (29 if leap else 28))
    if year < 1980 or not 1 <= month <= 12 or not 1 <= day <= last:
        return -1
    y = year - (1 if month <= 2 else 0)
    m = month + 9 if month <= 2 else month - 3
    return 365 * y + y // 4 - y // 100 + y // 400 + (153 * m + 2) // 5 + day - 1 - 723_125


@inner
def _ticks(text: Bytes, p: int, width: int, stop: int) -> int:
    """Return the epoch whose year ends before ``p``, in 1e-7 s since 1980-01-06; -1 if none."""
    year = _whole(text, p - width, p, stop)
    if width == 2 and year >= 0:
        year += 1900 if year >= 80 else 2000
    month, day = _whole(text, p + 1, p + 3, stop), _whole(text, p + 4, p + 6, stop)
    hour, minute = _whole(text, p + 7, p + 9, stop), _whole(text, p + 10, p + 12, stop)
    after = p + 14 if p + 15 < stop and text[p + 14] == _BLANK else p + 15
    second, fraction = _whole(text, p + 12, after, stop), _whole(text, p + 16, p + 23, stop)
    day_number = days(year, month, day)
    fits = 0 <= hour < 24 and 0 <= minute < 60 and 0 <= second < 60 and fraction >= 0
    if day_number < 0 or not fits or p + 23 > stop or text[p + 15] != _DOT:
        return -1
    for k in (0, 3, 6, 9):
        if text[p + k] != _BLANK:
            return -1
    return (((day_number * 24 + hour) * 60 + minute) * 60 + second) * TICKS_PER_S + fraction


@inner
def _begins(text: Bytes, p: int, stop: int, width: int, row: IntArray) -> bool:
    """Fill the row of an epoch or event whose line begins at ``p``; return False if none does.

    A date, or all that is behind its beginning, may stand a column late.
    """
    if width == 4 and (p >= stop or text[p] != _GREATER):
        return False
    for late in range(3):
        shift, q = (1 if late == 1 else 0), p + (6 if width == 4 else 3)
        ticks = _ticks(text, q + (1 if late else 0), width, stop)
        flag = _whole(text, q + shift + 25, q + shift + 26, stop)
        end = q + shift + 29
        end -= 1 if end <= stop and text[end - 1] == _BLANK else 0  # not adjusted
        announced = _whole(text, q + shift + 26, end, stop)
        flag = 0 if flag == -1 and width == 2 else flag
        row[TICKS], row[FLAG], row[ANNOUNCED], row[SHIFT] = ticks, flag, announced, shift
        if 0 <= flag <= 1 and ticks >= 0 and announced >= 0:
            return True
        blank = late == 0
        for k in range(p + 1, min(q + 25, stop)):
            blank = blank and text[k] == _BLANK
        if 2 <= flag <= 6 and announced >= -1 and (blank or ticks >= 0):
            return True
    return False


@inlined
def _field(text: Bytes, start: int, stop: int) -> tuple[int, int]:
    """Return a field F14.3 in thousandths, and 0 if blank, 1 if a number, 2 if broken."""
    i, end = start, min(start + 14, stop)
    while i < end and text[i] == _BLANK:
        i += 1
    if i >= end:
        return 0, 0
    negative = text[i] == _MINUS
    if negative:
        i += 1
    if end < start + 14 or text[start + 10] != _DOT or i > start + 10:
        return 0, 2
    value = 0
    for k in range(i, start + 14):
        c = text[k]
        if k == start + 10:
            continue
        if c < _ZERO or c > _NINE:
            return 0, 2
        value = value * 10 + (c - _ZERO)
    return (-value if negative else value), 1


@inlined
def _lock(text: Bytes, p: int, stop: int) -> int:
    """Return the loss-of-lock indicator behind a value; -1 where one of both is no digit."""
    lock = text[p + 14] if p + 14 < stop else _BLANK
    strength = text[p + 15] if p + 15 < stop else _BLANK
    if not (lock == _BLANK or _ZERO <= lock <= _NINE):
        return -1
    if not (strength == _BLANK or _ZERO <= strength <= _NINE):
        return -1
    return 0 if lock == _BLANK else lock - _ZERO


@inner
def _fields(
    text: Bytes, span: tuple[int, int], first: int, count: int, plan: Plan, into: Scanned, sign: int
) -> int:
    """Take ``count`` fields of 16 columns; return the broken column, -1 if none.

    They are types ``first`` and following of the constellation of the record that is begun, with
    letter 0 of one that is not in use. Of several codes of a carrier the one with the lowest number
    stays.
    """
    start, stop = span
    r = into.taken[0]
    letter = into.records[r, 1]
    for k in range(count):
        p = start + 16 * k
        if p >= stop:
            return -1
        carrier, place, signal = plan.fields[letter, first + k]
        value, state = _field(text, p, stop)
        lock = _lock(text, p, stop)
        if state == 2 or lock < 0:
            return p - start
        into.tally[letter, first + k] += sign * (value != 0)
        if carrier < 0:
            continue
        if place == 1:
            into.locks[r, carrier] |= lock & 3
        earlier = into.signals[r, carrier]
        if value != 0 and (place != 0 or earlier == 0 or signal < earlier):
            into.values[r, carrier, place] = value / plan.units[letter, first + k]
            into.signals[r, carrier] = signal if place == 0 else earlier
    return 16 * count if stop > start + 16 * count else -1


@inner
def _satellite(
    text: Bytes,
    lines: IntArray,
    at: IntArray,
    name: IntArray,
    epoch: int,
    seen: IntArray,
    plan: Plan,
    into: Scanned,
) -> int:
    """Take the line of a satellite, of RINEX 2 its lines; return the rule that it breaks, else 0.

    ``at`` is the number of its first line, 0 or the broken column, the width of a year, the number
    of the epoch among all that were begun, and what to add to counts.
    """
    letter, number = name[0], name[1]
    types = plan.limits[letter, 0] if 0 < letter < 128 else 0
    if types == 0 or number < 1 or number > 99 or seen[letter, number] == at[3]:
        return SATELLITE
    seen[letter, number] = at[3]
    r = into.taken[0]
    is_used = number <= plan.limits[letter, 1]
    into.records[r, 0], into.records[r, 1] = epoch, letter if is_used else 0
    into.records[r, 2] = number
    is_2 = at[2] == 2
    for first in range(0, types, 5 if is_2 else types):
        if at[0] >= len(lines):
            return CUT
        p, stop = lines[at[0], 0], lines[at[0], 1]
        count = min(5, types - first) if is_2 else types
        start = p if is_2 else p + 3
        column = _fields(text, (start, stop), first, count, plan, into, at[4])
        if column >= 0:
            at[1] = column + start - p + 1
            return VALUE
        at[0] += 1
    into.satellites[letter, number] += at[4]
    into.taken[0] += is_used
    return 0


@inner
def _names_2(text: Bytes, lines: IntArray, row: IntArray, names: IntArray) -> tuple[int, bool]:
    """Read the satellites of a RINEX 2 epoch; return the line after, or a broken one and False."""
    k = row[LINE]
    for i in range(row[ANNOUNCED]):
        if i % 12 == 0 and i > 0:
            k += 1
        if k >= len(lines):
            return k, False
        p, stop = lines[k, 0], lines[k, 1]
        for j in range(p if i % 12 == 0 and i > 0 else p + 32, min(p + 32, stop)):
            if text[j] != _BLANK:
                return k, False
        q = p + 32 + 3 * (i % 12) + (row[SHIFT] if i < 12 else 0)
        names[i, 1] = _whole(text, q + 1, q + 3, stop)
        if q + 3 > stop or names[i, 1] < 1 or text[q] > 127:
            return k, False
        names[i, 0] = 71 if text[q] == _BLANK else text[q]  # blank means GPS
    return k + 1, True


class _File(NamedTuple):
    """What a scan works with; ``at`` as of ``_satellite``."""

    text: Bytes
    lines: IntArray
    at: IntArray
    names: IntArray  # (1000, 2), letter and number of satellites
    seen: IntArray  # (128, 100), the last epoch with each satellite


@inner
def _is_followed(file: _File, row: IntArray) -> bool:
    """Return True if the text ends, or another epoch seems to begin; it may be damaged itself."""
    lines, k, width = file.lines, file.at[0], file.at[2]
    while k < len(lines) and lines[k, 0] == lines[k, 1]:
        k += 1
    if k >= len(lines) or _begins(file.text, lines[k, 0], lines[k, 1], width, row):
        return True
    p = lines[k, 0]
    if width == 4:
        return bool(file.text[p] == _GREATER)
    return bool(p + 18 < lines[k, 1] and file.text[p + 18] == _DOT)


@inner
def _epoch(file: _File, row: IntArray, n: int, plan: Plan, into: Scanned) -> int:
    """Take the satellites of an epoch; return the rule that it breaks, else 0."""
    text, lines, at, names = file.text, file.lines, file.at, file.names
    width, count = at[2], row[ANNOUNCED]
    at[0] = row[LINE] + 1
    if width == 2:
        at[0], is_whole = _names_2(text, lines, row, names)
        if not is_whole:
            return COUNT
    for i in range(count):
        if at[0] >= len(lines):
            return CUT
        if width == 4:
            p, stop = lines[at[0], 0], lines[at[0], 1]
            if p < stop and text[p] == _GREATER:
                return COUNT
            names[i, 0], names[i, 1] = text[p] if p < stop else 0, _whole(text, p + 1, p + 3, stop)
        problem = _satellite(text, lines, at, names[i], n, file.seen, plan, into)
        if problem:
            return problem
    return 0 if _is_followed(file, into.epochs[n + 1]) else COUNT


@inner
def _next(file: _File, row: IntArray, n: int, plan: Plan, into: Scanned) -> int:
    """Take an epoch or event, or pass a line that begins none; return the rule that is broken."""
    at = file.at
    p, stop = file.lines[at[0], 0], file.lines[at[0], 1]
    if not _begins(file.text, p, stop, at[2], row):
        return NO_EPOCH
    if row[FLAG] <= 1:
        return _epoch(file, row, n, plan, into)
    rows = max(row[ANNOUNCED], 0)
    if row[FLAG] == 6 and at[2] == 2:  # lines as of an epoch
        rows = (max(rows, 1) - 1) // 12 + rows * ((plan.limits[71, 0] + 4) // 5)
    at[0] += 1 + rows
    return 0


@inner
def _leave_out(
    file: _File, row: IntArray, n: int, begin: int, problem: int, plan: Plan, into: Scanned
) -> None:
    """Count an epoch that breaks a rule, take back what was taken of it, and go to the next."""
    at, lines = file.at, file.lines
    was_begun = problem != NO_EPOCH
    problem = CUT if at[0] >= len(lines) - 1 else problem
    if into.faults[problem, 0] == 0:
        into.faults[problem, 1], into.faults[problem, 2] = at[0], at[1]
    into.faults[problem, 0] += 1
    after = max(at[0], row[LINE] + 1)
    if was_begun:  # count it once more, backwards
        into.taken[0], at[3], at[4] = begin, at[3] + 1, -1
        _epoch(file, row, n, plan, into)
        for r in range(begin, into.taken[0] + 1):
            into.locks[r], into.signals[r], into.values[r] = 0, 0, 0.0
    into.taken[0], at[0], at[4] = begin, after, 1
    while at[0] < len(lines):
        p, stop = lines[at[0], 0], lines[at[0], 1]
        if _begins(file.text, p, stop, at[2], into.epochs[n]):
            return
        at[0] += 1


@kernel
def line_ends(text: Bytes, lines: IntArray) -> None:
    """Move the second of each pair of offsets before the blanks that end its line."""
    for k in range(len(lines)):
        end = lines[k, 1]
        while end > lines[k, 0] and (text[end - 1] == _BLANK or text[end - 1] == 13):
            end -= 1
        lines[k, 1] = end


@kernel
def scan(text: Bytes, lines: IntArray, width: int, plan: Plan, into: Scanned) -> int:
    """Scan the body of an observation file.

    Parameters
    ----------
    text : ndarray of uint8
    lines : ndarray, (l, 2)
        Offsets of the lines of the body, and of their ends without blanks.
    width : int
        Of a year: 2 of RINEX 2, 4 of RINEX 3 and 4.
    plan : Plan
        What becomes of each field.
    into : Scanned
        Filled.

    Returns
    -------
    int
        Rows filled.
    """
    n = 0
    at = np.array([0, 0, width, 0, 1])
    file = _File(text, lines, at, np.zeros((1000, 2), np.int64), np.zeros((128, 100), np.int64))
    while at[0] < len(lines):
        if lines[at[0], 0] == lines[at[0], 1]:
            at[0] += 1
            continue
        row, begin = into.epochs[n], into.taken[0]
        row[LINE], at[1] = at[0], 0
        at[3] += 1
        problem = _next(file, row, n, plan, into)
        if problem:
            _leave_out(file, row, n, begin, problem, plan, into)
        else:
            row[END] = at[0]
            n += 1
    return n
