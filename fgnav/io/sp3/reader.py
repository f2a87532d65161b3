"""Precise orbits and clocks in SP3-a, -b, -c and -d format [1]_.

Records and epochs that break a rule are left out and counted.

References
----------
.. [1] S. Hilla, The Extended Standard Product 3 Orbit Format (SP3-d), 2016.
"""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, Loss, quoted
from fgnav.io.gps_time import UNIX_OF_GPS_S, date_to_gps_s, gps_of_utc
from fgnav.io.rinex.losses import CONSTELLATIONS, KNOWN_SATELLITES
from fgnav.io.rinex.observations import in_order
from fgnav.io.rinex.text import read_text
from fgnav.io.tables import is_number
from fgnav.types.orbits import PreciseOrbits

# Whole seconds behind GPS time, of BeiDou's since 2006; of TAI ahead.
_BEHIND_GPS_S = {"GPS": 0.0, "GAL": 0.0, "QZS": 0.0, "BDT": 14.0, "TAI": -19.0}
_UTC = ("UTC", "GLO")
_NO_CLOCK_US = 999_999.0
_WIDTH = 60  # columns of a position record that are read
_OTHERS = CONSTELLATIONS | {"L": "low satellites'"}


def read_precise(paths: Sequence[Path], start_gps_s: float) -> PreciseOrbits:
    """Read precise orbits and clocks of one or several days.

    Parameters
    ----------
    paths : sequence of Path
        SP3 files, plain or packed.
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
        If a header breaks a rule, or no record is whole.
    """
    if not paths:
        raise BadInputError("orbits: must name a file, the list is empty")
    files = [(_read(path, start_gps_s), path.name) for path in paths]
    files.sort(key=lambda one: float(one[0].t_s[0]))
    satellites = sorted({name for file, _ in files for name in file.satellites})
    t_s, p_e_m, clock_s, losses = [], [], [], list[Loss]()
    end_s = -np.inf
    for file, name in files:
        later = file.t_s > end_s
        column = [satellites.index(name) for name in file.satellites]
        place = np.full((int(later.sum()), len(satellites), 3), np.nan)
        clock = np.full(place.shape[:2], np.nan)
        place[:, column], clock[:, column] = file.p_e_m[later], file.clock_s[later]
        t_s.append(file.t_s[later])
        p_e_m.append(place)
        clock_s.append(clock)
        end_s = max(end_s, float(file.t_s[-1]))
        losses += file.losses
        reason, count = "an earlier file has it too", int((~later).sum())
        losses += [Loss(what=f"{name} epoch", reason=reason, count=count)] if count else []
    return PreciseOrbits(
        t_s=np.concatenate(t_s),
        satellites=tuple(satellites),
        p_e_m=np.concatenate(p_e_m),
        clock_s=np.concatenate(clock_s),
        losses=tuple(losses),
    )


def _read(path: Path, start_gps_s: float) -> PreciseOrbits:
    """Read one file."""
    content = read_text(path).tobytes().decode("latin-1").rstrip("\x1a\0")
    lines = content.split("\n")
    satellites, announced, scale = _header(path, lines)
    kind = np.array([line[:1] for line in lines])
    epochs, records = np.flatnonzero(kind == "*"), np.flatnonzero(kind == "P")
    t_s = _gps_s([lines[k] for k in epochs.tolist()], scale) - start_gps_s
    good = np.isfinite(t_s)
    good[good] = in_order(t_s[good])
    row = np.searchsorted(epochs, records) - 1
    values, whole = _numbers([lines[k] for k in records.tolist()])
    number = {name: k for k, name in enumerate(satellites)}
    names = [_name(lines[k][1:4]) for k in records.tolist()]
    column = np.array([number.get(name, -1) for name in names], np.int64)
    whole &= (column >= 0) & (row >= 0)
    _, first = np.unique(row[whole] * len(satellites) + column[whole], return_index=True)
    whole[np.delete(np.flatnonzero(whole), first)] = False  # the first of equal ones counts
    usable = whole & good[np.maximum(row, 0)] if len(epochs) else np.zeros(len(records), np.bool_)
    if not usable.any():
        raise BadInputError(
            f"{path}: must hold a position of a satellite, has none; fetch it again"
        )
    p_e_m = np.full((len(epochs), len(satellites), 3), np.nan)
    clock_s = np.full(p_e_m.shape[:2], np.nan)
    x = values[usable]
    absent = (x[:, :3] == 0).all(axis=1)
    where = row[usable], column[usable]
    p_e_m[where] = np.where(absent[:, None], np.nan, x[:, :3] * 1e3)
    clock_s[where] = np.where(np.abs(x[:, 3]) >= _NO_CLOCK_US, np.nan, x[:, 3] * 1e-6)
    counts = Counter[tuple[str, str]]()
    reason = "no four numbers with six decimals, or no satellite of the header, or twice"
    counts[f"{path.name} record", reason] = int((~whole).sum())
    reason = "an epoch has fewer than the header has satellites"
    counts[f"{path.name} record", reason] = max(p_e_m[..., 0].size - len(records), 0)
    reason = "no date, or not later than all before"
    counts[f"{path.name} epoch", reason] = int((~good).sum())
    reason = "the header announces more: the file may be cut"
    counts[f"{path.name} epoch", reason] = max(announced - len(epochs), 0)
    if not any(line.startswith("EOF") for line in lines[-3:]):
        counts[f"{path.name} EOF", "is missing: the file may be cut"] = 1
    counts["SP3 velocity", "differences of positions serve"] = int((kind == "V").sum())
    for k, n in Counter(names[k][0] for k in np.flatnonzero(usable)).items():
        if k not in KNOWN_SATELLITES:
            counts[f"{_OTHERS.get(k, k)} orbit", "constellation not used"] = n
    is_used = np.array([name[0] in KNOWN_SATELLITES for name in satellites])
    return PreciseOrbits(
        t_s=t_s[good],
        satellites=tuple(np.array(satellites)[is_used].tolist()),
        p_e_m=p_e_m[good][:, is_used],
        clock_s=clock_s[good][:, is_used],
        losses=tuple(Loss(what=w, reason=why, count=n) for (w, why), n in counts.items() if n),
    )


def _header(path: Path, lines: list[str]) -> tuple[tuple[str, ...], int, str]:
    """Return satellites, number of epochs, and the time scale."""
    first = lines[0]
    if first[:2] not in ("#a", "#b", "#c", "#d") or first[2:3] not in ("P", "V"):
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
    wrong = [s for s in satellites if s[:1] not in "GRECJSIL" or not s[1:].isdigit()]
    if wrong or not satellites or len(set(satellites)) < count:
        got = wrong[0] if wrong else f"{count} with repetitions"
        raise BadInputError(f"{path}: header must list each satellite once, got {quoted(got)}")
    if scale not in (*_BEHIND_GPS_S, *_UTC):
        scales = ", ".join((*_BEHIND_GPS_S, *_UTC))
        raise BadInputError(f"{path}: time system must be one of {scales}, got {quoted(scale)}")
    return satellites, announced, scale


def _name(text: str) -> str:
    """Return a satellite's name; SP3-a has GPS alone, by numbers."""
    text = text.ljust(3)
    return ("G" if text[0] == " " else text[0]) + text[1:].replace(" ", "0")


def _gps_s(lines: Sequence[str], scale: str) -> FloatArray:
    """Return the GPS times of epochs; NaN where there is no date."""
    t_s = np.array([date_to_gps_s(line[1:].split()) for line in lines], np.float64)
    return gps_of_utc(t_s + UNIX_OF_GPS_S) if scale in _UTC else t_s + _BEHIND_GPS_S[scale]


def _numbers(lines: Sequence[str]) -> tuple[FloatArray, BoolArray]:
    """Return positions, km, and clocks, us, (k, 4), and which records are whole."""
    rows = [line[:_WIDTH].ljust(_WIDTH).encode("latin-1") for line in lines]
    fields = np.array(rows, f"S{_WIDTH}").view("S1").reshape(-1, _WIDTH)[:, 4:].copy().view("S14")
    try:
        values = fields.astype(np.float64)
    except ValueError:
        numbers = [[float(x) if is_number(x) else np.nan for x in row] for row in fields.tolist()]
        values = np.array(numbers)
    # Six decimals at fixed columns: a shifted or shortened number would parse to another value.
    letters = fields.view("S1").reshape(len(fields), 4, 14)
    digits = np.char.isdigit(letters[:, :, [6, 8, 13]]).all(axis=(1, 2))
    whole = np.isfinite(values).all(axis=1) & (letters[:, :, 7] == b".").all(axis=1) & digits
    return values, whole
