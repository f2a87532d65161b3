"""Receivers' own solutions: fixes, velocities, headings and baselines, by their time.

``LAYOUT`` says what is taken of each message. Sentences of NMEA 0183 [1]_ have the UTC time of day,
which is that nearest to the message before; RMC and ZDA date them, HDT and THS have the time of the
sentence before. Heights are those above the sea plus the undulation. u-blox's messages of before
NAV-PVT serve where nothing better is in the stream.

References
----------
.. [1] NMEA 0183, Standard for Interfacing Marine Electronic Devices, version 4.11, 2018, section 6.
"""

from collections import defaultdict
from collections.abc import Sequence
from datetime import UTC, date, datetime, time
from typing import Any, NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples
from fgnav.io.gps_time import UNIX_OF_GPS_S, WEEK_S, gps_of_utc
from fgnav.io.importers.formats.fields import Counts, Fields, Names, join_blocks
from fgnav.io.importers.recording import ABOVE_SEA

_MM, _CM, _MS, _DEG = 1e-3, 1e-2, 1e-3, 180 / np.pi
_DAY_S = 86_400.0
_NO_TOW = _NO_ACCURACY = 2**32 - 1  # of SBF, of u-blox before a fix
_MOST = 1e9  # SBF writes -2e10 where it has no value
# Of two sources that state the same, the first is taken.
_OLD_UBX = "NAV-POSLLH"
_SOURCES = ("ubx", "sbf", "novatel", _OLD_UBX, "nmea")
_NO_FIX = {0: "the receiver had no fix", 6: "dead reckoning", 7: "manual", 8: "simulated"}
_NO_FIX_3D = "the receiver had no fix of three dimensions"
_UNTIMED = (
    "headings of HDT and THS have the time of the sentence before; where a receiver puts them "
    "first, they are an epoch late: set it to put out GGA before"
)
_FIXES = (col.PLACE, col.POSITION_SIGMA, col.VELOCITY, col.VELOCITY_SIGMA)
_VECTORS = (col.BASELINE, col.POSITION_SIGMA)
_HEADINGS = (col.HEADING, col.PITCH, col.HEADING_SIGMA, col.PITCH_SIGMA)


def _headings(*names: str) -> tuple[Fields, ...]:
    return tuple(
        Fields("baseline", columns, (name,))
        for columns, name in zip(_HEADINGS, names, strict=False)
    )


# By message; those without fields have dates, or say which fixes are none.
LAYOUT: dict[str, tuple[Fields, ...]] = {
    "NAV-PVT": (
        Fields("fixes", col.PLACE, ("lat", "lon", "height"), (1.0, 1.0, _MM)),
        Fields("fixes", col.POSITION_SIGMA, ("hAcc", "hAcc", "vAcc"), _MM),
        Fields("fixes", col.VELOCITY, ("velN", "velE", "velD"), _MM),
        Fields("fixes", col.VELOCITY_SIGMA, ("sAcc", "sAcc", "sAcc"), _MM),
    ),
    "NAV-RELPOSNED": (
        Fields("baseline", col.BASELINE, ("relPosN", "relPosE", "relPosD"), _CM),
        Fields("baseline", col.POSITION_SIGMA, ("accN", "accE", "accD"), _MM),
    ),
    "NAV-POSLLH": (
        Fields("fixes", col.PLACE, ("lat", "lon", "height"), (1.0, 1.0, _MM)),
        Fields("fixes", col.POSITION_SIGMA, ("hAcc", "hAcc", "vAcc"), _MM),
    ),
    "NAV-VELNED": (
        Fields("fixes", col.VELOCITY, ("velN", "velE", "velD"), _CM),
        Fields("fixes", col.VELOCITY_SIGMA, ("sAcc", "sAcc", "sAcc"), _CM),
    ),
    "PVTGeodetic": (
        Fields("fixes", col.PLACE, ("Latitude", "Longitude", "Height"), (_DEG, _DEG, 1.0)),
        Fields("fixes", col.VELOCITY, ("Vn", "Ve", "Vu"), (1.0, 1.0, -1.0)),
    ),
    "PosCovGeodetic": (
        Fields(
            "fixes",
            col.POSITION_SIGMA,
            ("Cov_latlat", "Cov_lonlon", "Cov_hgthgt"),
            is_variance=True,
        ),
    ),
    "VelCovGeodetic": (
        Fields("fixes", col.VELOCITY_SIGMA, ("Cov_VnVn", "Cov_VeVe", "Cov_VuVu"), is_variance=True),
    ),
    "AttEuler": _headings("Heading", "Pitch"),
    "AttCovEuler": (
        Fields("baseline", col.HEADING_SIGMA, ("Cov_HeadHead",), is_variance=True),
        Fields("baseline", col.PITCH_SIGMA, ("Cov_PitchPitch",), is_variance=True),
    ),
    "BESTPOS": (
        Fields("fixes", col.PLACE, ("latitude", "longitude", "height")),
        Fields("fixes", col.POSITION_SIGMA, ("sigma_n", "sigma_e", "sigma_u")),
    ),
    "BESTVEL": (Fields("fixes", col.VELOCITY, ("north", "east", "up"), (1.0, 1.0, -1.0)),),
    **dict.fromkeys(
        ("HEADING", "HEADING2", "DUALANTENNAHEADING"),
        _headings("heading", "pitch", "sigma_heading", "sigma_pitch"),
    ),
    **dict.fromkeys(("GGA", "GNS"), (Fields("fixes", col.PLACE, ("lat", "lon", "alt")),)),
    "GST": (Fields("fixes", col.POSITION_SIGMA, ("stdLat", "stdLong", "stdAlt")),),
    "HDT": _headings("headingT"),
    "THS": _headings("headt"),
    "PASHR": _headings("trueHdg", "pitch", "hdgAcc", "pitchAcc"),
    **dict.fromkeys(("RMC", "ZDA", "NAV-SOL", "NAV-STATUS", "NAV-TIMEGPS"), ()),
}


class Solution(NamedTuple):
    """Tables of a stream's messages, each row with its GPS time."""

    tables: dict[str, Samples]
    is_dated: bool  # else times are of a week
    has_vectors: bool  # whether baselines are vectors, as of u-blox alone
    notes: dict[str, str]  # by key of flight.toml


def solution(
    messages: Sequence[tuple[str, str, Any]], near_s: float | None, counts: Counts
) -> Solution:
    """Return the solution that messages state; count what is not used.

    Parameters
    ----------
    messages : sequence of tuple
        Protocol, name, and the message as its library decodes it, in the order of the stream.
    near_s : float or None
        GPS time within half a day of the first: it dates a stream without dates.
    """
    rows, notes = defaultdict[tuple[str, str, Names], list[list[float]]](list), dict[str, str]()
    dates_s = [_date_s(name, message) for _, name, message in messages]
    latest_s = next((date_s for date_s in dates_s if date_s is not None), near_s)
    is_dated, solved = latest_s is not None, _solved(messages)
    for (protocol, name, message), date_s in zip(messages, dates_s, strict=True):
        latest_s = latest_s if date_s is None else date_s
        t_s = _time_s(protocol, message, date_s, latest_s)
        is_ubx = protocol == "ubx"
        reason = _no_use_of_ubx(name, message, solved) if is_ubx else _no_use(name, message)
        if t_s is None or reason:
            counts[f"{name} message", reason or "has no time"] += 1
            continue
        latest_s = t_s if is_dated else None
        notes |= {"baseline": _UNTIMED} if name in ("HDT", "THS") else {}
        for fields in LAYOUT[name]:
            values = {n: [_number(getattr(message, n, ""))] for n in fields.names}
            (x,) = fields.values(values)
            if fields.columns == col.PLACE and hasattr(message, "sep"):
                notes |= {"fixes": ABOVE_SEA} if message.sep == "" else {}
                x[2] += message.sep or 0.0
            source = _OLD_UBX if name in (_OLD_UBX, "NAV-VELNED") else protocol
            if np.isfinite(x).all():
                rows[source, fields.table, fields.columns].append([round(t_s, 3), *x.tolist()])
            else:
                absent = fields.columns[int(np.isfinite(x).argmin())]
                counts[f"{name} message", f"has no {absent}"] += 1
    has_vectors = any(columns == col.BASELINE for *_, columns in rows)
    groups = {"fixes": _FIXES, "baseline": _VECTORS if has_vectors else _HEADINGS}
    if has_vectors:
        headings = (len(some) for (*_, columns), some in rows.items() if columns == col.HEADING)
        counts["heading", "a baseline has it, too"] += sum(headings)
    tables = {
        table: join_blocks(
            table, [_block(rows, table, columns, counts) for columns in some], counts
        )
        for table, some in groups.items()
    }
    tables = {table: some for table, some in tables.items() if len(some["t_s"])}
    return Solution(tables, is_dated, has_vectors, notes)


def _block(
    rows: dict[tuple[str, str, Names], list[list[float]]],
    table: str,
    columns: Names,
    counts: Counts,
) -> tuple[Names, FloatArray, FloatArray]:
    """Return times and values of columns, of the first source that has them."""
    sources = [source for source in _SOURCES if (source, table, columns) in rows]
    for other in sources[1:]:
        count = len(rows[other, table, columns])
        counts[f"{columns[0]} of {other}", f"{sources[0]} has it, too"] += count
    x = np.array(rows[sources[0], table, columns] if sources else [], np.float64)
    x = x.reshape(-1, 1 + len(columns))
    return columns, x[:, 0], x[:, 1:]


def _number(value: Any) -> float:  # noqa: ANN401  # of a library
    return float(value) if value != "" and abs(float(value)) <= _MOST else np.nan


def _solved(messages: Sequence[tuple[str, str, Any]]) -> dict[int, bool]:
    """Return True of times of week at which u-blox says that it had a fix of three dimensions."""
    return {
        message.iTOW: bool(
            getattr(message, "gpsFixOk", getattr(message, "gpsfixOK", 0))
            and message.gpsFix in (3, 4)
        )
        for _, name, message in messages
        if name in ("NAV-SOL", "NAV-STATUS")
    }


def _no_use_of_ubx(name: str, message: Any, solved: dict[int, bool]) -> str:  # noqa: ANN401
    """Return why a message of u-blox is not used; nothing of one that is."""
    is_solved = solved.get(message.iTOW, not solved)
    if name == "NAV-PVT":
        is_solved = message.gnssFixOk and message.fixType in (3, 4)
    if name == _OLD_UBX:
        is_solved = is_solved and message.hAcc < _NO_ACCURACY
    if name == "NAV-RELPOSNED":
        if not (message.gnssFixOK and message.relPosValid and message.carrSoln):
            return "no baseline of carrier phases"
        if not message.isMoving or getattr(message, "relPosNormalized", False):  # not in version 0
            return "from a base that does not move with the vehicle, or without a length"
        return ""
    return "" if is_solved or not LAYOUT[name] else _NO_FIX_3D


def _no_use(name: str, message: Any) -> str:  # noqa: ANN401
    """Return why a message of another protocol is not used; nothing of one that is."""
    if getattr(message, "Error", 0) or not getattr(message, "is_computed", True):
        return "no solution was computed"
    if name == "GGA":
        return _NO_FIX.get(message.quality or 0, "")
    if name == "GNS" and set(message.posMode) <= set("NEMS"):
        return _NO_FIX[0]
    if name == "RMC":
        return "speed and course without a vertical velocity"
    if name == "THS" and message.mi != "A":
        return "the receiver had no heading"
    return "the receiver had no heading" * (name == "PASHR" and not getattr(message, "gnssQual", 0))


def _date_s(name: str, message: Any) -> float | None:  # noqa: ANN401
    """Return the GPS time of a message that states a date."""
    if name == "NAV-PVT" and message.validDate and message.validTime:
        at_s = 3600.0 * message.hour + 60.0 * message.min + message.second + 1e-9 * message.nano
        return _gps_s(date(message.year, message.month, message.day), at_s)
    if name == "RMC" and message.status == "A" and isinstance(message.date, date):
        return _gps_s(message.date, _time_of_day_s(message))
    if name == "ZDA" and "" not in (message.year, message.month, message.day):
        return _gps_s(date(message.year, message.month, message.day), _time_of_day_s(message))
    is_week = name == "NAV-SOL" and message.wknSet and message.towSet
    if is_week or (name == "NAV-TIMEGPS" and message.towValid and message.weekValid):
        return float(WEEK_S * message.week + message.iTOW * _MS)
    if hasattr(message, "WNc"):
        return None if message.TOW == _NO_TOW else WEEK_S * message.WNc + message.TOW * _MS
    return getattr(message, "gps_s", None)


def _gps_s(day: date, at_s: float | None) -> float | None:
    """Return the GPS time of a day and a time of day, both of UTC."""
    if at_s is None:
        return None
    utc_s = datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp() + at_s
    return float(gps_of_utc(np.array([utc_s]))[0])


def _time_s(
    protocol: str,
    message: Any,  # noqa: ANN401
    date_s: float | None,
    latest_s: float | None,
) -> float | None:
    """Return the GPS time of a message nearest to the one before; of no date that of its week."""
    if protocol == "ubx":
        return _nearest(message.iTOW * _MS, latest_s, WEEK_S)
    if protocol != "nmea":
        return date_s
    if not hasattr(message, "time") and not hasattr(message, "utctime"):
        return latest_s
    at_s = _time_of_day_s(message)
    if at_s is None or latest_s is None:
        return None
    utc_s = _nearest(at_s, latest_s + UNIX_OF_GPS_S, _DAY_S)
    return float(gps_of_utc(np.array([utc_s]))[0])


def _time_of_day_s(message: Any) -> float | None:  # noqa: ANN401
    at = getattr(message, "time", getattr(message, "utctime", None))
    if not isinstance(at, time):
        return None
    return 3600.0 * at.hour + 60.0 * at.minute + at.second + 1e-6 * at.microsecond


def _nearest(seconds: float, near_s: float | None, period_s: float) -> float:
    """Return seconds of a period in the one in which they are nearest to a time."""
    if near_s is None:
        return seconds
    return seconds + period_s * round((near_s - seconds) / period_s)
