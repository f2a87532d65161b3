"""Compiled scan of a RINEX navigation body; conventions as in ``kernels``."""

from fgnav.checks import IntArray
from fgnav.io.rinex.kernels import days, line_end, trimmed, whole
from fgnav.io.rinex.text import Bytes
from fgnav.kernels.compiled import inlined, inner, kernel

# Columns of the table of messages.
START, END, LINE, LETTER, NUMBER = range(5)
_BLANK, _GREATER, _G, _R, _S = 32, 62, 71, 82, 83


@inner
def _digits(text: Bytes, start: int, end: int) -> int:
    """Return the offset after the digits from ``start`` on."""
    i = start
    while i < end and 48 <= text[i] <= 57:
        i += 1
    return i


@inlined
def _number(text: Bytes, start: int, stop: int) -> int:
    """Return 0 of a blank field of 19 columns, 1 of a number, -1 of anything else."""
    first, end = start, trimmed(text, start, max(start, min(start + 19, stop)))
    while first < end and text[first] == _BLANK:
        first += 1
    if first >= end:
        return 0
    first += text[first] == 45 or text[first] == 43  # sign
    whole_end = _digits(text, first, end)
    point = whole_end < end and text[whole_end] == 46
    i = _digits(text, whole_end + 1, end) if point else whole_end
    if i - first - point == 0:
        return -1
    if i == end:
        return 1
    letter = text[i] in (68, 69, 100, 101)  # D, E, d, e
    signed = end - i in (3, 4) and text[i + 1] in (43, 45)
    return 1 if letter and signed and _digits(text, i + 2, end) == end else -1


@inlined
def _lines_of(letter: int) -> int:
    """Return how many lines a message of RINEX 2 or 3 has (4 of GLONASS and SBAS, else 8)."""
    return 4 if letter in (_R, _S) else 8


@inlined
def _epoch_fits(text: Bytes, p: int, version: int, stop: int) -> bool:
    """Tell whether a message's head holds a date, from ``p`` on."""
    year = whole(text, p, p + 2, stop) if version == 2 else whole(text, p, p + 4, stop)
    p += 2 if version == 2 else 4
    if version == 2 and year >= 0:
        year += 1900 if year >= 80 else 2000
    day = days(year, whole(text, p + 1, p + 3, stop), whole(text, p + 4, p + 6, stop))
    hour, minute = whole(text, p + 7, p + 9, stop), whole(text, p + 10, p + 12, stop)
    second = whole(text, p + 13, p + 15, stop)
    return day >= 0 and 0 <= hour < 24 and 0 <= minute < 60 and 0 <= second < 61


@inlined
def _required(row: int, field: int) -> bool:
    """Tell whether a field must not be blank: clock, orbit, week; not spares and flags."""
    return row <= 4 or (row == 5 and field in (0, 2)) or (row == 6 and field in (1, 2))


@inlined
def _check_message(
    text: Bytes, p: int, shift: int, lines: int, message: IntArray, problem: IntArray
) -> int:
    """Check the lines of one message; return the offset after it. ``problem`` tells of faults."""
    for row in range(lines):
        newline = line_end(text, p)
        problem[1], problem[2] = message[LINE] + row, 0
        if p >= len(text) or (row and (text[p] != _BLANK or text[p + 1] != _BLANK)):
            problem[0] = 2
            return p
        if newline == len(text):
            problem[0] = 4
            return p
        stop = trimmed(text, p, newline)
        for field in range(1 if row == 0 else 0, 4):
            state = _number(text, p + shift + 19 * field, stop)
            blank_wrong = state == 0 and _required(row, field)
            if state < 0 or blank_wrong:
                problem[0], problem[2] = (5 if blank_wrong else 3), shift + 19 * field + 1
                return p
        if stop > p + shift + 76:
            problem[0], problem[2] = 3, shift + 77
            return p
        p = newline + 1
    return p


@inlined
def _next_record(text: Bytes, p: int) -> tuple[int, int]:
    """Return the offset of the next line that starts with '>', and the lines until there."""
    lines = 0
    while p < len(text) and text[p] != _GREATER:
        p = line_end(text, p) + 1
        lines += 1
    return min(p, len(text)), lines


@inlined
def _is_decoded(text: Bytes, p: int, stop: int) -> bool:
    """Tell whether a RINEX 4 record ``> EPH G05 LNAV`` has the layout of RINEX 3."""
    if stop < p + 12 or not (text[p + 2] == 69 and text[p + 3] == 80):  # EP
        return False
    a, b = text[p + 10], text[p + 11]
    legacy = b == 78 and a in (76, 73, 70)  # LN, IN, FN
    return legacy or (a == 68 and b in (49, 50) and stop == p + 12)  # D1, D2


@kernel
def scan_messages(
    text: Bytes, start: IntArray, version: int, default: int, messages: IntArray, problem: IntArray
) -> int:
    """Scan the body of a RINEX 2, 3 or 4 navigation file.

    Parameters
    ----------
    text : ndarray of uint8
    start : ndarray, (2,)
        Offset of the body, number of its first line.
    version : int
        2, 3 or 4.
    default : int
        Letter of the constellation of a RINEX 2 file.
    messages : ndarray, (k, 5)
        Filled: one row per record.
    problem : ndarray, (3,)
        Filled with code, line, column.

    Returns
    -------
    int
        Rows filled.
    """
    p, line, n = start[0], start[1], 0
    while p < len(text):
        stop = trimmed(text, p, line_end(text, p))
        if stop == p:  # blank line at the end
            p, line = line_end(text, p) + 1, line + 1
            continue
        message = messages[n]
        message[START], message[LINE] = p, line
        problem[1], problem[2] = line, 0
        decoded = version < 4 or _is_decoded(text, p, stop)
        q = p
        if version == 4:
            if text[p] != _GREATER or stop < p + 10:
                problem[0] = 6
                return n
            message[LETTER], message[NUMBER] = text[p + 6], max(whole(text, p + 7, p + 9, stop), 0)
            q, message[LINE] = line_end(text, p) + 1, line + 1
        if decoded:
            stop = trimmed(text, q, line_end(text, q)) if q < len(text) else q
            letter = default if version == 2 else text[q]
            number = (
                whole(text, q, q + 2, stop) if version == 2 else whole(text, q + 1, q + 3, stop)
            )
            known = letter in (_G, 69, 67, 74, 73, _R, _S)
            fits = (
                known
                and number > 0
                and _epoch_fits(text, q + (3 if version == 2 else 4), version, stop)
            )
            if not fits or (
                version == 4 and (letter, number) != (message[LETTER], message[NUMBER])
            ):
                problem[0], problem[1] = 1, message[LINE]
                return n
            message[LETTER], message[NUMBER] = letter, number
            lines = _lines_of(letter)
            p = _check_message(text, q, 3 if version == 2 else 4, lines, message, problem)
            if problem[0]:
                return n
            line = message[LINE] + lines
            if version == 3 and letter == _R and p < len(text) and text[p] == _BLANK:
                p, line = line_end(text, p) + 1, line + 1  # fifth line since RINEX 3.05
        else:
            p, lines = _next_record(text, q)
            line = message[LINE] + lines
        message[END] = min(p, len(text))
        n += 1
    return n
