"""Precise orbits and clocks in SP3 files [1]_: -a, -b, -c and -d are read, -d is written.

Records and epochs that break a rule are left out and counted.

References
----------
.. [1] S. Hilla, The Extended Standard Product 3 Orbit Format (SP3-d), 2016.
"""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, quoted, unused_of
from fgnav.io.gps_time import SCALES, WEEK_S, date_to_gps_s, gps_of, gps_s_to_date
from fgnav.io.rinex.constellations import CONSTELLATIONS, USED
from fgnav.io.rinex.text import read_text
from fgnav.io.tables import increasing, numbers
from fgnav.types.orbits import PreciseOrbits

_NO_CLOCK_US = 999_999.999999
_WIDTH = 60  # columns of a position record that are read
_LOW = "L"  # satellites in low orbits, by names of their own


def read_precise(paths: Sequence[Path], start_gps_s: float) -> PreciseOrbits:
    """Read precise orbits and clocks of one or several days.

    GPS, Galileo, BeiDou, QZSS and GLONASS. An epoch that two files share is taken from the earlier
    one; that, other constellations and velocities are counted as unused.

    Examples
    --------
    >>> read_precise([Path("igs.sp3")], 1_277_078_400.0).satellites
    ('E07', 'G05')
    """
    if not paths:
        raise BadInputError("orbits: must name a file, the list is empty")
    files = [(path.name, *_read(path, start_gps_s)) for path in paths]
    files.sort(key=lambda file: float(file[1].t_s[0]))
    satellites = sorted({satellite for _, file, _ in files for satellite in file.satellites})
    parts, counts, end_s = list[tuple[FloatArray, ...]](), Counter[tuple[str, str]](), -np.inf
    for name, file, lost in files:
        later = file.t_s > end_s
        column = [satellites.index(satellite) for satellite in file.satellites]
        x = np.full((int(later.sum()), len(satellites), 4), np.nan)
        x[:, column, :3], x[:, column, 3] = file.p_e_m[later], file.clock_s[later]
        parts.append((file.t_s[later], x))
        end_s = max(end_s, float(file.t_s[-1]))
        counts += lost
        counts[f"{name} epoch", "an earlier file has it too"] += int((~later).sum())
    t_s, x = (np.concatenate(some) for some in zip(*parts, strict=True))
    return PreciseOrbits(
        t_s=t_s,
        satellites=tuple(satellites),
        p_e_m=x[..., :3],
        clock_s=x[..., 3],
        unused=unused_of(counts),
    )


def _read(path: Path, start_gps_s: float) -> tuple[PreciseOrbits, Counter[tuple[str, str]]]:
    """Return the orbits of one file, and what of it is not used."""
    lines = read_text(path).tobytes().decode("latin-1").rstrip("\x1a\0").split("\n")
    satellites, announced, scale = _header(path, lines)
    kind = np.array([line[:1] for line in lines])
    epochs, records = np.flatnonzero(kind == "*"), np.flatnonzero(kind == "P")
    dates_s = np.array([date_to_gps_s(lines[k][1:].split()) for k in epochs.tolist()], np.float64)
    t_s = gps_of(dates_s, scale) - start_gps_s
    good = np.isfinite(t_s)
    good[good] = increasing(t_s[good])
    epoch = np.searchsorted(epochs, records) - 1
    values, is_whole = _numbers([lines[k] for k in records.tolist()])
    number = {name: k for k, name in enumerate(satellites)}
    column = np.array([number.get(_name(lines[k][1:4]), -1) for k in records.tolist()], np.int64)
    is_whole &= (column >= 0) & (epoch >= 0)
    _, first = np.unique(epoch[is_whole] * len(satellites) + column[is_whole], return_index=True)
    is_whole[np.delete(np.flatnonzero(is_whole), first)] = False  # the first of equal ones counts
    usable = (
        is_whole & good[np.maximum(epoch, 0)] if len(epochs) else np.zeros(len(records), np.bool_)
    )
    if not usable.any():
        raise BadInputError(
            f"{path}: must hold a position of a satellite, has none; fetch it again"
        )
    x = np.full((len(epochs), len(satellites), 4), np.nan)
    x[epoch[usable], column[usable]] = values[usable]
    x[(x[..., :3] == 0).all(axis=-1), :3] = np.nan
    x[np.abs(x[..., 3]) >= np.floor(_NO_CLOCK_US), 3] = np.nan
    counts = Counter[tuple[str, str]]()
    reason = "no four numbers with six decimals, or no satellite of the header, or twice"
    counts[f"{path.name} record", reason] = int((~is_whole).sum())
    reason = "an epoch has fewer than the header has satellites"
    counts[f"{path.name} record", reason] = max(x[..., 0].size - len(records), 0)
    counts[f"{path.name} epoch", "no date, or not later than all before"] = int((~good).sum())
    reason = "the header announces more: the file may be cut"
    counts[f"{path.name} epoch", reason] = max(announced - len(epochs), 0)
    if not any(line.startswith("EOF") for line in lines[-3:]):
        counts[f"{path.name} EOF", "is missing: the file may be cut"] = 1
    counts["SP3 velocity", "differences of positions serve"] = int((kind == "V").sum())
    is_used = np.array([name[0] in USED for name in satellites])
    for k in column[usable & ~is_used[column]].tolist():
        letter = satellites[k][0]
        name = CONSTELLATIONS[letter].name if letter != _LOW else "low satellites'"
        counts[f"{name} orbit", "constellation not used"] += 1
    orbits = PreciseOrbits(
        t_s=t_s[good],
        satellites=tuple(np.array(satellites)[is_used].tolist()),
        p_e_m=x[good][:, is_used, :3] * 1e3,
        clock_s=x[good][:, is_used, 3] * 1e-6,
    )
    return orbits, counts


def _header(path: Path, lines: list[str]) -> tuple[tuple[str, ...], int, str]:
    """Return satellites, number of epochs, and the time scale."""
    first = lines[0]
    is_first = first[:2] in ("#a", "#b", "#c", "#d", "# ") and first[2:3] in ("P", "V", " ")
    if not is_first:  # files of before 1993 leave letter and kind out
        raise BadInputError(f"{path}: line 1: must start with #a to #d, got {quoted(first[:12])}")
    listed = [line for line in lines if line.startswith("+ ")]
    names = "".join(line[9:60].ljust(51) for line in listed)
    scale = next((line[9:12] for line in lines if line.startswith("%c")), "GPS")
    scale = "GPS" if scale == "ccc" else scale  # SP3-a and -b have none
    try:
        announced, count = int(first[32:39]), int(listed[0][3:6])
    except (ValueError, IndexError) as error:
        raise BadInputError(
            f"{path}: header must tell the numbers of epochs and satellites, "
            f"got {quoted(first[32:39])}"
        ) from error
    satellites = tuple(_name(names[3 * k : 3 * k + 3]) for k in range(count))
    wrong = [s for s in satellites if s[:1] not in (*CONSTELLATIONS, _LOW) or not s[1:].isdigit()]
    if wrong or not satellites or len(set(satellites)) < count:
        got = wrong[0] if wrong else f"{count} with repetitions"
        raise BadInputError(f"{path}: header must list each satellite once, got {quoted(got)}")
    if scale not in SCALES:
        rule = f"time system must be one of {', '.join(SCALES)}"
        raise BadInputError(f"{path}: {rule}, got {quoted(scale)}")
    return satellites, announced, scale


def _name(text: str) -> str:
    """Return a satellite's name; SP3-a has GPS alone, by numbers."""
    text = text.ljust(3)
    return ("G" if text[0] == " " else text[0]) + text[1:].replace(" ", "0")


def _numbers(lines: Sequence[str]) -> tuple[FloatArray, BoolArray]:
    """Return positions, km, and clocks, us, (k, 4), and which records are whole."""
    rows = [line[:_WIDTH].ljust(_WIDTH).encode("latin-1") for line in lines]
    fields = np.array(rows, f"S{_WIDTH}").view("S1").reshape(-1, _WIDTH)[:, 4:].copy().view("S14")
    values = numbers(fields)
    # Six decimals at fixed columns: a shifted or shortened number would parse to another value.
    letters = fields.view("S1").reshape(len(fields), 4, 14)
    digits = np.char.isdigit(letters[:, :, [6, 8, 13]]).all(axis=(1, 2))
    is_whole = np.isfinite(values).all(axis=1) & (letters[:, :, 7] == b".").all(axis=1) & digits
    return values, is_whole


def write_precise(path: Path, orbits: PreciseOrbits, *, start_gps_s: float) -> None:
    """Write precise orbits: millimetres and picoseconds.

    Examples
    --------
    >>> p_e_m = np.full((1, 1, 3), 1.5e7)
    >>> orbits = PreciseOrbits(
    ...     t_s=np.zeros(1), satellites=("G01",), p_e_m=p_e_m, clock_s=np.zeros((1, 1))
    ... )
    >>> write_precise(Path("one.sp3"), orbits, start_gps_s=1_277_078_400.0)
    >>> Path("one.sp3").read_text().splitlines()[-2]
    'PG01  15000.000000  15000.000000  15000.000000      0.000000'
    """
    gps_s = start_gps_s + orbits.t_s
    names = list(orbits.satellites)
    step_s = float(np.median(np.diff(gps_s))) if len(gps_s) > 1 else 0.0
    week, second = divmod(gps_s[0], WEEK_S)
    day = int(gps_s[0] // 86_400)
    modified_julian = 44_244 + day  # MJD of 1980-01-06
    lines = [
        f"#dP{_date(gps_s[0])} {len(gps_s):7d} ORBIT IGS14 FIT FGNV",
        f"## {int(week):4d} {second:15.8f} {step_s:14.8f} {modified_julian:5d} "
        f"{gps_s[0] / 86_400 - day:15.13f}",
    ]
    padded = names + ["  0"] * (max(85, -(-len(names) // 17) * 17) - len(names))
    for k in range(0, len(padded), 17):
        count = f"{len(names):3d}" if k == 0 else "   "
        lines.append(f"+  {count}   " + "".join(padded[k : k + 17]))
    lines += ["++       " + "  0" * 17] * (len(padded) // 17)
    lines += ["%c M  cc GPS ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc"]
    lines += ["%c cc cc ccc ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc"]
    km, clock_us = np.nan_to_num(orbits.p_e_m / 1e3), orbits.clock_s * 1e6
    clock_us = np.where(np.isfinite(clock_us), clock_us, _NO_CLOCK_US)
    for k, moment in enumerate(gps_s):
        lines.append(f"*  {_date(moment)}")
        lines += [
            f"P{name}{x:14.6f}{y:14.6f}{z:14.6f}{clock:14.6f}"
            for name, (x, y, z), clock in zip(
                names, km[k].tolist(), clock_us[k].tolist(), strict=True
            )
        ]
    path.write_text("\n".join([*lines, "EOF"]) + "\n", encoding="ascii")


def _date(gps_s: float) -> str:
    """Return year, month, day, hour, minute, second in SP3's columns."""
    whole_s, microseconds = divmod(round(gps_s * 1e6), 1_000_000)
    year, month, day, hour, minute, second = gps_s_to_date(whole_s)
    date = f"{year:4d} {month:2d} {day:2d} {hour:2d} {minute:2d}"
    return f"{date} {second + microseconds / 1e6:11.8f}"
