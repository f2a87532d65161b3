"""The compiled reading of RINEX's fields of numbers, F14.3 with two indicators behind."""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.io.rinex.text import Bytes
from fgnav.kernels.compiled import inlined, kernel

_BLANK, _DOT, _MINUS, _ZERO, _NINE = 32, 46, 45, 48, 57
_NUMBER, _FIELD = 14, 16  # columns


@inlined
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


@inlined
def _lock(text: Bytes, at: int, stop: int) -> int:
    """Return the loss-of-lock indicator behind a number; -1 where one of the two is no digit."""
    lock = text[at] if at < stop else _BLANK
    strength = text[at + 1] if at + 1 < stop else _BLANK
    if not (lock == _BLANK or _ZERO <= lock <= _NINE):
        return -1
    if not (strength == _BLANK or _ZERO <= strength <= _NINE):
        return -1
    return 0 if lock == _BLANK else lock - _ZERO


@kernel
def fields(
    text: Bytes,
    spans: IntArray,
    columns: int,
    units: FloatArray,
    values: FloatArray,
    locks: IntArray,
) -> IntArray:
    """Read the fields of satellites.

    Parameters
    ----------
    text : ndarray of uint8
    spans : ndarray, (r, l, 2)
        Where the fields of each of a satellite's lines begin, and where the line ends.
    columns : int
        Fields a line.
    units : ndarray, (t,)
        Thousandths in a unit, by type.
    values, locks : ndarray, (r, t)
        Filled: numbers, 0 where there is none, and loss-of-lock indicators.

    Returns
    -------
    ndarray, (r, 2)
        Line and column, from 1 on, of the first field that is broken; column 0 of none.
    """
    broken = np.zeros((len(spans), 2), np.int64)
    types = len(units)
    for r in range(len(spans)):
        for k in range(types):
            line, column = k // columns, k % columns
            start, stop = spans[r, line, 0], spans[r, line, 1]
            at = start + _FIELD * column
            value, state = _thousandths(text, at, stop)
            lock = _lock(text, at + _NUMBER, stop)
            is_last = column == columns - 1 or k == types - 1
            if state == 2 or lock < 0:
                broken[r] = line, at - start + 1
                break
            if is_last and stop > at + _FIELD:
                broken[r] = line, at - start + _FIELD + 1
                break
            values[r, k], locks[r, k] = value / units[k], lock
    return broken


@kernel
def line_ends(text: Bytes, begins: IntArray, ends: IntArray) -> None:
    """Move the ends of lines, (l,), before the blanks that end them."""
    for k in range(len(ends)):
        while ends[k] > begins[k] and (text[ends[k] - 1] == _BLANK or text[ends[k] - 1] == 13):
            ends[k] -= 1
