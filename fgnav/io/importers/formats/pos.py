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
from fgnav.io.flight.columns import samples
from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.formats.fields import Fields
from fgnav.io.importers.formats.text_columns import complete_rows, read_dates
from fgnav.io.importers.recording import ABOVE_SEA, Recording, unused_columns
from fgnav.io.importers.settings import Settings
from fgnav.io.tables import numbers
from fgnav.io.user_files import read_lines

_DEGREES = ("latitude(deg)", "longitude(deg)", "height(m)")
_MINUTES = ("latitude(d'\")", "longitude(d'\")")  # three words each
_ECEF = ("x-ecef(m)", "y-ecef(m)", "z-ecef(m)")
_FIELDS = (
    Fields("fixes", col.PLACE, _DEGREES),
    Fields("fixes", col.POSITION_SIGMA, ("sdn(m)", "sde(m)", "sdu(m)")),
    Fields("fixes", col.VELOCITY, ("vn(m/s)", "ve(m/s)", "vu(m/s)"), (1.0, 1.0, -1.0)),
    Fields("fixes", col.VELOCITY_SIGMA, ("sdvn", "sdve", "sdvu")),
)
_LEAST_SIGMA = 5e-5  # RTKLIB prints four decimals: a zero is less than half the last
_ZONES = {"GPST": "", "UTC": "Z", "JST": "+09:00"}
_SEPARATORS = str.maketrans(",;\t", "   ")


def read_pos(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    r"""Read a solution: degrees, degrees and minutes, or ECEF; dates or week and seconds.

    Rows of another number of columns, as of a cut line, are left out and counted, as are those in
    which something that is needed is no number.

    Examples
    --------
    >>> head = "% GPST latitude(deg) longitude(deg) height(m) Q\n"
    >>> _ = Path("a.pos").write_text(head + "2374 243258.500 40.0 -4.0 700.0 1\n")
    >>> read_pos(Path("a.pos"), Settings(), Path()).gps_start_s
    1436038458.5
    """
    text, lost = read_lines(path)
    lines = [line.translate(_SEPARATORS) for line in text]
    head = next((line for line in lines if line.startswith("%") and "Q" in line.split()), "")
    names = head.lstrip("% ").split()
    if not names or names[0] not in _ZONES:
        raise BadInputError(
            f"{path}: must have RTKLIB's line of column names with times in GPST, UTC or JST; "
            "switch on out-outhead and set out-timesys"
        )
    names = [w for n in names for w in ((n + "d", n + "m", n + "s") if n in _MINUTES else (n,))]
    rows = [line.split() for line in lines if line and line[0] != "%"]
    cells, cut = complete_rows(path, rows, len(names) + 1)  # a time has two words
    if not len(cells):
        rule = f"rows must have {len(names) + 1} columns, got {len(rows[0])}" if rows else ""
        raise BadInputError(f"{path}: {rule or 'holds no solution'}; take the file again")
    columns = {name: numbers(cells[:, k]) for k, name in enumerate(names[1:], 2)}
    unused = _with_degrees(path, columns)
    gps_s = _gps_seconds(path, cells[:, :2], names[0])
    start_s = float(np.floor(gps_s[np.isfinite(gps_s)][:1].sum() * 1e3) / 1e3)
    layout = [fields for fields in _FIELDS if set(fields.names) <= set(columns)]
    for fields in layout[1:]:
        if fields.columns in (col.POSITION_SIGMA, col.VELOCITY_SIGMA):
            columns |= {name: np.maximum(columns[name], _LEAST_SIGMA) for name in fields.names}
    unused -= {name for fields in layout for name in fields.names}
    names = [name for name in names if name in unused]
    return Recording(
        source=path,
        tables={
            "fixes": samples(gps_s - start_s, *((f.columns, f.values(columns)) for f in layout))
        },
        gps_start_s=start_s,
        unused=(
            lost,
            cut,
            unused_columns(path, names, len(cells), "the flight has none"),
        ),
        notes={"fixes": ABOVE_SEA}
        if any("/geoidal" in line for line in lines if line.startswith("%"))
        else {},
    )


def _gps_seconds(path: Path, words: np.ndarray, system: str) -> FloatArray:
    """Return (k,) seconds since 1980-01-06 of (k, 2) words of time."""
    if "/" not in words[0, 0]:
        return np.asarray(numbers(words) @ [WEEK_S, 1.0])
    texts = np.array([f"{day} {time}{_ZONES[system]}" for day, time in words.tolist()])
    return read_dates(path, texts)[0]


def _with_degrees(path: Path, columns: dict[str, FloatArray]) -> set[str]:
    """Add latitude, longitude and height to columns; return the names of the others."""
    words = tuple(f"{name}{word}" for name in _MINUTES for word in "dms")
    others = set(columns) - {*words, *_ECEF}
    if {*words, "height(m)"} <= set(columns):
        angles = np.stack([columns[name] for name in words]).reshape(2, 3, -1)
        size_deg = np.einsum("ijk,j->ik", np.abs(angles), [1.0, 1 / 60, 1 / 3600])
        position = np.copysign(size_deg, angles[:, 0])  # -0 degrees are south or west
    elif set(_ECEF) <= set(columns):
        position = geodetic(np.stack([columns[name] for name in _ECEF], axis=1)).T
        position[:2] = np.degrees(position[:2])
    elif set(_DEGREES) <= set(columns):
        return others
    else:
        raise BadInputError(
            f"{path}: positions must be latitude(deg), longitude(deg), height(m) or x/y/z-ecef(m); "
            "set out-solformat to llh or xyz"
        )
    columns |= dict(zip(_DEGREES, position, strict=False))
    return others
