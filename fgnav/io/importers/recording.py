"""The content of a foreign file: tables of samples under the flight format's column names."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, Unused, unused_of
from fgnav.io.flight.columns import LEAST_SIGMA, PLACE, Samples, fault_of_columns, largest
from fgnav.io.flight.series import COLUMNS
from fgnav.io.tables import increasing
from fgnav.types.flight import TruthSource

# After which counters begin anew: 32 bits of ns, us and ms; a day, a week.
_PERIODS_S = (4.294967296, 4294.967296, 4294967.296, 86_400.0, 604_800.0)
# A wrap hides no gap of more than three steps, or one hundredth of a period, a tenth at the most.
_NEAR_STEPS, _GAP_OF_PERIOD, _MOST_OF_PERIOD = 3.0, 0.01, 0.1
_MOST_SET_BACK = 1000  # rows of a clock that was set back for a while
_SHARED = 0.1  # of samples, that have the timestamp of the one before: fewer are repeated rows
ABOVE_SEA = "heights are above the sea: the file has no undulation, which shifts all alike"
Clock: TypeAlias = Literal["gps", "week", "own"]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Recording:
    """Samples, clock and notes of a file.

    Attributes
    ----------
    source : Path
        The file, for texts.
    tables : mapping of str to (mapping of str to ndarray, shape (k,))
        By kind, ``imu``, ``fixes``, ``baseline``, ``barometer``, ``magnetometer`` or ``truth``;
        columns as ``fgnav.io.flight.series.COLUMNS`` has them. Values may be NaN, times may
        repeat: such rows are left out and counted.
    clock : {"gps", "week", "own"}
        What ``t_s`` counts from: ``gps_start_s``; the start of a GPS week that the file does not
        state; or something else, such as power-on.
    gps_start_s : float
        Of ``clock="gps"``: GPS time of ``t_s = 0``, seconds since 1980-01-06.
    baseline_ends_at_fixes : bool
        Whether the baseline leads to the antenna of the fixes, not from it to another.
    truth_source : {"simulated", "survey", "filter"} or None
        What made the table ``truth``.
    imu_noise : mapping of str to float
        Noise that the format's unit is known for, by the names of ``[imu]`` in flight.toml.
    observations, navigation, orbits : tuple of Path
        RINEX observation files, one an antenna; navigation files; SP3 files.
    notes, missing : mapping of str to str
        What a user should know, and what he must state, by the key of flight.toml that it is about.
    """

    source: Path
    tables: Mapping[str, Samples] = field(default_factory=dict)
    clock: Clock = "gps"
    gps_start_s: float = 0.0
    baseline_ends_at_fixes: bool = False
    truth_source: TruthSource | None = None
    imu_noise: Mapping[str, float] = field(default_factory=dict)
    observations: tuple[Path, ...] = ()
    navigation: tuple[Path, ...] = ()
    orbits: tuple[Path, ...] = ()
    unused: tuple[Unused, ...] = ()
    notes: Mapping[str, str] = field(default_factory=dict)
    missing: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Drop unused of nothing; reject an empty file, and columns that no flight has."""
        object.__setattr__(self, "unused", tuple(loss for loss in self.unused if loss.count))
        files = (*self.observations, *self.navigation, *self.orbits)
        if not files and not any(len(table["t_s"]) for table in self.tables.values()):
            raise BadInputError(f"{self.source}: holds nothing that a flight could use")
        for kind, table in self.tables.items():
            fault = fault_of_columns([*table], *COLUMNS[kind])
            if fault:
                raise BadInputError(f"{self.source}: {kind}: {fault}")


def clean_rows(recording: Recording) -> Recording:
    """Return a recording of the rows that a flight can have, the others counted.

    Times that wrapped go on. Samples that share their timestamps are spread over the time to the
    next one, and ``missing`` has a text of it.
    """
    tables, missing, source = {}, dict(recording.missing), recording.source
    counts = Counter[tuple[str, str]]()
    for kind, table in recording.tables.items():
        good: BoolArray = np.ones(len(table["t_s"]), bool)
        for name, column in table.items():
            good &= np.abs(column) <= largest(name)  # false of NaN, too
            if name.startswith("sigma"):
                good &= column >= LEAST_SIGMA
        what = f"{kind} row"
        reason = f"a value is missing, or no instrument has it ({source.name})"
        counts[what, reason] = int((~good).sum())
        if PLACE[0] in table:
            nowhere = good & (table[PLACE[0]] == 0) & (table[PLACE[1]] == 0)
            reason = f"latitude and longitude are 0: the receiver had no fix ({source.name})"
            counts[what, reason] = int(nowhere.sum())
            good &= ~nowhere
        t_s = _unwrapped(table["t_s"][good])
        if kind == "imu" and (np.diff(t_s) == 0).sum() > _SHARED * len(t_s):
            t_s, longest_s = _spread(t_s)
            text = (
                f"{source.name}: several samples share a timestamp; they were spread from it to "
                f"the next one. Where it is the last sample's, add -{longest_s:.3g} s to "
                "clock_offset_s"
            )
            missing["imu.samples"] = "\n".join(filter(None, (missing.get("imu.samples"), text)))
        later = _in_order(t_s)
        counts[what, f"its time does not increase ({source.name})"] = int((~later).sum())
        if not later.any():
            raise BadInputError(
                f"{source}: {kind}: no row is usable of {len(good)}; look at columns and units"
            )
        tables[kind] = {name: np.asarray(column)[good][later] for name, column in table.items()}
        tables[kind]["t_s"] = t_s[later]
    unused = (*recording.unused, *unused_of(counts))
    return replace(recording, tables=tables, unused=unused, missing=missing)


def _unwrapped(t_s: FloatArray) -> FloatArray:
    """Return times without the steps back of counters that began anew."""
    step_s = np.diff(t_s)
    usual_s = float(np.median(np.abs(step_s))) if len(step_s) else 0.0
    for period_s in _PERIODS_S:
        most_s = max(_NEAR_STEPS * usual_s, _GAP_OF_PERIOD * period_s)
        most_s = min(most_s, _MOST_OF_PERIOD * period_s)
        wraps = (step_s > -period_s) & (step_s <= most_s - period_s)
        if wraps.any():
            t_s = t_s + period_s * np.concatenate([[0], np.cumsum(wraps)])
            step_s = np.diff(t_s)
    return t_s


def _spread(t_s: FloatArray) -> tuple[FloatArray, float]:
    """Return times of samples between one timestamp and the next, and the longest delay."""
    first = np.flatnonzero(np.diff(t_s, prepend=-np.inf) != 0)
    counts = np.diff(first, append=len(t_s))
    length_s = np.diff(t_s[first])
    last_s = counts[-1] * np.median(length_s / counts[:-1]) if len(length_s) else 0.0
    step_s = np.maximum(np.append(length_s, last_s), 0.0) / counts
    within = np.arange(len(t_s)) - np.repeat(first, counts)
    delay_s = within * np.repeat(step_s, counts)
    return t_s + delay_s, float(np.median(step_s * (counts - 1)))


def _in_order(t_s: FloatArray) -> BoolArray:
    """Return the rows that increase, of a clock that was set back for a while without those.

    Such a clock is taken until a step forward makes up for half of what it lost or more.
    """
    later: BoolArray = np.ones(len(t_s), np.bool_)
    step_s = np.diff(t_s)
    usual_s = float(np.median(np.abs(step_s))) if len(step_s) else 0.0
    for start in np.flatnonzero(step_s < 0) + 1:
        lost_s = t_s[start - 1] - t_s[start]
        ahead = step_s[start : start + _MOST_SET_BACK]
        made_up = np.flatnonzero((ahead > lost_s / 2) & (ahead > 1.5 * usual_s))
        if len(made_up) and t_s[start + made_up[0] + 1] > t_s[start - 1]:
            later[start : start + made_up[0] + 1] = False
    later[later] = increasing(t_s[later])
    return later


def unused_columns(source: Path, names: Sequence[str], rows: int, reason: str) -> Unused:
    """Return the one loss of a file's columns that are not used."""
    what = f"{source.name} column{'s' * (len(names) > 1)} {', '.join(names)}"
    return Unused(what=what, reason=reason, count=rows if names else 0)
