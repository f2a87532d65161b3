"""What receivers state themselves: fixes, velocities, headings and baselines, by their time."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, TypeAlias

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples, samples
from fgnav.io.gps_time import WEEK_S, gps_of_utc
from fgnav.io.importers.formats.streams import Log

_MM, _CM, _MS = 1e-3, 1e-2, 1e-3
_MOST = 1e9  # SBF writes -2e10 where it has no value
ByTime: TypeAlias = dict[float, tuple[float, ...]]  # GPS seconds since 1980-01-06, to the ms


@dataclass(slots=True)
class Solution:
    """What the messages of a stream have stated so far, each by its time."""

    place: ByTime = field(default_factory=dict)  # latitude, longitude, deg; height, m
    place_sigma: ByTime = field(default_factory=dict)  # north, east, down, m
    velocity: ByTime = field(default_factory=dict)  # north, east, down, m/s
    velocity_sigma: ByTime = field(default_factory=dict)
    baseline: ByTime = field(default_factory=dict)  # north, east, down, m, and their sigmas
    heading: ByTime = field(default_factory=dict)  # heading, pitch, and their sigmas, deg
    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    above_sea: bool = False  # whether heights lack the undulation
    date_s: float | None = None  # latest GPS time that was stated with its week

    @property
    def times(self) -> list[float]:
        """Return the times of baselines, else of headings."""
        return sorted(self.baseline or self.heading)

    def time_of_week(self, seconds: float) -> float:
        """Return the GPS time nearest to the latest date; seconds alone where there was none."""
        if self.date_s is None:
            return round(seconds, 3)
        return round(_nearest_week(seconds, self.date_s), 3)

    def date_all(self) -> None:
        """Date what was stated before the first date."""
        tables = [self.place, self.place_sigma, self.velocity, self.velocity_sigma]
        tables += [self.baseline, self.heading]
        first_s = min((t for table in tables for t in table if t >= WEEK_S), default=None)
        for table in tables if first_s is not None else ():
            for t in [t for t in table if t < WEEK_S]:
                table[round(_nearest_week(t, first_s or 0.0), 3)] = table.pop(t)


def _nearest_week(seconds: float, near_s: float) -> float:
    """Return seconds of a week in the week in which they are nearest to a time."""
    return seconds + WEEK_S * round((near_s - seconds) / WEEK_S)


def fixes(solution: Solution, start_s: float) -> Samples:
    """Return the fixes of a solution; those without what most have are counted and left out."""
    t = sorted(solution.place)
    kept: list[tuple[tuple[str, ...], ByTime]] = [(col.PLACE, solution.place)]
    for what, names, by_time in (
        ("sigma", col.POSITION_SIGMA, solution.place_sigma),
        ("velocity", col.VELOCITY, solution.velocity),
        ("sigma of velocity", col.VELOCITY_SIGMA, solution.velocity_sigma),
    ):
        some = [one for one in t if one in by_time]
        solution.counts[what, "of no fix's time"] += len(by_time) - len(some)
        is_needed = names != col.VELOCITY_SIGMA or kept[-1][0] == col.VELOCITY
        if _are_most(len(some), len(t)) and is_needed:
            solution.counts["fix", f"has no {what}, as most have"] += len(t) - len(some)
            t = some
            kept.append((names, by_time))
        else:
            solution.counts[what, "most fixes have none"] += len(some)
    return samples(np.array(t) - start_s, *((names, _rows(of, t)) for names, of in kept))


def baseline(solution: Solution, start_s: float) -> Samples:
    """Return baselines as vectors, else as headings, with the pitch and sigmas that most have."""
    t = np.array(solution.times)
    if solution.baseline:
        x = _rows(solution.baseline, t.tolist())
        solution.counts["heading", "a baseline has it, too"] += len(solution.heading)
        return samples(t - start_s, (col.BASELINE, x[:, :3]), (col.POSITION_SIGMA, x[:, 3:]))
    x = _rows(solution.heading, t.tolist())
    is_stated: BoolArray = np.asarray(np.isfinite(x))
    columns = [0, *(k for k in (1, 2, 3) if _are_most(is_stated[:, k].sum(), len(t)))]
    whole = is_stated[:, columns].all(axis=1)
    reason = "has no pitch or sigma, as most have"
    solution.counts["heading", reason] += int((~whole).sum())
    names = (col.HEADING, col.PITCH, col.HEADING_SIGMA, col.PITCH_SIGMA)
    return samples(t[whole] - start_s, *((names[k], x[whole][:, [k]]) for k in columns))


def _are_most(count: int, of: int) -> bool:
    return 2 * count > of


def _rows(by_time: ByTime, times: list[float]) -> FloatArray:
    return np.array([by_time[t] for t in times], np.float64)


def _ubx_pvt(one: Any, to: Solution) -> None:  # noqa: ANN401
    if not (one.validDate and one.validTime and one.gnssFixOk and one.fixType in (3, 4)):
        to.counts["NAV-PVT message", "the receiver had no fix of three dimensions"] += 1
        return
    date = datetime(one.year, one.month, one.day, one.hour, one.min, tzinfo=UTC)
    utc_s = date.timestamp() + one.second + 1e-9 * one.nano
    gps_s = float(gps_of_utc(np.array([utc_s]))[0])
    to.date_s = gps_s
    t = to.time_of_week(one.iTOW * _MS)
    to.place[t] = (one.lat, one.lon, one.height * _MM)
    to.place_sigma[t] = (one.hAcc * _MM, one.hAcc * _MM, one.vAcc * _MM)
    to.velocity[t] = (one.velN * _MM, one.velE * _MM, one.velD * _MM)
    to.velocity_sigma[t] = (one.sAcc * _MM,) * 3


def _ubx_relative(one: Any, to: Solution) -> None:  # noqa: ANN401
    if not (one.gnssFixOK and one.relPosValid and one.carrSoln):
        to.counts["NAV-RELPOSNED message", "no baseline of carrier phases"] += 1
        return
    if not one.isMoving or getattr(one, "relPosNormalized", False):  # not in version 0
        reason = "from a base that does not move with the vehicle, or without a length"
        to.counts["NAV-RELPOSNED message", reason] += 1
        return
    vector = (one.relPosN * _CM, one.relPosE * _CM, one.relPosD * _CM)
    sigma = (one.accN * _MM, one.accE * _MM, one.accD * _MM)
    to.baseline[to.time_of_week(one.iTOW * _MS)] = vector + sigma


def _sbf(one: Any, to: Solution) -> None:  # noqa: ANN401
    """Take a block: what it has of place, velocity, heading, or of their sigmas."""
    for kind, names in _SBF[one.identity].items():
        x = np.array([float(getattr(one, name)) for name in names])
        if one.Error or np.abs(x).max() > _MOST:
            to.counts[f"{one.identity} block", f"has no {kind.replace('_', ' of a ')}"] += 1
            continue
        to.date_s = WEEK_S * one.WNc + one.TOW * _MS
        t = to.time_of_week(one.TOW * _MS)
        row = (np.sqrt(x) if kind.endswith("sigma") else x * _SBF_UNITS.get(kind, 1.0)).tolist()
        if kind.startswith("heading"):
            earlier = to.heading.get(t, (np.nan,) * 4)
            to.heading[t] = (*row, *earlier[2:]) if kind == "heading" else (*earlier[:2], *row)
        else:
            getattr(to, kind)[t] = tuple(row)


def _novatel(one: Log, to: Solution) -> None:
    if not one.is_computed:
        to.counts[f"NovAtel {one.number} log", "no solution was computed"] += 1
        return
    to.date_s = one.gps_s
    t, x = round(one.gps_s, 3), one.fields
    if one.number == 42:
        to.place[t] = (x[0], x[1], x[2] + x[3])
        to.place_sigma[t] = x[5:8]
    elif one.number == 99:
        track = np.radians(x[3])
        to.velocity[t] = (float(x[2] * np.cos(track)), float(x[2] * np.sin(track)), -x[4])
    else:
        to.heading[t] = (x[1], x[2], x[4], x[5])


_SBF: dict[str, dict[str, tuple[str, ...]]] = {
    "PVTGeodetic": {
        "place": ("Latitude", "Longitude", "Height"),
        "velocity": ("Vn", "Ve", "Vu"),
    },
    "PosCovGeodetic": {"place_sigma": ("Cov_latlat", "Cov_lonlon", "Cov_hgthgt")},
    "VelCovGeodetic": {"velocity_sigma": ("Cov_VnVn", "Cov_VeVe", "Cov_VuVu")},
    "AttEuler": {"heading": ("Heading", "Pitch")},
    "AttCovEuler": {"heading_sigma": ("Cov_HeadHead", "Cov_PitchPitch")},
}
_SBF_UNITS = {
    "place": np.array([*np.degrees([1.0, 1.0]), 1.0]),
    "velocity": np.array([1.0, 1.0, -1.0]),
}
# By protocol and the message's number: what takes it.
TAKEN: dict[tuple[str, int], Callable[[Any, Solution], None]] = {
    ("ubx", 0x0107): _ubx_pvt,
    ("ubx", 0x013C): _ubx_relative,
    **dict.fromkeys([("sbf", number) for number in (4007, 5906, 5908, 5938, 5939)], _sbf),
    **dict.fromkeys([("novatel", number) for number in (42, 99, 971, 1335, 2042)], _novatel),
}
