"""Receivers' sentences, NMEA 0183 [1]_: fixes of GGA, sigmas of GST, headings of HDT, THS, PASHR.

Sentences have the UTC time of day; RMC and ZDA date them, and days are counted across midnight from
the latest date before. HDT and THS have no time: theirs is that of the sentence before. Heights are
those above the sea plus the undulation.

References
----------
.. [1] NMEA 0183, Standard for Interfacing Marine Electronic Devices, version 4.11, 2018, section 6.
"""

from collections.abc import Sequence
from datetime import date, time
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.io.gps_time import UNIX_OF_GPS_S, gps_of_utc
from fgnav.io.importers.formats.solution import Solution

READ = ("GGA", "RMC", "ZDA", "GST", "HDT", "THS", "PASHR")
_DAY_S = 86_400.0
_FIRST_DAY = date(1970, 1, 1).toordinal()
_NO_FIX = {0: "the receiver had no fix", 6: "dead reckoning", 7: "manual", 8: "simulated"}


def take(path: Path, sentences: Sequence[Any], near_s: float | None, into: Solution) -> None:
    """Add what sentences state.

    Parameters
    ----------
    sentences : sequence
        Of pynmeagps, in the order of the file.
    near_s : float or None
        GPS time within half a day of the first: it dates sentences without RMC and ZDA.

    Raises
    ------
    BadInputError
        If no date is found.
    """
    at_s = np.full(len(sentences), np.nan)  # of day
    days: list[int | None] = []
    for k, one in enumerate(sentences):
        at_s[k] = _time_of_day(one, at_s[k - 1] if k else np.nan)
        day = _date(one)
        days.append(None if day is None else day.toordinal() - _FIRST_DAY)
    gps_s = gps_of_utc(_unix_s(path, at_s, days, near_s))
    into.date_s = float(np.nanmax(gps_s, initial=0.0))
    for one, t in zip(sentences, np.round(gps_s, 3).tolist(), strict=True):
        if not np.isfinite(t):
            into.counts[f"{one.msgID} sentence", "has no time"] += 1
        else:
            _take(one, t, into)


def _take(one: Any, t: float, into: Solution) -> None:  # noqa: ANN401
    """Add what one sentence states."""
    name = one.msgID
    stated = name == "ZDA"
    if name == "GGA":
        stated = _take_fix(one, t, into)
    elif name == "GST" and (stated := "" not in (one.stdLat, one.stdLong, one.stdAlt)):
        into.place_sigma[t] = (one.stdLat, one.stdLong, one.stdAlt)
    elif name == "RMC" and (stated := one.spd != ""):
        into.counts["RMC sentence", "speed and course without a vertical velocity"] += 1
    elif name in ("HDT", "THS", "ASHR") and (row := _heading(one)) is not None:
        stated = True
        into.heading[t] = row
    if not stated:
        into.counts[f"{name} sentence", "states nothing"] += 1


def _take_fix(one: Any, t: float, into: Solution) -> bool:  # noqa: ANN401
    """Add a fix, or count why it is none; return False where it has no place."""
    if one.quality in _NO_FIX or one.quality == "":
        into.counts["GGA sentence", _NO_FIX[one.quality or 0]] += 1
        return True
    if "" in (one.lat, one.lon, one.alt):
        return False
    if one.sep == "":
        into.above_sea = True
    into.place[t] = (one.lat, one.lon, one.alt + (one.sep or 0.0))
    return True


def _heading(one: Any) -> tuple[float, ...] | None:  # noqa: ANN401
    """Return heading, pitch and their sigmas, deg, NaN of what is not stated."""
    nothing = (np.nan,) * 3
    if one.msgID == "HDT":
        return None if one.headingT == "" else (one.headingT, *nothing)
    if one.msgID == "THS":
        return None if one.headt == "" or one.mi != "A" else (one.headt, *nothing)
    if getattr(one, "trueHdg", "") == "" or not one.gnssQual:
        return None
    others = (np.nan if x == "" else x for x in (one.pitch, one.hdgAcc, one.pitchAcc))
    return (one.trueHdg, *others)


def _time_of_day(one: Any, before_s: float) -> float:  # noqa: ANN401
    """Return UTC seconds of the day, those before where a sentence has none of its own."""
    at = getattr(one, "time", getattr(one, "utctime", None))
    if at is None:
        return before_s
    if not isinstance(at, time):
        return np.nan
    return 3600.0 * at.hour + 60.0 * at.minute + at.second + 1e-6 * at.microsecond


def _date(one: Any) -> date | None:  # noqa: ANN401
    """Return a sentence's date, if it has one."""
    if one.msgID == "RMC" and one.status == "A" and isinstance(one.date, date):
        return one.date
    if one.msgID == "ZDA" and "" not in (one.year, one.month, one.day):
        return date(one.year, one.month, one.day)
    return None


def _unix_s(
    path: Path, at_s: FloatArray, days: Sequence[int | None], near_s: float | None
) -> FloatArray:
    """Return POSIX times of times of day."""
    timed = np.isfinite(at_s)
    filled = at_s[timed]
    midnights = np.zeros(len(at_s))
    midnights[timed] = np.cumsum(np.diff(filled, prepend=filled[:1]) < -_DAY_S / 2)
    dated = [k for k, day in enumerate(days) if day is not None and timed[k]]
    first = [np.float64(days[k] or 0) - midnights[k] for k in dated]
    if not dated:
        if near_s is None or not timed.any():
            raise BadInputError(
                f"{path}: no RMC or ZDA sentence has a date; state start in --settings, within "
                "half a day"
            )
        dated, first = [0], [np.round((near_s + UNIX_OF_GPS_S - filled[0]) / _DAY_S)]
    latest = np.searchsorted(dated, np.arange(len(at_s)), side="right") - 1
    return (np.array(first)[np.maximum(latest, 0)] + midnights) * _DAY_S + at_s
