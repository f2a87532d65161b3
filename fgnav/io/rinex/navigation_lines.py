"""The lines of a RINEX navigation file, checked message by message.

Messages are few, a day of all constellations has some ten thousand: nothing here is compiled.
"""

import re
from collections.abc import Iterator
from datetime import date
from typing import NamedTuple

_ROWS = {"R": 4, "S": 4, "G": 8, "E": 8, "C": 8, "J": 8, "I": 8}  # lines of a message
_FIRST_DAY = date(1980, 1, 6)
_WIDTH = 19  # of a field
# Fields of each line that must not be blank: clock, orbit, week; spares and flags may be.
_REQUIRED = ((1, 2, 3), *[(0, 1, 2, 3)] * 4, (0, 2), (1, 2), ())
_USUAL = re.compile(rb"(?:(?: [ \d+-]|[+-]\d)\.\d{12}[DEde][+-]\d\d){0,4}")
_NUMBER = re.compile(rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[DEde][+-]\d\d?)?")
_EXPONENT = bytes.maketrans(b"Dd", b"EE")
_DECODED = re.compile(rb"> EP.{6}(?:[LIF]N|D[12]$)")  # RINEX 4 messages laid out as in RINEX 3


class BrokenLineError(Exception):
    """A line that breaks a rule of the format."""

    def __init__(self, line: int, rule: str) -> None:
        super().__init__(rule)
        self.line, self.rule = line, rule


class Message(NamedTuple):
    """Where a record stands, offsets in the text, and of which satellite and time it is."""

    start: int
    end: int
    satellite: str
    clock_time_s: float  # since 1980-01-06


def messages(text: bytes, start: int, line: int, version: int, default: str) -> Iterator[Message]:
    """Yield the records of the body of a RINEX 2, 3 or 4 navigation file.

    Parameters
    ----------
    text : bytes
    start, line : int
        Offset of the body, number of its first line.
    version : int
        2, 3 or 4.
    default : str
        The constellation of a RINEX 2 file.

    Raises
    ------
    BrokenLineError
    """
    p = start
    while p < len(text):
        content, after = _line(text, p)
        if not content:  # blank line at the end
            p, line = after, line + 1
            continue
        q, announced = p, ""
        if version == 4:
            if content[:1] != b">" or len(content) < 10:
                raise BrokenLineError(line, "a RINEX 4 record must start here with '> '")
            announced = _name(content, 6)
            q, line = after, line + 1
        if version < 4 or _DECODED.match(content):
            satellite, time_s = _satellite(_line(text, q)[0], version, default)
            if not satellite or announced not in ("", satellite):
                raise BrokenLineError(line, "a message must start here with its satellite and time")
            rows = _ROWS[satellite[0]]
            end = _checked(text, q, line, rows, 3 if version == 2 else 4)
            if version == 3 and satellite[0] == "R" and text[end : end + 1] == b" ":
                end, rows = _line(text, end)[1], rows + 1  # fifth line since RINEX 3.05
        else:
            satellite, end, time_s = announced, _next_record(text, q), 0.0
            rows = text.count(b"\n", q, end)
        yield Message(p, end, satellite, time_s)
        p, line = end, line + rows


def numbers(text: bytes, p: int, version: int) -> list[float]:
    """Return the 31 numbers of a checked message of eight lines; blank is 0."""
    shift = 3 if version == 2 else 4
    first, p = _line(text, p)
    fields = [first[k : k + _WIDTH] for k in range(shift + _WIDTH, shift + 4 * _WIDTH, _WIDTH)]
    for _ in range(7):
        line, p = _line(text, p)
        fields += [line[k : k + _WIDTH] for k in range(shift, shift + 4 * _WIDTH, _WIDTH)]
    values = (field.translate(_EXPONENT).strip() for field in fields)
    return [float(value or b"0") for value in values]


def _line(text: bytes, p: int) -> tuple[bytes, int]:
    """Return the line from an offset on, without blanks at its end, and the offset after it."""
    newline = text.find(b"\n", p)
    end = len(text) if newline < 0 else newline
    return text[p:end].rstrip(b" \r"), min(end + 1, len(text))


def _whole(line: bytes, start: int, width: int) -> int:
    """Return a right-adjusted whole number, -1 where there is none."""
    field = line[start : start + width].ljust(width).lstrip(b" ")
    return int(field) if field.isdigit() else -1


def _name(line: bytes, start: int) -> str:
    """Return a satellite's name; number 0 where none stands there."""
    letter = line[start : start + 1].decode("latin-1")
    return f"{letter}{max(_whole(line, start + 1, 2), 0):02d}"


def _satellite(line: bytes, version: int, default: str) -> tuple[str, float]:
    """Return satellite and time of a message's first line, "" where no satellite and date are."""
    name = f"{default}{max(_whole(line, 0, 2), 0):02d}" if version == 2 else _name(line, 0)
    p, width = (3, 2) if version == 2 else (4, 4)
    year = _whole(line, p, width)
    if version == 2 and year >= 0:
        year += 1900 if year >= 80 else 2000
    month, day, hour, minute, second = (_whole(line, p + width + 1 + 3 * k, 2) for k in range(5))
    try:
        days = (date(year, month, day) - _FIRST_DAY).days
    except ValueError:
        return "", 0.0
    fits = days >= 0 and 0 <= hour < 24 and 0 <= minute < 60 and 0 <= second < 61
    is_used = fits and name[0] in _ROWS and name[1:] != "00"
    return name if is_used else "", 86_400.0 * days + 3600.0 * hour + 60.0 * minute + second


def _checked(text: bytes, p: int, first: int, rows: int, shift: int) -> int:
    """Check the lines of one message, fields from column ``shift`` on; return the offset after."""
    for row in range(rows):
        if p >= len(text) or (row and not b"  ".startswith(text[p : p + 2])):
            raise BrokenLineError(first + row, "the message ends before its last line")
        if text.find(b"\n", p) < 0:
            raise BrokenLineError(first + row, "the last line is cut, it has no line end")
        line, p = _line(text, p)
        broken = _broken_field(line, shift, row)
        if broken:
            raise BrokenLineError(first + row, broken)
    return p


def _broken_field(line: bytes, shift: int, row: int) -> str:
    """Return what is wrong with a field of a message's line."""
    first = 1 if row == 0 else 0
    begin, last = shift + _WIDTH * first, shift + _WIDTH * 4
    needed = begin + _WIDTH * len(_REQUIRED[row]) if row < 5 else shift + _WIDTH * 3
    if needed <= len(line) <= last and _USUAL.fullmatch(line, begin):
        return ""
    for field in range(first, 4):
        p = shift + _WIDTH * field
        content = line[p : p + _WIDTH].rstrip(b" \r").lstrip(b" ")
        if not content and field in _REQUIRED[row]:
            return f"column {p + 1}: must not be blank"
        if content and not _NUMBER.fullmatch(content):
            return f"column {p + 1}: must be a number such as -1.234567890123E-04"
    if len(line) > last:
        return f"column {last + 1}: must be a number such as -1.234567890123E-04"
    return ""


def _next_record(text: bytes, p: int) -> int:
    """Return the offset of the next line that starts with '>', or the end of the text."""
    if text[p : p + 1] == b">":
        return p
    found = text.find(b"\n>", p)
    return len(text) if found < 0 else found + 1
