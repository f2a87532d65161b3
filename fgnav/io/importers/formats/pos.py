"""RTKLIB's solution files, ``.pos`` [1]_.

References
----------
.. [1] T. Takasu, RTKLIB ver. 2.4.2 Manual, 2013, appendix B.1, "Positioning Solution File".
"""

from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.earth import geodetic
from fgnav.io.flight import columns as col
from fgnav.io.gps_time import GPS_EPOCH, UNIX_OF_GPS_S, WEEK_S, gps_of_utc
from fgnav.io.importers.recording import Recording, vectors
from fgnav.io.importers.settings import Settings
from fgnav.io.user_files import read_bytes

_DEGREES = ("latitude(deg)", "longitude(deg)", "height(m)")
_ECEF = ("x-ecef(m)", "y-ecef(m)", "z-ecef(m)")
_SIGMA = ("sdn(m)", "sde(m)", "sdu(m)")
_VELOCITY = ("vn(m/s)", "ve(m/s)", "vu(m/s)")
_VELOCITY_SIGMA = ("sdvn", "sdve", "sdvu")
_LEAST_SIGMA = 5e-5  # RTKLIB prints four decimals: a zero is less than half the last


def read_pos(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Read a solution: geodetic degrees or ECEF, times as dates or week and seconds."""
    lines = read_bytes(path).decode("ascii", "replace").splitlines()
    head = next((line for line in lines if line.startswith("%") and "Q" in line.split()), "")
    names = head.lstrip("% ").replace(",", " ").split()
    if not names or names[0] not in ("GPST", "UTC"):
        raise BadInputError(
            f"{path}: must have RTKLIB's line of column names with times in GPST or UTC; switch on "
            "out-outhead and set out-timesys"
        )
    rows = [line.replace(",", " ").split() for line in lines if line and line[0] != "%"]
    if not rows:
        raise BadInputError(f"{path}: holds no solution")
    numbers = _numbers(path, rows, len(names) + 1)  # a time has two words
    columns = dict(zip(names[1:], numbers.T, strict=True))
    gps_s = _gps_seconds(path, rows, utc=names[0] == "UTC")
    fixes = vectors(col.PLACE, _place(path, columns))
    if set(_SIGMA) <= set(columns):
        sigma_m = np.stack([columns[name] for name in _SIGMA], axis=1)
        fixes |= vectors(col.POSITION_SIGMA, np.maximum(sigma_m, _LEAST_SIGMA))
    if set(_VELOCITY) <= set(columns):
        up = np.array([1.0, 1.0, -1.0])
        fixes |= vectors(col.VELOCITY, np.stack([columns[n] for n in _VELOCITY], axis=1) * up)
        if set(_VELOCITY_SIGMA) <= set(columns):
            sigma_mps = np.stack([columns[name] for name in _VELOCITY_SIGMA], axis=1)
            fixes |= vectors(col.VELOCITY_SIGMA, np.maximum(sigma_mps, _LEAST_SIGMA))
    start_s = float(np.floor(gps_s[0] * 1e3) / 1e3)
    return Recording(
        source=path, tables={"fixes": {"t_s": gps_s - start_s, **fixes}}, gps_start_s=start_s
    )


def _numbers(path: Path, rows: list[list[str]], width: int) -> FloatArray:
    """Return everything behind the two words of the time."""
    for k, row in enumerate(rows):
        if len(row) != width:
            raise BadInputError(
                f"{path}: solution {k + 1}: must have {width} columns, got {len(row)}; the file is "
                "cut or of mixed formats"
            )
    try:
        return np.array([row[2:] for row in rows], dtype=np.float64)
    except ValueError as error:
        raise BadInputError(f"{path}: must hold numbers, {error}") from None


def _gps_seconds(path: Path, rows: list[list[str]], *, utc: bool) -> FloatArray:
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
    gps_s = (dates - GPS_EPOCH) / np.timedelta64(1, "s")
    return gps_of_utc(gps_s + UNIX_OF_GPS_S) if utc else np.asarray(gps_s)


def _place(path: Path, columns: dict[str, FloatArray]) -> FloatArray:
    """Return (k, 3) latitude deg, longitude deg, height m."""
    if set(_DEGREES) <= set(columns):
        return np.stack([columns[name] for name in _DEGREES], axis=1)
    if set(_ECEF) <= set(columns):
        place = geodetic(np.stack([columns[name] for name in _ECEF], axis=1))
        place[:, :2] = np.degrees(place[:, :2])
        return place
    raise BadInputError(
        f"{path}: positions must be latitude(deg), longitude(deg), height(m) or x/y/z-ecef(m); set "
        "out-solformat to llh or xyz"
    )
