"""RTKLIB's solution files, ``.pos`` [1]_.

References
----------
.. [1] T. Takasu, RTKLIB ver. 2.4.2 Manual, 2013, appendix B.1, "Positioning Solution File".
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, FloatArray, Loss
from fgnav.geometry.earth import geodetic
from fgnav.io.flight import columns as col
from fgnav.io.gps_time import GPS_EPOCH, UNIX_OF_GPS_S, WEEK_S, gps_of_utc
from fgnav.io.importers.recording import Recording, unused_columns, vectors
from fgnav.io.importers.settings import Settings
from fgnav.io.user_files import read_lines

_DEGREES = ("latitude(deg)", "longitude(deg)", "height(m)")
_MINUTES = ("latitude(d'\")", "longitude(d'\")")  # three words each
_ECEF = ("x-ecef(m)", "y-ecef(m)", "z-ecef(m)")
_SIGMA = ("sdn(m)", "sde(m)", "sdu(m)")
_VELOCITY = ("vn(m/s)", "ve(m/s)", "vu(m/s)")
_VELOCITY_SIGMA = ("sdvn", "sdve", "sdvu")
_LEAST_SIGMA = 5e-5  # RTKLIB prints four decimals: a zero is less than half the last
_AHEAD_S = {"GPST": 0.0, "UTC": 0.0, "JST": 9 * 3600.0}  # JST is that of UTC
_SEPARATORS = str.maketrans(",;\t", "   ")


def read_pos(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Read a solution: degrees, degrees and minutes, or ECEF; dates or week and seconds.

    Rows of another number of columns, as of a cut line, are left out and counted.
    """
    lines = [line.translate(_SEPARATORS) for line in read_lines(path)]
    head = next((line for line in lines if line.startswith("%") and "Q" in line.split()), "")
    names = head.lstrip("% ").split()
    if not names or names[0] not in _AHEAD_S:
        raise BadInputError(
            f"{path}: must have RTKLIB's line of column names with times in GPST, UTC or JST; "
            "switch on out-outhead and set out-timesys"
        )
    names = [w for n in names for w in ((n + "d", n + "m", n + "s") if n in _MINUTES else (n,))]
    rows = [line.split() for line in lines if line and line[0] != "%"]
    complete = [row for row in rows if len(row) == len(names) + 1]  # a time has two words
    if not complete:
        rule = f"rows must have {len(names) + 1} columns, got {len(rows[0])}" if rows else ""
        raise BadInputError(f"{path}: {rule or 'holds no solution'}; take the file again")
    columns = _Columns(path, dict(zip(names[1:], np.array(complete).T[2:], strict=True)))
    gps_s = _gps_seconds(path, complete, names[0])
    fixes = vectors(col.PLACE, _place(path, columns))
    if columns.have(_SIGMA):
        fixes |= vectors(col.POSITION_SIGMA, np.maximum(columns.numbers(_SIGMA), _LEAST_SIGMA))
    if columns.have(_VELOCITY):
        fixes |= vectors(col.VELOCITY, columns.numbers(_VELOCITY) * [1.0, 1.0, -1.0])
        if columns.have(_VELOCITY_SIGMA):
            sigma_mps = np.maximum(columns.numbers(_VELOCITY_SIGMA), _LEAST_SIGMA)
            fixes |= vectors(col.VELOCITY_SIGMA, sigma_mps)
    start_s = float(np.floor(gps_s[0] * 1e3) / 1e3)
    cut = Loss(
        what=f"{path.name} row",
        reason="has another number of columns: the file is cut or of mixed formats",
        count=len(rows) - len(complete),
    )
    return Recording(
        source=path,
        tables={"fixes": {"t_s": gps_s - start_s, **fixes}},
        gps_start_s=start_s,
        losses=(cut, unused_columns(path, columns.unused(), len(complete), "the flight has none")),
    )


class _Columns:
    """Columns of texts by name, which are numbers only where they are needed."""

    def __init__(self, path: Path, texts: dict[str, NDArray[np.str_]]) -> None:
        self._path, self._texts = path, texts
        self._used: set[str] = set()

    def have(self, names: tuple[str, ...]) -> bool:
        """Return True if all of the columns are there."""
        return set(names) <= set(self._texts)

    def numbers(self, names: tuple[str, ...]) -> FloatArray:
        """Return columns as numbers, (k, c)."""
        self._used |= set(names)
        try:
            return np.array([self._texts[name] for name in names], dtype=np.float64).T
        except ValueError as error:
            raise BadInputError(f"{self._path}: must hold numbers, {error}") from None

    def unused(self) -> list[str]:
        """Return the names of the columns that nobody asked for."""
        return [name for name in self._texts if name not in self._used]


def _gps_seconds(path: Path, rows: list[list[str]], system: str) -> FloatArray:
    """Return (k,) seconds since 1980-01-06."""
    words = np.array([row[:2] for row in rows])
    try:
        if "/" not in rows[0][0]:
            week = words.astype(np.float64)
            return np.asarray(WEEK_S * week[:, 0] + week[:, 1])
        texts = np.char.add(np.char.add(np.char.replace(words[:, 0], "/", "-"), "T"), words[:, 1])
        dates = texts.astype("datetime64[us]")
    except ValueError as error:
        raise BadInputError(f"{path}: times must be dates or week and seconds, {error}") from None
    gps_s = (dates - GPS_EPOCH) / np.timedelta64(1, "s") - _AHEAD_S[system]
    return np.asarray(gps_s) if system == "GPST" else gps_of_utc(gps_s + UNIX_OF_GPS_S)


def _place(path: Path, columns: _Columns) -> FloatArray:
    """Return (k, 3) latitude deg, longitude deg, height m."""
    words = tuple(f"{name}{part}" for name in _MINUTES for part in "dms")
    if columns.have((*words, "height(m)")):
        parts = columns.numbers(words).reshape(-1, 2, 3)
        size_deg = np.abs(parts) @ [1.0, 1 / 60, 1 / 3600]
        place_deg = np.copysign(size_deg, parts[:, :, 0])  # -0 degrees are south or west
        return np.column_stack([place_deg, columns.numbers(("height(m)",))])
    if columns.have(_DEGREES):
        return columns.numbers(_DEGREES)
    if columns.have(_ECEF):
        place = geodetic(columns.numbers(_ECEF))
        place[:, :2] = np.degrees(place[:, :2])
        return place
    raise BadInputError(
        f"{path}: positions must be latitude(deg), longitude(deg), height(m) or x/y/z-ecef(m); set "
        "out-solformat to llh or xyz"
    )
