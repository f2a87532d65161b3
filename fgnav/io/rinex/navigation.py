"""RINEX navigation files as ``BroadcastOrbits``: messages that are whole; the others are counted.

Columns of a message's numbers are those of RINEX 3.05 [1]_, which RINEX 2 and 4 share but for the
head of a record.

References
----------
.. [1] RINEX: The Receiver Independent Exchange Format Version 3.05, 2020, tables A6, A8, A14.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, FloatArray, unused_of
from fgnav.io.gps_time import BDT_BEHIND_GPS_S, WEEK_S, date_to_gps_s
from fgnav.io.rinex.constellations import CONSTELLATIONS, USED, is_known
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.text import Bytes
from fgnav.types.orbits import EPHEMERIS_DTYPE, BroadcastOrbits

# Names of a message's numbers, "" of what is not kept; a record has those of its own fields.
COLUMNS: tuple[str, ...] = ("af0_s", "af1_sps", "af2_sps2", "issue", "crs_m")
COLUMNS += ("mean_motion_difference_radps", "mean_anomaly_rad", "cuc_rad", "eccentricity")
COLUMNS += ("cus_rad", "root_a", "toe_sow_s", "cic_rad", "node_rad", "cis_rad", "inclination_rad")
COLUMNS += ("crc_m", "perigee_rad", "node_rate_radps", "inclination_rate_radps", "data_source")
COLUMNS += ("week", "", "accuracy_m", "health", "delay_1_s", "delay_2_s", "transmission_s", "fit")
FIELDS = tuple(name for name in COLUMNS if name in (EPHEMERIS_DTYPE.names or ()))
_MAY_BE_BLANK = ("", "data_source", "delay_1_s", "delay_2_s", "transmission_s", "fit")
_NEEDED = [k for k, name in enumerate(COLUMNS) if name not in _MAY_BE_BLANK]
BDT_WEEK = 1356  # GPS week of BeiDou's week 0
# Nominal user range accuracy by index, m: IS-GPS-200N, 20.3.3.3.1.3; 15 states none.
URA_M = np.array(
    [2.4, 3.4, 4.85, 6.85, 9.65, 13.65, 24, 48, 96, 192, 384, 768, 1536, 3072, 6144, 8192]
)
_NO_ACCURACY_M = 8192.0
_LARGEST_SISA_M = 6.0  # OS SIS ICD 2.1, table 89
_DAY_S = 86_400.0
_WEEKS = 1024  # after which receivers' week numbers begin anew
_WIDTH, _ROWS = 19, 8  # of a field, of a message
_DECODED = ("LNAV", "INAV", "FNAV", "D1", "D2")  # RINEX 4 messages laid out as in RINEX 3
_DATE = r"((?: {year})(?: [ \d]\d){{5}})"
_BEGIN = {
    2: re.compile(r"([ \d]\d) ?" + _DATE.format(year=r"[ \d]\d") + r"\.\d"),
    3: re.compile(r"([A-Z][ \d]\d) ?" + _DATE.format(year=r"\d{4}")),
    4: re.compile(r"> (\w{3}) ([A-Z][ \d]{2}) ?(\w*)"),
}
# Of a field's width: else columns were lost or put in.
_NUMBER = re.compile(r"(?=.{19}$) *[-+]?\d*\.\d+[DEde][-+]\d\d *")


class _Message(NamedTuple):
    satellite: str
    clock_time_s: float  # since 1980-01-06, in the constellation's own time
    numbers: tuple[float, ...]  # 31


def to_broadcast(
    headers: Sequence[Header], texts: Sequence[Bytes], start_gps_s: float
) -> BroadcastOrbits:
    """Return the messages of several files, each once.

    Messages that are cut, have an impossible orbit or are repeated are counted as unused.
    """
    counts, what = Counter[tuple[str, str]](), "broadcast message"
    first = dict[str, str]()  # reasons with the line that broke the rule first
    messages, models = list[_Message](), list[FloatArray]([np.zeros(8)])
    for header, text in zip(headers, texts, strict=True):
        body = text[header.size :].tobytes().decode("latin-1").rstrip("\x1a\0")
        for number, lines in _split(body, int(header.version)):
            message = _message(header, lines)
            if isinstance(message, _Message):
                messages.append(message)
                continue
            kind, reason = message
            if kind == what:
                line = header.lines + number
                reason = first.setdefault(reason, f"{reason}, line {line} first")
            counts[kind, reason] += 1
        is_broken = any(kind == what for kind, _ in counts)
        if body.strip() and not (body.endswith("\n") or is_broken):
            reason = "the last line has no line end: it may be cut"
            counts[f"{header.path.name} line end", reason] = 1
        model = _klobuchar(header, body)
        models += [model] if model.any() else []
    records = np.zeros(0, EPHEMERIS_DTYPE)
    if messages:
        records, fits = _records(messages, start_gps_s)
        possible = _physically_possible(records) & fits
        counts[what, "impossible orbit or time"] += int((~possible).sum())
        records, repeated = _each_once(records[possible])
        counts[what, "repeated"] += repeated
    if not len(records):
        broken = (f"{what}: {why}" for (what, why), n in counts.items() if n)
        reason = next(broken, "the file has no message")
        raise BadInputError(
            f"{headers[0].path}: must hold a GPS, Galileo, BeiDou or QZSS message, has none; "
            f"{reason}"
        )
    unused = unused_of(dict(sorted(counts.items())))
    return BroadcastOrbits(records=records, klobuchar=models[-1], unused=unused)


def _message(header: Header, lines: Sequence[str]) -> "_Message | tuple[str, str]":
    """Return the message of a record, or what the record is and why it is not used."""
    version = int(header.version)
    begin = _BEGIN[version].match(lines[0])
    if begin is None:
        return "broadcast message", "begins with no satellite and date"
    kind, name, of = begin.groups() if version == 4 else ("EPH", begin[1], "")
    name = (f"{header.system}{name}" if version == 2 else name).replace(" ", "0")
    if kind != "EPH":
        return f"{kind} record", "not an ephemeris"
    if name[0] not in USED or name[0] == "R":
        owner = CONSTELLATIONS.get(name[0])
        return f"{owner.name if owner else name[0]} message", "constellation not used"
    if of and of not in _DECODED:
        return f"{name[0]} {of} message", "type not used"
    if not is_known(name):
        return f"{name} message", "of a number that is not used"
    decoded = _decoded(name, lines[version == 4 :], min(version, 3))
    return ("broadcast message", decoded) if isinstance(decoded, str) else decoded


def _split(body: str, version: int) -> Iterator[tuple[int, list[str]]]:
    """Yield records and the numbers of their first lines, which are not indented."""
    lines, first = list[str](), 1
    for number, line in enumerate(body.splitlines(), 1):
        is_first = line[:1] == ">" if version == 4 else line[:2].strip()
        if lines and is_first:
            yield first, lines
            lines = []
        if line.strip():
            first = first if lines else number
            lines.append(line)
    if lines:
        yield first, lines


def _decoded(name: str, lines: Sequence[str], version: int) -> _Message | str:
    """Return the message of a record's lines, or the rule that it breaks."""
    begin = _BEGIN[version].match(lines[0]) if lines else None
    if begin is None or len(lines) != _ROWS:
        return f"must have {_ROWS} lines, the first with its date"
    year, *others = begin[2].split()
    century = ("19" if int(year) >= 80 else "20") if version == 2 else ""
    time_s = date_to_gps_s([century + year.zfill(2), *others])
    if not time_s >= 0:
        return "must have a date"
    shift = begin.end() - _WIDTH  # of fields: a date may stand a column late
    words = [lines[0][shift + _WIDTH * k :][:_WIDTH] for k in range(1, 4)]
    later = 3 if version == 2 else 4
    words += [line[later + _WIDTH * k :][:_WIDTH] for line in lines[1:] for k in range(4)]
    words = [word if k < len(COLUMNS) and word.strip() else "" for k, word in enumerate(words)]
    is_whole = all(words[k] for k in _NEEDED)
    is_whole &= not any(line[later + 4 * _WIDTH :].strip() for line in lines[1:])
    if not is_whole or not all(_NUMBER.fullmatch(word) for word in words if word):
        return "must hold numbers such as -1.234567890123E-04"
    numbers = (float(word.upper().replace("D", "E") or "0") for word in words)
    return _Message(name, time_s, tuple(numbers))


def _records(
    messages: Sequence[_Message], start_gps_s: float
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return messages in our own names and units, and whether their weeks are those of their dates.

    The time of ephemeris is the one nearest to the time of clock: week numbers may have begun anew.
    """
    x = dict(zip(COLUMNS, np.array([message.numbers for message in messages]).T, strict=False))
    names = np.array([message.satellite for message in messages], "U3")
    galileo, beidou = (np.char.startswith(names, letter) for letter in "EC")
    behind_s = BDT_BEHIND_GPS_S * beidou
    # since 1980, as are those below
    toc_s = np.array([message.clock_time_s for message in messages]) + behind_s
    toe_s = _nearest_s(x["toe_sow_s"] + behind_s, toc_s)
    ttr_s = _nearest_s(x["transmission_s"] + behind_s, toe_s)
    # An unknown time of transmission is written 0.9999E+09 or left blank.
    stated = (np.abs(x["transmission_s"]) < 2 * WEEK_S) & (np.abs(ttr_s - toe_s) < _DAY_S)
    accuracy_m = x["accuracy_m"]
    sisa_m = np.where((accuracy_m >= 0) & (accuracy_m <= _LARGEST_SISA_M), accuracy_m, np.inf)
    ura_m = URA_M[np.searchsorted(URA_M, accuracy_m).clip(0, 15)]
    second_s = x["delay_2_s"] * (galileo | beidou)  # else there stands the issue of the clock
    values = {name: x[name] for name in FIELDS} | {
        "satellite": names,
        "toe_s": toe_s - start_gps_s,
        "toc_s": toc_s - start_gps_s,
        "transmission_s": np.where(stated, ttr_s, toe_s) - start_gps_s,
        "semi_major_axis_m": x["root_a"] ** 2,
        "group_delay_s": np.stack([x["delay_1_s"], second_s], axis=1),
        "accuracy_m": np.minimum(np.where(galileo, sisa_m, ura_m), _NO_ACCURACY_M),
        "data_source": np.where(galileo, x["data_source"], 0),
    }
    records = np.zeros(len(names), EPHEMERIS_DTYPE)
    for name, column in values.items():
        records[name] = column
    weeks = x["week"] + BDT_WEEK * beidou - np.floor(toe_s / WEEK_S)
    return records, np.abs((weeks + _WEEKS // 2) % _WEEKS - _WEEKS // 2) <= 1


def _nearest_s(second_of_week: FloatArray, near_s: FloatArray) -> FloatArray:
    """Return the times of seconds of a week that lie nearest to others."""
    return np.asarray(near_s + (second_of_week - near_s + WEEK_S / 2) % WEEK_S - WEEK_S / 2)


def _physically_possible(records: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell which messages describe an Earth orbit, with a clock of about the same time."""
    a, e = records["semi_major_axis_m"], records["eccentricity"]
    orbit = (a > 1e7) & (a < 1e8) & (e >= 0) & (e < 0.5)
    return np.asarray(orbit & (np.abs(records["toe_s"] - records["toc_s"]) < _DAY_S))


def _each_once(records: NDArray[Any]) -> tuple[NDArray[Any], int]:
    """Return the records without repetitions, and how many there were.

    Two messages that differ only in their time of transmission are the same; the first one counts.
    """
    order = np.lexsort((records["transmission_s"], records["toe_s"], records["satellite"]))
    records = records[order]
    content = records.copy()
    content["transmission_s"] = 0.0
    _, first = np.unique(content, return_index=True)
    return records[np.sort(first)], len(records) - len(first)


def _klobuchar(header: Header, body: str) -> FloatArray:
    """Return the GPS ionosphere: of the head, or of the last RINEX 4 record of it."""
    matches = list(re.finditer(r"^> ION G\d\d LNAV[^\n]*\n(.*\n.*\n.*)", body, re.MULTILINE))
    if header.version < 4 or not matches:
        return np.array(header.klobuchar)
    lines = matches[-1][1].splitlines()
    words = [line[4 + _WIDTH * k : 4 + _WIDTH * (k + 1)] for line in lines for k in range(4)]
    try:
        return np.array([float(word.upper().replace("D", "E")) for word in words[1:9]])
    except ValueError:
        raise BadInputError(
            f"{header.path}: ION record must hold eight numbers, got {lines[0][:60]!r}"
        ) from None
