"""Precise orbits and clocks in SP3-c and SP3-d format [1]_.

References
----------
.. [1] S. Hilla, The Extended Standard Product 3 Orbit Format (SP3-d), 2016.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, FloatArray, IntArray, Loss, quoted
from fgnav.io.gps_time import GPS_EPOCH
from fgnav.io.rinex.observations import CONSTELLATIONS, KNOWN_SATELLITES
from fgnav.io.rinex.text import read_text
from fgnav.io.tables import is_number
from fgnav.types.orbits import PreciseOrbits

_BEHIND_GPS_S = {"GPS": 0.0, "GAL": 0.0, "QZS": 0.0, "BDT": 14.0}  # whole seconds since 2006
_NO_CLOCK_US = 999_999.0
_WIDTH = 60  # columns of a position record that are read


@dataclass(frozen=True, eq=False, slots=True)
class _File:
    """One file: epochs, and arrays of its satellites."""

    path: Path
    t_s: FloatArray
    satellites: tuple[str, ...]
    p_e_m: FloatArray
    clock_s: FloatArray
    velocities: int


def read_precise(paths: Sequence[Path], start_gps_s: float) -> PreciseOrbits:
    """Read precise orbits and clocks of one or several days.

    Parameters
    ----------
    paths : sequence of Path
        SP3-c or SP3-d files, plain or .gz.
    start_gps_s : float
        GPS time of ``t_s = 0``.

    Returns
    -------
    PreciseOrbits
        GPS, Galileo, BeiDou, QZSS and GLONASS. An epoch that two files share is taken from the
        earlier one; that, other constellations and velocities are counted as losses.

    Raises
    ------
    BadInputError
        Naming file, line, rule and value.
    """
    if not paths:
        raise BadInputError("orbits: must name a file, the list is empty")
    files = sorted(
        (_read(path, start_gps_s) for path in paths), key=lambda file: float(file.t_s[0])
    )
    seen = sorted({name for file in files for name in file.satellites})
    satellites = [name for name in seen if name[0] in KNOWN_SATELLITES]
    losses = _unused(files)
    t_s, p_e_m, clock_s = [], [], []
    end_s = -np.inf
    for file in files:
        later = file.t_s > end_s
        if not later.all():
            count = int(np.count_nonzero(~later))
            reason = "an earlier file has it too"
            losses.append(Loss(what=f"{file.path.name} epoch", reason=reason, count=count))
        column = [satellites.index(name) for name in file.satellites if name in satellites]
        mine = [k for k, name in enumerate(file.satellites) if name in satellites]
        place = np.full((int(later.sum()), len(satellites), 3), np.nan)
        clock = np.full(place.shape[:2], np.nan)
        place[:, column], clock[:, column] = (
            file.p_e_m[later][:, mine],
            file.clock_s[later][:, mine],
        )
        t_s.append(file.t_s[later])
        p_e_m.append(place)
        clock_s.append(clock)
        end_s = max(end_s, float(file.t_s[-1]))
    return PreciseOrbits(
        t_s=np.concatenate(t_s),
        satellites=tuple(satellites),
        p_e_m=np.concatenate(p_e_m),
        clock_s=np.concatenate(clock_s),
        losses=tuple(losses),
    )


def _unused(files: Sequence[_File]) -> list[Loss]:
    """Count the records of other constellations, and of velocities."""
    losses = []
    for letter, name in CONSTELLATIONS.items():
        count = sum(len(f.t_s) * sum(s[0] == letter for s in f.satellites) for f in files)
        if count and letter not in KNOWN_SATELLITES:
            losses.append(Loss(what=f"{name} orbit", reason="constellation not used", count=count))
    velocities = sum(file.velocities for file in files)
    if velocities:
        losses.append(
            Loss(what="SP3 velocity", reason="differences of positions serve", count=velocities)
        )
    return losses


def _read(path: Path, start_gps_s: float) -> _File:
    """Read one file."""
    text = read_text(path)
    lines = text.tobytes().decode("latin-1").split("\n")
    satellites, announced, behind_s = _header(path, lines)
    if lines[-1].strip() or not any(line.startswith("EOF") for line in lines[-3:]):
        raise BadInputError(f"{path}: line {len(lines)}: must end with EOF, the file is truncated")
    kind = np.array([line[:1] for line in lines])
    epochs, records = np.flatnonzero(kind == "*"), np.flatnonzero(kind == "P")
    if len(epochs) != announced:
        raise BadInputError(
            f"{path}: line 1: {announced} epochs announced, the file holds {len(epochs)}; "
            "fetch it again"
        )
    t_s = _epochs(path, lines, epochs, start_gps_s - behind_s)
    row = np.searchsorted(epochs, records) - 1
    column = _columns(path, lines, records, row, satellites)
    if len(records) != len(epochs) * len(satellites):
        counts = np.bincount(row, minlength=len(epochs))
        short = int(np.argmax(counts != len(satellites)))
        raise BadInputError(
            f"{path}: line {epochs[short] + 1}: the epoch must hold {len(satellites)} satellites, "
            f"got {counts[short]}; fetch the file again"
        )
    values = _numbers(path, lines, records)
    p_e_m = np.full((len(epochs), len(satellites), 3), np.nan)
    clock_s = np.full(p_e_m.shape[:2], np.nan)
    absent = (values[:, :3] == 0).all(axis=1)
    p_e_m[row, column] = np.where(absent[:, None], np.nan, values[:, :3] * 1e3)
    clock_s[row, column] = np.where(values[:, 3] >= _NO_CLOCK_US, np.nan, values[:, 3] * 1e-6)
    return _File(path, t_s, satellites, p_e_m, clock_s, int(np.count_nonzero(kind == "V")))


def _header(path: Path, lines: list[str]) -> tuple[tuple[str, ...], int, float]:
    """Return satellites, number of epochs, and how far the time scale is behind GPS time."""
    first = lines[0]
    if first[:2] not in ("#c", "#d") or first[2:3] not in ("P", "V"):
        raise BadInputError(
            f"{path}: line 1: must start with #c or #d (SP3), got {quoted(first[:12])}"
        )
    listed = [line for line in lines if line.startswith("+ ")]
    names = "".join(line[9:60].ljust(51) for line in listed)
    scale = next((line[9:12] for line in lines if line.startswith("%c")), "")
    try:
        announced, count = int(first[32:39]), int(listed[0][3:6])
    except (ValueError, IndexError) as error:
        raise BadInputError(
            f"{path}: header must tell the numbers of epochs and satellites, "
            f"got {quoted(first[32:39])}"
        ) from error
    satellites = tuple(names[3 * k : 3 * k + 3].replace(" ", "0") for k in range(count))
    wrong = [s for s in satellites if s[:1] not in "GRECJSI" or not s[1:].isdigit()]
    if wrong or not satellites or len(set(satellites)) < count:
        got = wrong[0] if wrong else f"{count} with repetitions"
        raise BadInputError(f"{path}: header must list each satellite once, got {quoted(got)}")
    if scale not in _BEHIND_GPS_S:
        raise BadInputError(
            f"{path}: time system must be one of {', '.join(_BEHIND_GPS_S)}, got {quoted(scale)}"
        )
    return satellites, announced, _BEHIND_GPS_S[scale]


def _epochs(path: Path, lines: list[str], rows: IntArray, start_gps_s: float) -> FloatArray:
    """Return the epochs since the start."""
    t_s = np.empty(len(rows))
    for k, row in enumerate(rows.tolist()):
        line = lines[row]
        try:
            year, month, day, hour, minute = (int(f) for f in line[1:].split()[:5])
            second = float(line[20:31])
            date = np.datetime64(f"{year:04d}-{month:02d}-{day:02d}", "us")
        except ValueError as error:
            raise BadInputError(
                f"{path}: line {row + 1}: must be an epoch, got {quoted(line)}"
            ) from error
        days_s = (date - GPS_EPOCH) / np.timedelta64(1, "s")
        t_s[k] = days_s - start_gps_s + hour * 3600 + minute * 60 + second
        if (
            not 0 <= hour < 24
            or not 0 <= minute < 60
            or not 0 <= second < 60
            or (k and t_s[k] <= t_s[k - 1])
        ):
            raise BadInputError(
                f"{path}: line {row + 1}: time must increase, got {quoted(line[:31])}"
            )
    return t_s


def _columns(
    path: Path, lines: list[str], records: IntArray, row: IntArray, satellites: tuple[str, ...]
) -> IntArray:
    """Return the satellite of each position record; raise if one is foreign or comes twice."""
    number = {name: k for k, name in enumerate(satellites)}
    names = [lines[r][1:4].replace(" ", "0") for r in records.tolist()]
    column = np.array([number.get(name, -1) for name in names], int)
    key = row * len(satellites) + column
    order = np.argsort(key, kind="stable")
    twice = np.zeros(len(key), bool)
    twice[order[1:]] = np.diff(key[order]) == 0
    wrong = (column < 0) | (row < 0) | twice
    if wrong.any():
        k = int(np.argmax(wrong))
        raise BadInputError(
            f"{path}: line {records[k] + 1}: must be a satellite of the header, once per epoch, "
            f"got {quoted(names[k])}"
        )
    return column


def _numbers(path: Path, lines: list[str], records: IntArray) -> NDArray[Any]:
    """Return positions, km, and clocks, us, of records (k, 4)."""
    rows = [lines[r][:_WIDTH].ljust(_WIDTH).encode("latin-1") for r in records.tolist()]
    block = np.array(rows, f"S{_WIDTH}")
    fields = block.view("S1").reshape(-1, _WIDTH)[:, 4:].copy().view("S14")
    try:
        values = fields.astype(float)
        fault = ~np.isfinite(values).all(axis=1)
    except ValueError:
        fault = np.array([not all(map(is_number, row)) for row in fields.tolist()])
        values = np.zeros(fields.shape)
    # Six decimals at fixed columns: a shifted or shortened number would parse to another value.
    fault |= (fields.view("S1").reshape(len(fields), 4, 14)[:, :, 7] != b".").any(axis=1)
    if fault.any():
        k = int(records[int(np.argmax(fault))])
        raise BadInputError(
            f"{path}: line {k + 1}: must hold four numbers with six decimals, "
            f"got {quoted(lines[k][:_WIDTH])}"
        )
    return values
