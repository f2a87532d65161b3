"""Receivers' sentences, NMEA 0183 [1]_: fixes of GGA, dates of RMC and ZDA, sigmas of GST.

Sentences have the UTC time of day; days are counted across midnight from the nearest date. Heights
are those above the sea plus the undulation. Speed and course of RMC have no vertical part and are
not used.

References
----------
.. [1] NMEA 0183, Standard for Interfacing Marine Electronic Devices, version 4.11, 2018, section 6.
"""

import re
from collections import Counter
from collections.abc import Iterator
from datetime import date
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray, Loss, quoted
from fgnav.io.flight import columns as col
from fgnav.io.flight.toml import gps_seconds
from fgnav.io.gps_time import UNIX_OF_GPS_S, gps_of_utc
from fgnav.io.importers.recording import Recording, vectors
from fgnav.io.importers.settings import Settings
from fgnav.io.tables import is_number
from fgnav.io.user_files import read_bytes

SENTENCE = re.compile(rb"\$([A-Z]{2,6}),([\x20-\x7e]*)\*([0-9A-Fa-f]{2})(?:\r?\n|$)")
_DAY_S = 86_400.0
_NO_FIX = {"0": "the receiver had no fix", "6": "dead reckoning", "7": "manual", "8": "simulated"}
_DATED = ("RMC", "ZDA")
_FIELDS = {"GGA": 11, "RMC": 9, "ZDA": 4, "GST": 8}  # at least
_TIME = re.compile(r"\d{6}(?:\.\d*)?")


def read_nmea(path: Path, settings: Settings, _scratch: Path) -> Recording:
    """Read fixes; ``start`` of the settings dates a file without RMC and ZDA.

    Raises
    ------
    BadInputError
        If there is no fix with a height, or no date.
    """
    counts: Counter[tuple[str, str]] = Counter()
    times: list[float] = []  # of day, of every sentence that has one
    days: list[int | None] = []  # since 1970, where the sentence has a date
    fixes: list[tuple[int, list[str]]] = []  # number of the time, fields
    sigmas: dict[str, list[str]] = {}  # by time of day
    for name, fields in _sentences(read_bytes(path), counts):
        if name == "GST":
            sigmas[fields[0]] = fields
            continue
        hour, minute, second = fields[0][:2], fields[0][2:4], fields[0][4:]
        times.append(3600.0 * int(hour) + 60.0 * int(minute) + float(second))
        days.append(_day(path, name, fields) if name in _DATED else None)
        if name == "GGA":
            fixes.append((len(times) - 1, fields))
    if not fixes:
        raise BadInputError(
            f"{path}: must hold GGA sentences with a fix, has none; look whether the receiver put "
            "them out, or import its raw measurements"
        )
    at_s = _unix_s(path, np.array(times), days, settings)[[k for k, _ in fixes]]
    gps_s = gps_of_utc(at_s)
    start_s = float(np.floor(gps_s[0]))
    undulation = [one[10] for _, one in fixes]
    place = np.array(
        [
            [_degrees(f[1], f[2]), _degrees(f[3], f[4]), _number(f[8]) + _number(f[10] or "0")]
            for _, f in fixes
        ]
    )
    table = {"t_s": gps_s - start_s, **vectors(col.PLACE, place)}
    stated = [sigmas.get(one[0]) for _, one in fixes]
    if all(stated):
        sigma_m = np.array([[_number(x) for x in one[5:8]] for one in stated if one])
        table |= vectors(col.POSITION_SIGMA, sigma_m)
    elif sigmas:
        counts["GST sentence", "not every fix has one"] += len(sigmas)
    return Recording(
        source=path,
        tables={"fixes": table},
        gps_start_s=start_s,
        losses=tuple(Loss(what=w, reason=why, count=n) for (w, why), n in counts.items()),
        notes={} if all(undulation) else {"fixes": "heights are above the sea: no undulation"},
    )


def _sentences(content: bytes, counts: Counter[tuple[str, str]]) -> Iterator[tuple[str, list[str]]]:
    """Yield name and fields of each sentence that is used; count the others by their reason."""
    for match in SENTENCE.finditer(content):
        name, body = match[1].decode()[-3:], match[2]
        fields = body.decode("ascii").split(",")
        if reduce(xor, match[1] + b"," + body) != int(match[3], 16):
            counts["sentence", "its checksum is wrong"] += 1
        elif name not in ("GGA", "GST", *_DATED):
            counts[f"{name} sentence", "not read"] += 1
        elif len(fields) < _FIELDS[name] or not _TIME.fullmatch(fields[0]):
            counts[f"{name} sentence", "has no time"] += 1
        elif name == "GGA" and fields[5] in ("", *_NO_FIX):
            counts["GGA sentence", _NO_FIX[fields[5] or "0"]] += 1
        elif name == "RMC" and fields[1] != "A":
            counts["RMC sentence", "the receiver had no fix"] += 1
        else:
            if name == "RMC" and fields[6]:
                counts["RMC sentence", "speed and course without a vertical velocity"] += 1
            yield name, fields
    outside = len(SENTENCE.sub(b"", content))
    if outside:
        counts["byte", "in no whole sentence"] += outside


def _day(path: Path, name: str, fields: list[str]) -> int | None:
    """Return days since 1970 of a sentence's date; None where it has none."""
    words = (fields[8][4:], fields[8][2:4], fields[8][:2]) if name == "RMC" else fields[3:0:-1]
    if not all(words):
        return None
    year, month, day = words
    try:
        full = int(year) + (0 if len(year) == 4 else 1900 if int(year) >= 80 else 2000)
        return date(full, int(month), int(day)).toordinal() - date(1970, 1, 1).toordinal()
    except ValueError:
        got = quoted(",".join(fields))
        raise BadInputError(f"{path}: {name}: must have a date, got {got}") from None


def _unix_s(
    path: Path, times: FloatArray, days: list[int | None], settings: Settings
) -> FloatArray:
    """Return POSIX times of times of day: each counts its days from the last date before it."""
    midnights = np.cumsum(np.diff(times, prepend=times[0]) < -_DAY_S / 2)
    dated = [k for k, day in enumerate(days) if day is not None]
    first = [np.float64(days[k] or 0) - midnights[k] for k in dated]
    if not dated:
        if settings.start is None:
            raise BadInputError(
                f"{path}: no RMC or ZDA sentence has a date; state start in --settings, within "
                "half a day"
            )
        near_s = gps_seconds(path, settings.start) + UNIX_OF_GPS_S - times[0]
        dated, first = [0], [np.round(near_s / _DAY_S)]
    latest = np.searchsorted(dated, np.arange(len(times)), side="right") - 1
    return (np.array(first)[np.maximum(latest, 0)] + midnights) * _DAY_S + times


def _number(text: str) -> float:
    return float(text) if is_number(text) else np.nan


def _degrees(text: str, hemisphere: str) -> float:
    """Return degrees of dddmm.mmmm."""
    point = text.find(".") if "." in text else len(text)
    size = _number(text[: point - 2] or "0") + _number(text[point - 2 :]) / 60
    return -size if hemisphere in ("S", "W") else size
