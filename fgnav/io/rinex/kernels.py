"""Compiled scans of RINEX bodies: every character is looked at, and every value taken.

Each scan fills arrays it is given and returns how far it came. ``problem`` is (code, line,
column): code 0 says all is well, the others are explained in ``scan.PROBLEMS``.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.io.gps_time import TICKS_PER_S
from fgnav.io.rinex.text import Bytes
from fgnav.kernels.compiled import inlined, inner, kernel

# Columns of the table of epochs and events.
TICKS, FLAG, ANNOUNCED, LINE, START, END = range(6)

_BLANK, _DOT, _MINUS, _ZERO, _NINE, _NEWLINE, _GREATER = 32, 46, 45, 48, 57, 10, 62


class Scanned(NamedTuple):
    """What a body holds; records are those of satellites in use, one a satellite and epoch."""

    tally: IntArray  # (128, types), values other than zero of satellites in use
    satellites: IntArray  # (128, 100), records of each satellite
    epochs: IntArray  # (k, 6), one row per epoch or event; more rows than there are
    taken: IntArray  # (1,), number of records
    records: IntArray  # (r, 3), row of the epoch, letter, number
    signals: IntArray  # (r, 3), by carrier: number of the signal whose code it is, from 1 on; 0
    values: FloatArray  # (r, 3, 4), by carrier: code, phase, Doppler, density; 0: not measured
    locks: IntArray  # (r, 3), loss-of-lock indicators of phases


class Plan(NamedTuple):
    """What becomes of each field."""

    limits: IntArray  # (128, 2), by letter: types announced (0: none), highest number in use
    fields: IntArray  # (128, types, 3): carrier or -1, place in its values, number of the signal
    units: FloatArray  # (128, types): thousandths in a unit, times the header's scale factor


@kernel
def line_end(text: Bytes, start: int) -> int:
    """Return where the line's end character stands, or the end of the text."""
    i = start
    while i < len(text) and text[i] != _NEWLINE:
        i += 1
    return i


@kernel
def trimmed(text: Bytes, start: int, end: int) -> int:
    """Return the end of the line without trailing blanks and carriage return."""
    while end > start and (text[end - 1] == _BLANK or text[end - 1] == 13):
        end -= 1
    return end


@kernel
def whole(text: Bytes, start: int, end: int, stop: int) -> int:
    """Return a right-adjusted whole number, -1 when blank, -2 when it is none."""
    value = -1
    for i in range(start, end):
        c = text[i] if i < stop else _BLANK
        if _ZERO <= c <= _NINE:
            value = (value if value > 0 else 0) * 10 + (c - _ZERO)
        elif c != _BLANK or value >= 0:
            return -2
    return value


@inlined
def _thousandths(text: Bytes, start: int, stop: int) -> tuple[int, int]:
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
def _ticks(text: Bytes, p: int, year_width: int, stop: int) -> int:
    """Return the epoch written from ``p`` on, in 1e-7 s since 1980-01-06; -1 if it is none."""
    year = whole(text, p, p + year_width, stop)
    if year_width == 2 and year >= 0:
        year += 1900 if year >= 80 else 2000
    p += year_width
    month, day = whole(text, p + 1, p + 3, stop), whole(text, p + 4, p + 6, stop)
    hour, minute = whole(text, p + 7, p + 9, stop), whole(text, p + 10, p + 12, stop)
    second, fraction = whole(text, p + 12, p + 15, stop), whole(text, p + 16, p + 23, stop)
    day_number = days(year, month, day)
    fits = 0 <= hour < 24 and 0 <= minute < 60 and 0 <= second < 60 and fraction >= 0
    if (
        day_number < 0
        or not fits
        or p + 23 > stop
        or text[p + 15] != _DOT
        or text[p + 16] == _BLANK
    ):
        return -1
    for k in (0, 3, 6, 9):
        if text[p + k] != _BLANK:
            return -1
    return (((day_number * 24 + hour) * 60 + minute) * 60 + second) * TICKS_PER_S + fraction


@inlined
def _indicators(text: Bytes, p: int, stop: int) -> int:
    """Return the loss-of-lock indicator behind a value; below 0: minus the broken column from 1."""
    lock = 0
    if p + 14 < stop and text[p + 14] != _BLANK:
        lock = text[p + 14] - _ZERO
        if lock < 0 or lock > 9:
            return -15
    if p + 15 < stop and not (text[p + 15] == _BLANK or _ZERO <= text[p + 15] <= _NINE):
        return -16
    return lock


@inner
def _fields(  # a kernel: every argument is an array or a place in one
    text: Bytes, start: int, stop: int, first: int, count: int, plan: Plan, into: Scanned
) -> int:
    """Check and take ``count`` fields of 16 columns; return the broken column, -1 if none.

    They are types ``first`` and following of the constellation of the record that is begun; letter
    0 there: they are only checked. Of several codes of a carrier the one with the lowest number
    stays.
    """
    r = into.taken[0]
    letter = into.records[r, 1]
    for k in range(count):
        p = start + 16 * k
        if p >= stop:
            return -1
        value, state = _thousandths(text, p, stop)
        lock = 0 if state == 2 else _indicators(text, p, stop)
        if state == 2 or lock < 0:
            return p - start + (0 if state == 2 else -lock - 1)
        carrier, place, signal = plan.fields[letter, first + k]
        into.tally[letter, first + k] += value != 0
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
def _epoch_problem(row: IntArray, last: int) -> int:
    """Return the number of the rule that an epoch or event breaks, 0 if none."""
    flag, announced, ticks = row[FLAG], row[ANNOUNCED], row[TICKS]
    if flag < 0 or flag > 6 or announced < -1 or (flag <= 1 and (ticks < 0 or announced < 0)):
        return 2
    return 3 if flag <= 1 and ticks <= last else 0


@inner
def _begin_record(
    letter: int, number: int, seen: IntArray, plan: Plan, into: Scanned, epoch: int
) -> int:
    """Begin a satellite's record, if it is in use; return 7 if the epoch has it already, else 0."""
    if seen[letter, number] == epoch:
        return 7
    seen[letter, number] = epoch
    into.satellites[letter, number] += 1
    r = into.taken[0]
    into.records[r, 0], into.records[r, 1], into.records[r, 2] = epoch, 0, number
    if number <= plan.limits[letter, 1]:
        into.records[r, 1] = letter
    return 0


@inlined
def _satellite_3(
    text: Bytes, p: int, seen: IntArray, plan: Plan, into: Scanned, epoch: int, problem: IntArray
) -> None:
    """Check and take one satellite's line."""
    stop = trimmed(text, p, line_end(text, p))
    letter, number = text[p], whole(text, p + 1, p + 3, stop)
    types = plan.limits[letter, 0] if letter < 128 else 0
    if letter == _GREATER:
        problem[0] = 4
    elif types == 0 or number < 1:
        problem[0] = 6
    else:
        problem[0] = _begin_record(letter, number, seen, plan, into, epoch)
        if problem[0] == 0:
            column = _fields(text, p + 3, stop, 0, types, plan, into)
            if column >= 0:
                problem[0], problem[2] = 8, column + 4
            into.taken[0] += number <= plan.limits[letter, 1]


@kernel
def scan_3(text: Bytes, start: IntArray, plan: Plan, into: Scanned, problem: IntArray) -> int:
    """Scan the body of a RINEX 3 or 4 observation file.

    Parameters
    ----------
    text : ndarray of uint8
    start : ndarray, (2,)
        Offset of the body, number of its first line.
    plan : Plan
        What becomes of each field.
    into : Scanned
        Filled.
    problem : ndarray, (3,)

    Returns
    -------
    int
        Rows filled.
    """
    p, line, n, last = start[0], start[1], 0, -1
    seen = np.full((128, 100), -1, np.int64)
    while p < len(text):
        newline = line_end(text, p)
        stop = trimmed(text, p, newline)
        row = into.epochs[n]
        row[TICKS], row[FLAG] = _ticks(text, p + 2, 4, stop), whole(text, p + 31, p + 32, stop)
        row[ANNOUNCED], row[LINE], row[START] = whole(text, p + 32, p + 35, stop), line, p
        problem[1], problem[2] = line, 0
        well_begun = text[p] == _GREATER and stop >= p + 32
        problem[0] = _epoch_problem(row, last) if well_begun else 1
        p, line = newline + 1, line + 1
        for _ in range(row[ANNOUNCED]):
            if problem[0]:
                return n
            problem[0], problem[1] = (4 if p >= len(text) else 0), line
            if problem[0] == 0 and row[FLAG] <= 1:
                _satellite_3(text, p, seen, plan, into, n, problem)
            p, line = line_end(text, p) + 1, line + 1
        if problem[0]:
            return n
        if row[FLAG] <= 1:
            last = row[TICKS]
        row[END] = min(p, len(text))
        n += 1
    return n


@inner
def _satellites_2(text: Bytes, p: int, count: int, ids: IntArray) -> tuple[int, int]:
    """Read the satellites of a RINEX 2 epoch from its line and those that continue it.

    Returns the offset of the line after, -1 where something is wrong, and the lines used.
    """
    lines = 0
    newline = p
    for k in range(count):
        if k % 12 == 0:
            if lines:
                p = newline + 1
                for i in range(p, min(p + 32, len(text))):
                    if text[i] != _BLANK:
                        return -1, lines
            lines += 1
            newline = line_end(text, p)
        q = p + 32 + 3 * (k % 12)
        number = whole(text, q + 1, q + 3, newline)
        if q + 3 > newline or number < 1 or text[q] > 127:
            return -1, lines
        ids[k, 0] = 71 if text[q] == _BLANK else text[q]  # blank means GPS
        ids[k, 1] = number
    return (newline if count else line_end(text, p)) + 1, max(lines, 1)


@inner
def _satellite_2(
    text: Bytes, place: IntArray, letter: int, plan: Plan, into: Scanned, problem: IntArray
) -> None:
    """Check and take the lines of one satellite, five fields each.

    ``place`` is the offset and the number of the line, and moves on; with letter 0 it passes one
    line that is not looked at.
    """
    types = plan.limits[letter, 0]
    for first in range(0, max(types, 1), 5):
        p = place[0]
        problem[0], problem[1], problem[2] = (4 if p >= len(text) else 0), place[1], 0
        if problem[0]:
            return
        newline = line_end(text, p)
        stop = trimmed(text, p, newline)
        column = _fields(text, p, stop, first, min(5, types - first), plan, into)
        if types and column >= 0:
            problem[0], problem[2] = 8, column + 1
            return
        place[0], place[1] = newline + 1, place[1] + 1


@kernel
def scan_2(text: Bytes, start: IntArray, plan: Plan, into: Scanned, problem: IntArray) -> int:
    """Scan the body of a RINEX 2 observation file; arguments as of ``scan_3``."""
    place, n, last = start.copy(), 0, -1
    seen = np.full((128, 100), -1, np.int64)
    ids = np.zeros((1000, 2), np.int64)
    while place[0] < len(text):
        p = place[0]
        stop = trimmed(text, p, line_end(text, p))
        row = into.epochs[n]
        row[TICKS], row[FLAG] = _ticks(text, p + 1, 2, stop), whole(text, p + 28, p + 29, stop)
        row[FLAG] = 0 if row[FLAG] == -1 else row[FLAG]  # blank means 0
        row[ANNOUNCED], row[LINE], row[START] = whole(text, p + 29, p + 32, stop), place[1], p
        problem[1], problem[2] = place[1], 0
        problem[0] = _epoch_problem(row, last)
        if problem[0]:
            return n
        listed = row[FLAG] <= 1 or row[FLAG] == 6
        place[0], lines = _satellites_2(text, p, row[ANNOUNCED] if listed else 0, ids)
        place[1] += lines
        if place[0] < 0:
            problem[0] = 6
            return n
        for k in range(row[ANNOUNCED]):
            letter = ids[k, 0] if listed else 0
            problem[0] = 6 if listed and plan.limits[letter, 0] == 0 else 0
            into.records[into.taken[0], 1] = 0
            if row[FLAG] <= 1 and problem[0] == 0:
                problem[0] = _begin_record(letter, ids[k, 1], seen, plan, into, n)
            if problem[0]:
                return n
            _satellite_2(text, place, letter, plan, into, problem)
            if problem[0]:
                return n
            into.taken[0] += row[FLAG] <= 1 and ids[k, 1] <= plan.limits[letter, 1]
        if row[FLAG] <= 1:
            last = row[TICKS]
        row[END] = min(place[0], len(text))
        n += 1
    return n
