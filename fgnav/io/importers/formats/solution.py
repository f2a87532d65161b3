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
from typing import Any, NamedTuple

import numpy as np

from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples
from fgnav.io.gps_time import UNIX_OF_GPS_S, WEEK_S, gps_of_utc
from fgnav.io.importers.formats.parts import Timed, joined
from fgnav.io.importers.recording import ABOVE_SEA

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
_HEADINGS = ("heading", "pitch", "heading sigma", "pitch sigma")
_HEADING_COLUMNS = (col.HEADING, col.PITCH, col.HEADING_SIGMA, col.PITCH_SIGMA)
_COLUMNS = {
    "place": col.PLACE,
    "place sigma": col.POSITION_SIGMA,
    "velocity": col.VELOCITY,
    "velocity sigma": col.VELOCITY_SIGMA,
    "baseline": col.BASELINE,
    "baseline sigma": col.POSITION_SIGMA,
    **dict(zip(_HEADINGS, _HEADING_COLUMNS, strict=True)),
}


class Part(NamedTuple):
    """What a message states of one kind."""

    kind: str
    fields: tuple[str, ...]
    unit: float | tuple[float, ...] = 1.0
    is_variance: bool = False


def _headings(*fields: str) -> list[Part]:
    return [Part(kind, (one,)) for kind, one in zip(_HEADINGS, fields, strict=False)]


STATED: dict[str, list[Part]] = {
    "NAV-PVT": [
        Part("place", ("lat", "lon", "height"), (1.0, 1.0, _MM)),
        Part("place sigma", ("hAcc", "hAcc", "vAcc"), _MM),
        Part("velocity", ("velN", "velE", "velD"), _MM),
        Part("velocity sigma", ("sAcc", "sAcc", "sAcc"), _MM),
    ],
    "NAV-RELPOSNED": [
        Part("baseline", ("relPosN", "relPosE", "relPosD"), _CM),
        Part("baseline sigma", ("accN", "accE", "accD"), _MM),
    ],
    "PVTGeodetic": [
        Part("place", ("Latitude", "Longitude", "Height"), (_DEG, _DEG, 1.0)),
        Part("velocity", ("Vn", "Ve", "Vu"), (1.0, 1.0, -1.0)),
    ],
    "PosCovGeodetic": [Part("place sigma", ("Cov_latlat", "Cov_lonlon", "Cov_hgthgt"), 1.0, True)],
    "VelCovGeodetic": [Part("velocity sigma", ("Cov_VnVn", "Cov_VeVe", "Cov_VuVu"), 1.0, True)],
    "AttEuler": _headings("Heading", "Pitch"),
    "AttCovEuler": [
        Part("heading sigma", ("Cov_HeadHead",), 1.0, True),
        Part("pitch sigma", ("Cov_PitchPitch",), 1.0, True),
    ],
    "BESTPOS": [
        Part("place", ("latitude", "longitude", "height")),
        Part("place sigma", ("sigma_n", "sigma_e", "sigma_u")),
    ],
    "BESTVEL": [Part("velocity", ("north", "east", "up"), (1.0, 1.0, -1.0))],
    **dict.fromkeys(
        ("HEADING", "HEADING2", "DUALANTENNAHEADING"),
        _headings("heading", "pitch", "sigma_heading", "sigma_pitch"),
    ),
    **{name: [Part("place", ("lat", "lon", "alt"))] for name in ("GGA", "GNS")},
    "GST": [Part("place sigma", ("stdLat", "stdLong", "stdAlt"))],
    "HDT": _headings("headingT"),
    "THS": _headings("headt"),
    "PASHR": _headings("trueHdg", "pitch", "hdgAcc", "pitchAcc"),
    "RMC": [],
    "ZDA": [],
}


@dataclass(slots=True)
class Solution:
    """What the messages of a stream state, by protocol and kind, each with its GPS time."""

    rows: dict[tuple[str, str], list[tuple[float, ...]]] = field(
        default_factory=lambda: defaultdict(list)
    )
    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    notes: dict[str, str] = field(default_factory=dict)  # by key of flight.toml
    is_dated: bool = False

    def of(self, *kinds: str) -> list[Timed]:
        """Return times and values of kinds, each of the first protocol that has it."""
        found = list[Timed]()
        for kind in kinds:
            owner = next((p for p in _PROTOCOLS if self.rows.get((p, kind))), "")
            table = np.array(self.rows.get((owner, kind), []), np.float64)
            table = table.reshape(-1, 1 + len(_COLUMNS[kind]))
            found.append((_COLUMNS[kind], table[:, 0], table[:, 1:]))
            for other in _PROTOCOLS:
                count = len(self.rows.get((other, kind), [])) if other != owner else 0
                self.counts[f"{kind} of {other}", f"{owner} has it, too"] += count
        return found

    def fixes(self) -> Samples:
        """Return fixes, with those sigmas and velocities that most have."""
        place, *others = self.of("place", "place sigma", "velocity", "velocity sigma")
        return joined("fix", place, others, self.counts)

    def baselines(self) -> Samples:
        """Return baselines as vectors, else as headings, with what most have."""
        vector, sigma = self.of("baseline", "baseline sigma")
        heading, *others = self.of(*_HEADINGS)
        if len(vector[1]):
            self.counts["heading", "a baseline has it, too"] += len(heading[1])
            return joined("baseline", vector, [sigma], self.counts)
        return joined("heading", heading, others, self.counts)

    @property
    def has_vectors(self) -> bool:
        """Return True if there are baselines, as of u-blox alone."""
        return any(kind == "baseline" and rows for (_, kind), rows in self.rows.items())


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
        for part in STATED[name]:
            x = np.array([_number(getattr(one, field, "")) for field in part.fields])
            x = np.sqrt(np.maximum(x, 0.0)) if part.is_variance else x * part.unit
            if part.kind == "place" and hasattr(one, "sep"):
                into.notes |= {"fixes": ABOVE_SEA} if one.sep == "" else {}
                x[2] += one.sep or 0.0
            into.notes |= {"baseline": _UNTIMED} if name in ("HDT", "THS") else {}
            if np.isfinite(x).all():
                into.rows[protocol, part.kind].append((round(t, 3), *x.tolist()))
            else:
                into.counts[f"{name} message", f"has no {part.kind}"] += 1


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
