"""RTKLIB's solution files, ``.pos`` [1]_.

References
----------
.. [1] T. Takasu, RTKLIB ver. 2.4.2 Manual, 2013, appendix B.1, "Positioning Solution File".
"""

from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, FloatArray, Unused
from fgnav.geometry.earth import geodetic
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import vectors
from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.formats.text_columns import read_dates
from fgnav.io.importers.recording import ABOVE_SEA, Recording, unused_columns
from fgnav.io.importers.settings import Settings
from fgnav.io.tables import numbers
from fgnav.io.user_files import read_lines

_DEGREES = ("latitude(deg)", "longitude(deg)", "height(m)")
_MINUTES = ("latitude(d'\")", "longitude(d'\")")  # three words each
_ECEF = ("x-ecef(m)", "y-ecef(m)", "z-ecef(m)")
_SIGMA = ("sdn(m)", "sde(m)", "sdu(m)")
_VELOCITY = ("vn(m/s)", "ve(m/s)", "vu(m/s)")
_VELOCITY_SIGMA = ("sdvn", "sdve", "sdvu")
_LEAST_SIGMA = 5e-5  # RTKLIB prints four decimals: a zero is less than half the last
_ZONES = {"GPST": "", "UTC": "Z", "JST": "+09:00"}
_Texts: TypeAlias = dict[str, NDArray[np.str_]]
_SEPARATORS = str.maketrans(",;\t", "   ")


def read_pos(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Read a solution: degrees, degrees and minutes, or ECEF; dates or week and seconds.

    Rows of another number of columns, as of a cut line, are left out and counted, as are those in
    which something that is needed is no number.
    """
    whole, lost = read_lines(path)
    lines = [line.translate(_SEPARATORS) for line in whole]
    head = next((line for line in lines if line.startswith("%") and "Q" in line.split()), "")
    names = head.lstrip("% ").split()
    if not names or names[0] not in _ZONES:
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
    columns: _Texts = dict(zip(names[1:], np.array(complete).T[2:], strict=True))
    gps_s = _gps_seconds(path, complete, names[0])
    fixes = vectors(col.PLACE, _place(path, columns))
    if set(_SIGMA) <= set(columns):
        fixes |= vectors(col.POSITION_SIGMA, np.maximum(_taken(columns, _SIGMA), _LEAST_SIGMA))
    if set(_VELOCITY) <= set(columns):
        fixes |= vectors(col.VELOCITY, _taken(columns, _VELOCITY) * [1.0, 1.0, -1.0])
        if set(_VELOCITY_SIGMA) <= set(columns):
            sigma_mps = np.maximum(_taken(columns, _VELOCITY_SIGMA), _LEAST_SIGMA)
            fixes |= vectors(col.VELOCITY_SIGMA, sigma_mps)
    first_s = gps_s[np.isfinite(gps_s)][:1].sum()
    start_s = float(np.floor(first_s * 1e3) / 1e3)
    above_sea = any("/geoidal" in line for line in lines if line.startswith("%"))
    cut = Unused(
        what=f"{path.name} row",
        reason="has another number of columns: the file is cut or of mixed formats",
        count=len(rows) - len(complete),
    )
    return Recording(
        source=path,
        tables={"fixes": {"t_s": gps_s - start_s, **fixes}},
        gps_start_s=start_s,
        unused=(
            lost,
            cut,
            unused_columns(path, [*columns], len(complete), "the flight has none"),
        ),
        notes={"fixes": ABOVE_SEA} if above_sea else {},
    )


def _taken(columns: _Texts, names: tuple[str, ...]) -> FloatArray:
    """Take columns out as numbers, (k, c), NaN of none; those that nobody needs stay texts."""
    return numbers(np.array([columns.pop(name) for name in names])).T


def _gps_seconds(path: Path, rows: list[list[str]], system: str) -> FloatArray:
    """Return (k,) seconds since 1980-01-06."""
    if "/" not in rows[0][0]:
        return np.asarray(numbers(np.array([row[:2] for row in rows])) @ [WEEK_S, 1.0])
    gps_s, _ = read_dates(path, np.array([f"{row[0]} {row[1]}{_ZONES[system]}" for row in rows]))
    return gps_s


def _place(path: Path, columns: _Texts) -> FloatArray:
    """Return (k, 3) latitude deg, longitude deg, height m."""
    words = tuple(f"{name}{part}" for name in _MINUTES for part in "dms")
    if {*words, "height(m)"} <= set(columns):
        parts = _taken(columns, words).reshape(-1, 2, 3)
        size_deg = np.abs(parts) @ [1.0, 1 / 60, 1 / 3600]
        place_deg = np.copysign(size_deg, parts[:, :, 0])  # -0 degrees are south or west
        return np.column_stack([place_deg, _taken(columns, ("height(m)",))])
    if set(_DEGREES) <= set(columns):
        return _taken(columns, _DEGREES)
    if set(_ECEF) <= set(columns):
        place = geodetic(_taken(columns, _ECEF))
        place[:, :2] = np.degrees(place[:, :2])
        return place
    raise BadInputError(
        f"{path}: positions must be latitude(deg), longitude(deg), height(m) or x/y/z-ecef(m); set "
        "out-solformat to llh or xyz"
    )
