"""GPS time in files: dates, leap seconds, and whole ticks of the 1e-7 s that RINEX writes."""

import math
from collections.abc import Sequence
from datetime import datetime, timedelta

import numpy as np

from fgnav.checks import FloatArray

GPS_EPOCH = np.datetime64("1980-01-06T00:00:00", "us")
TICKS_PER_S = 10_000_000
BDT_BEHIND_GPS_S = 14  # fixed since 2006-01-01
# Whole seconds behind GPS time, of BeiDou's since 2006; of TAI ahead.
BEHIND_GPS_S = {"GPS": 0.0, "GAL": 0.0, "QZS": 0.0, "BDT": float(BDT_BEHIND_GPS_S), "TAI": -19.0}
SCALES = (*BEHIND_GPS_S, "UTC", "GLO")  # GLONASS's time is UTC in files
UNIX_OF_GPS_S = 315_964_800  # 1980-01-06 in POSIX time, leap seconds not counted
WEEK_S = 604_800
_SECONDS = 61  # of a minute, one of them a leap second
# GPS minus UTC grew by a second at each of these (IERS Bulletin C; none announced since).
LEAPS = np.array(
    [
        *("1981-07", "1982-07", "1983-07", "1985-07", "1988-01", "1990-01"),
        *("1991-01", "1992-07", "1993-07", "1994-07", "1996-01", "1997-07"),
        *("1999-01", "2006-01", "2009-01", "2012-07", "2015-07", "2017-01"),
    ],
    dtype="datetime64[M]",
).astype("datetime64[us]")


def to_ticks(gps_s: float) -> int:
    """Return seconds since 1980-01-06 in ticks; a product in double precision would lose one."""
    seconds = math.floor(gps_s)
    return seconds * TICKS_PER_S + round((gps_s - seconds) * TICKS_PER_S)


def date_to_gps_s(words: Sequence[str]) -> float:
    """Return seconds since 1980-01-06 of year, month, day, hour, minute, second; NaN of none."""
    try:
        year, month, day, hour, minute = (int(word) for word in words[:5])
        second = float(words[5])
        date = datetime(year, month, day, hour, minute)
    except (ValueError, IndexError):
        return math.nan
    if not 0 <= second < _SECONDS:
        return math.nan
    return (date - GPS_EPOCH.item()) / timedelta(seconds=1) + second


def gps_s_to_date(gps_s: float) -> tuple[int, ...]:
    """Return year, month, day, hour, minute and whole second of seconds since 1980-01-06."""
    date: datetime = GPS_EPOCH.item() + timedelta(seconds=math.floor(gps_s))
    return date.timetuple()[:6]


def gps_of_utc(unix_s: FloatArray) -> FloatArray:
    """Return (k,) GPS seconds since 1980-01-06 of POSIX times, which are UTC."""
    leaps_s = (LEAPS - np.datetime64(0, "s")) / np.timedelta64(1, "s")
    return np.asarray(unix_s - UNIX_OF_GPS_S + np.searchsorted(leaps_s, unix_s, side="right"))


def gps_of(time_s: FloatArray, scale: str) -> FloatArray:
    """Return (k,) GPS seconds since 1980-01-06 of those of one of ``SCALES``."""
    if scale in BEHIND_GPS_S:
        return np.asarray(time_s + BEHIND_GPS_S[scale])
    return gps_of_utc(time_s + UNIX_OF_GPS_S)


def utc_of_gps(gps: np.ndarray) -> np.ndarray:
    """Return (k,) UTC of GPS times, both datetime64."""
    lead = np.arange(1, len(LEAPS) + 1).astype("timedelta64[s]")
    leaps = np.searchsorted(LEAPS + lead, gps, side="right").astype("timedelta64[s]")
    return np.asarray(gps - leaps)
