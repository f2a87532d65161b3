"""What receivers state themselves: fixes, velocities, headings and baselines, by their time.

``STATED`` says what is taken of each message. Sentences of NMEA 0183 [1]_ have the UTC time of day,
which is that nearest to the message before; RMC and ZDA date them, HDT and THS have the time of the
sentence before. Heights are those above the sea plus the undulation.

References
----------
.. [1] NMEA 0183, Standard for Interfacing Marine Electronic Devices, version 4.11, 2018, section 6.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, time
from typing import Any, TypeAlias

import numpy as np

from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples
from fgnav.io.gps_time import UNIX_OF_GPS_S, WEEK_S, gps_of_utc
from fgnav.io.importers.formats.parts import Names, Part, Timed, joined
from fgnav.io.importers.recording import ABOVE_SEA

_Stated: TypeAlias = tuple[str, tuple[Part, ...]]
_MM, _CM, _MS, _DEG = 1e-3, 1e-2, 1e-3, 180 / np.pi
_DAY_S = 86_400.0
_NO_TOW = 2**32 - 1  # of SBF
_MOST = 1e9  # SBF writes -2e10 where it has no value
_PROTOCOLS = ("ubx", "sbf", "novatel", "nmea")  # of two that state the same, the first is taken
_NO_FIX = {0: "the receiver had no fix", 6: "dead reckoning", 7: "manual", 8: "simulated"}
_UNTIMED = (
    "headings of HDT and THS have the time of the sentence before; where a receiver puts them "
    "first, they are an epoch late: set it to put out GGA before"
)
_HEADINGS = (col.HEADING, col.PITCH, col.HEADING_SIGMA, col.PITCH_SIGMA)


def _fixes(*parts: Part) -> _Stated:
    return "fixes", parts


def _baseline(*parts: Part) -> _Stated:
    return "baseline", parts


def _headings(*fields: str) -> _Stated:
    return _baseline(*(Part(of, (one,)) for of, one in zip(_HEADINGS, fields, strict=False)))


# By message: of which table, and its parts.
STATED: dict[str, _Stated] = {
    "NAV-PVT": _fixes(
        Part(col.PLACE, ("lat", "lon", "height"), (1.0, 1.0, _MM)),
        Part(col.POSITION_SIGMA, ("hAcc", "hAcc", "vAcc"), _MM),
        Part(col.VELOCITY, ("velN", "velE", "velD"), _MM),
        Part(col.VELOCITY_SIGMA, ("sAcc", "sAcc", "sAcc"), _MM),
    ),
    "NAV-RELPOSNED": _baseline(
        Part(col.BASELINE, ("relPosN", "relPosE", "relPosD"), _CM),
        Part(col.POSITION_SIGMA, ("accN", "accE", "accD"), _MM),
    ),
    "PVTGeodetic": _fixes(
        Part(col.PLACE, ("Latitude", "Longitude", "Height"), (_DEG, _DEG, 1.0)),
        Part(col.VELOCITY, ("Vn", "Ve", "Vu"), (1.0, 1.0, -1.0)),
    ),
    "PosCovGeodetic": _fixes(
        Part(col.POSITION_SIGMA, ("Cov_latlat", "Cov_lonlon", "Cov_hgthgt"), is_variance=True)
    ),
    "VelCovGeodetic": _fixes(
        Part(col.VELOCITY_SIGMA, ("Cov_VnVn", "Cov_VeVe", "Cov_VuVu"), is_variance=True)
    ),
    "AttEuler": _headings("Heading", "Pitch"),
    "AttCovEuler": _baseline(
        Part(col.HEADING_SIGMA, ("Cov_HeadHead",), is_variance=True),
        Part(col.PITCH_SIGMA, ("Cov_PitchPitch",), is_variance=True),
    ),
    "BESTPOS": _fixes(
        Part(col.PLACE, ("latitude", "longitude", "height")),
        Part(col.POSITION_SIGMA, ("sigma_n", "sigma_e", "sigma_u")),
    ),
    "BESTVEL": _fixes(Part(col.VELOCITY, ("north", "east", "up"), (1.0, 1.0, -1.0))),
    **{
        name: _headings("heading", "pitch", "sigma_heading", "sigma_pitch")
        for name in ("HEADING", "HEADING2", "DUALANTENNAHEADING")
    },
    **{name: _fixes(Part(col.PLACE, ("lat", "lon", "alt"))) for name in ("GGA", "GNS")},
    "GST": _fixes(Part(col.POSITION_SIGMA, ("stdLat", "stdLong", "stdAlt"))),
    "HDT": _headings("headingT"),
    "THS": _headings("headt"),
    "PASHR": _headings("trueHdg", "pitch", "hdgAcc", "pitchAcc"),
    "RMC": _fixes(),
    "ZDA": _fixes(),
}


@dataclass(slots=True)
class Solution:
    """Samples of a stream's messages, each with its GPS time."""

    # by protocol, table and columns
    rows: dict[tuple[str, str, Names], list[tuple[float, ...]]] = field(
        default_factory=lambda: defaultdict(list)
    )
    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    notes: dict[str, str] = field(default_factory=dict)  # by key of flight.toml
    is_dated: bool = False

    def timed(self, table: str, *blocks: Names) -> list[Timed]:
        """Return times and values of blocks of columns, each of the first protocol that has it."""
        found = list[Timed]()
        for names in blocks:
            owner = next((p for p in _PROTOCOLS if self.rows.get((p, table, names))), "")
            rows = np.array(self.rows.get((owner, table, names), []), np.float64)
            rows = rows.reshape(-1, 1 + len(names))
            found.append((names, rows[:, 0], rows[:, 1:]))
            for other in _PROTOCOLS:
                count = len(self.rows.get((other, table, names), [])) if other != owner else 0
                self.counts[f"{names[0]} of {other}", f"{owner} has it, too"] += count
        return found

    def fixes(self) -> Samples:
        """Return fixes, with those sigmas and velocities that most have."""
        place, *others = self.timed(
            "fixes", col.PLACE, col.POSITION_SIGMA, col.VELOCITY, col.VELOCITY_SIGMA
        )
        return joined("fix", place, others, self.counts)

    def baselines(self) -> Samples:
        """Return baselines as vectors, else as headings, with what most have."""
        vector, sigma = self.timed("baseline", col.BASELINE, col.POSITION_SIGMA)
        heading, *others = self.timed("baseline", *_HEADINGS)
        if len(vector[1]):
            self.counts["heading", "a baseline has it, too"] += len(heading[1])
            return joined("baseline", vector, [sigma], self.counts)
        return joined("heading", heading, others, self.counts)

    @property
    def has_vectors(self) -> bool:
        """Return True if there are baselines, as of u-blox alone."""
        return any(names == col.BASELINE and rows for (*_, names), rows in self.rows.items())


def take(messages: Iterable[tuple[str, str, Any]], near_s: float | None, into: Solution) -> None:
    """Add what messages state.

    Parameters
    ----------
    messages : iterable of tuple
        Protocol, name, and the message as its library decodes it, in the order of the stream.
    near_s : float or None
        GPS time within half a day of the first: it dates a stream without dates.
    """
    messages = list(messages)
    dates_s = [_date_s(name, one) for _, name, one in messages]
    first_s = next((t for t in dates_s if t is not None), near_s)
    latest_s, into.is_dated = first_s, first_s is not None
    for (protocol, name, one), date_s in zip(messages, dates_s, strict=True):
        latest_s = latest_s if date_s is None else date_s
        t = _time_s(protocol, one, date_s, latest_s)
        reason = _no_use(name, one)
        if t is None or reason:
            into.counts[f"{name} message", reason or "has no time"] += 1
            continue
        latest_s = t if into.is_dated else None
        table, parts = STATED[name]
        for part in parts:
            (x,) = part.of({field: [_number(getattr(one, field, ""))] for field in part.fields})
            if part.columns == col.PLACE and hasattr(one, "sep"):
                into.notes |= {"fixes": ABOVE_SEA} if one.sep == "" else {}
                x[2] += one.sep or 0.0
            into.notes |= {"baseline": _UNTIMED} if name in ("HDT", "THS") else {}
            if np.isfinite(x).all():
                into.rows[protocol, table, part.columns].append((round(t, 3), *x.tolist()))
            else:
                into.counts[f"{name} message", f"has no {part.columns[0]}"] += 1


def _number(value: Any) -> float:  # noqa: ANN401  # of a library
    return float(value) if value != "" and abs(float(value)) <= _MOST else np.nan


def _no_use(name: str, one: Any) -> str:  # noqa: ANN401
    """Return why a message is not used; nothing of one that is."""
    if name == "NAV-PVT" and not (one.gnssFixOk and one.fixType in (3, 4)):
        return "the receiver had no fix of three dimensions"
    if name == "NAV-RELPOSNED":
        if not (one.gnssFixOK and one.relPosValid and one.carrSoln):
            return "no baseline of carrier phases"
        if not one.isMoving or getattr(one, "relPosNormalized", False):  # not in version 0
            return "from a base that does not move with the vehicle, or without a length"
    if getattr(one, "Error", 0) or not getattr(one, "is_computed", True):
        return "no solution was computed"
    if name == "GGA":
        return _NO_FIX.get(one.quality or 0, "")
    if name == "GNS" and set(one.posMode) <= set("NEMS"):
        return _NO_FIX[0]
    if name == "RMC":
        return "speed and course without a vertical velocity"
    if (name == "THS" and one.mi != "A") or (name == "PASHR" and not getattr(one, "gnssQual", 0)):
        return "the receiver had no heading"
    return ""


def _date_s(name: str, one: Any) -> float | None:  # noqa: ANN401
    """Return the GPS time of a message that states a date."""
    if name == "NAV-PVT" and one.validDate and one.validTime:
        day, at_s = date(one.year, one.month, one.day), 3600.0 * one.hour + 60.0 * one.min
        at_s += one.second + 1e-9 * one.nano
    elif name == "RMC" and one.status == "A" and isinstance(one.date, date):
        day, at_s = one.date, _time_of_day_s(one)
    elif name == "ZDA" and "" not in (one.year, one.month, one.day):
        day, at_s = date(one.year, one.month, one.day), _time_of_day_s(one)
    elif hasattr(one, "WNc"):
        return None if one.TOW == _NO_TOW else WEEK_S * one.WNc + one.TOW * _MS
    else:
        return getattr(one, "gps_s", None)
    if at_s is None:
        return None
    utc_s = datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp() + at_s
    return float(gps_of_utc(np.array([utc_s]))[0])


def _time_s(
    protocol: str,
    one: Any,  # noqa: ANN401
    date_s: float | None,
    latest_s: float | None,
) -> float | None:
    """Return the GPS time of a message nearest to the one before; of no date that of its week."""
    if protocol == "ubx":
        return _nearest(one.iTOW * _MS, latest_s, WEEK_S)
    if protocol != "nmea":
        return date_s
    if not hasattr(one, "time") and not hasattr(one, "utctime"):
        return latest_s
    at_s = _time_of_day_s(one)
    if at_s is None or latest_s is None:
        return None
    utc_s = _nearest(at_s, latest_s + UNIX_OF_GPS_S, _DAY_S)
    return float(gps_of_utc(np.array([utc_s]))[0])


def _time_of_day_s(one: Any) -> float | None:  # noqa: ANN401
    at = getattr(one, "time", getattr(one, "utctime", None))
    if not isinstance(at, time):
        return None
    return 3600.0 * at.hour + 60.0 * at.minute + at.second + 1e-6 * at.microsecond


def _nearest(seconds: float, near_s: float | None, period_s: float) -> float:
    """Return seconds of a period in the one in which they are nearest to a time."""
    if near_s is None:
        return seconds
    return seconds + period_s * round((near_s - seconds) / period_s)
