"""What the columns of a CSV file may be: by their names, else by their numbers.

A guess to start from: ``fgnav new`` writes it down, and the user looks at it.
"""

import csv
import re
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.io.flight.columns import FORCE, PLACE, RATE, VELOCITY
from fgnav.io.importers.formats.text_columns import is_number, usual_width
from fgnav.io.importers.settings import UNITS, CsvTable

_ROWS = 20_000  # looked at
_MOST_SHARE_ODD = 0.01  # of rows, that may break a rule: cut lines
# Names in the wild, lower case, brackets with units aside: PX4's, Xsens', loggers', MATLAB's.
_TRIPLES = (
    (FORCE, r"(a|f|acc\w*?|lin\w*acc\w*|specific_?force)[_. ]?({axis}|\[{k}\])", "xyz"),
    (RATE, r"(g|w|gyr\w*?|omega|ang\w*(vel|rate)\w*|rate)[_. ]?({axis}|\[{k}\])", "xyz"),
    (VELOCITY, r"v(el)?[_. ]?{axis}(orth|ast|own)?", "ned"),
)
_NAMES = {
    "t_s": r"t|time.*|timestamp.*|sec(onds)?.*|tow|utc.*|gps_?time.*|unix.*|sow",
    "latitude_deg": r"lat(itude)?.*",
    "longitude_deg": r"(lon(gitude)?|lng).*",
    "height_m": r"(h|hgt|height|alt(itude)?|ellips).*",
} | {
    name: pattern.format(axis=axis, k=k)
    for names, pattern, axes in _TRIPLES
    for k, (name, axis) in enumerate(zip(names, axes, strict=True))
}
_UNIT = re.compile(r"[\[(]([^\])]+)[\])]\s*$")
_SPELLINGS = {"m/s^2": "m/s2", "m/s²": "m/s2", "°/s": "deg/s", "degrees": "deg", "meters": "m"}
_GRAVITY = {1.0: "g", 9.80665: "m/s2", 1000.0: "mg"}  # median length of specific force, by unit
_NEAR = 0.3  # of that: a vehicle's mean is gravity's, vibration and biases make up to some tenths


def guessed(path: Path) -> CsvTable:
    """Return what a CSV file may hold: samples of an inertial unit, or fixes.

    Raises
    ------
    BadInputError
        If neither is found.
    """
    with path.open(encoding="utf-8", errors="replace", newline="") as file:
        lines = list(islice(file, _ROWS))
    delimiter = max(",;\t", key=lambda one: lines[0].count(one) if lines else 0)
    rows = [row for row in csv.reader(lines, delimiter=delimiter, skipinitialspace=True) if row]
    header = bool(rows) and not all(is_number(cell) for cell in rows[0])
    width = usual_width(rows)
    body = [row for row in rows[header:] if len(row) == width]
    if len(body) < 2:
        raise BadInputError(f"{path}: must hold two rows of numbers or more to guess columns by")
    x = np.array([[float(c) if is_number(c) else np.nan for c in row] for row in body])
    names = _by_name(rows[0]) if header else {}
    if not any({"t_s", *wanted} <= set(names) for wanted in (FORCE, PLACE)):
        names = _by_numbers(x)
    kind = "imu" if set(FORCE) <= set(names) else "fixes"
    wanted = FORCE if kind == "imu" else PLACE
    if "t_s" not in names or not set(wanted) <= set(names):
        raise BadInputError(
            f"{path}: neither specific force nor places are found in its columns, or no time; "
            "describe them in [[csv]] of a file for `fgnav import --settings`, docs/own_log.md"
        )
    groups = ("t_s",), wanted, RATE if kind == "imu" else VELOCITY
    places = {n: names[n] for group in groups if set(group) <= set(names) for n in group}
    fields: dict[str, Any] = {
        "table": kind,
        "file": path.name,
        "header": header,
        "delimiter": delimiter,
        "columns": {n: rows[0][k].strip() if header else k + 1 for n, k in places.items()},
        "units": _units(kind, places, x, rows[0] if header else []),
    }
    first_s = x[0, places["t_s"]] * UNITS["s"][fields["units"]["s"]]
    if fields["units"]["s"] == "date":
        fields["clock"] = "gps"
    elif first_s > 1e9:  # s: as GPS time 2011 and later, which loggers rarely use; UTC since 2001
        fields["clock"] = "utc"
    return CsvTable(**fields)


def _by_name(head: list[str]) -> dict[str, int]:
    """Return places of columns by the names in a header."""
    plain = [_UNIT.sub("", cell.strip().lower()).strip() for cell in head]
    places_by_name = {}
    for name, pattern in _NAMES.items():
        places = [k for k, cell in enumerate(plain) if re.fullmatch(pattern, cell)]
        if places:
            places_by_name[name] = places[0]
    return places_by_name


def _by_numbers(x: FloatArray) -> dict[str, int]:
    """Return places of columns by what their numbers do: a time runs on, a force is gravity's."""
    steps = np.diff(x, axis=0)
    runs = [k for k in range(x.shape[1]) if (steps[:, k] <= 0).mean() < _MOST_SHARE_ODD]
    if not runs:
        return {}
    columns = {"t_s": runs[0]}
    triples = [k for k in range(x.shape[1] - 2) if not {k, k + 1, k + 2} & set(runs)]
    lengths = {k: float(np.nanmedian(np.linalg.norm(x[:, k : k + 3], axis=1))) for k in triples}
    near = {k: min(abs(length / size - 1) for size in _GRAVITY) for k, length in lengths.items()}
    force = min(near, key=near.__getitem__, default=None)
    if force is None or near[force] > _NEAR:
        return columns
    columns |= {name: force + k for k, name in enumerate(FORCE)}
    rate = next(
        (k for k in triples if k >= force + 3), next((k for k in triples if k + 3 <= force), None)
    )
    if rate is not None:
        columns |= {name: rate + k for k, name in enumerate(RATE)}
    return columns


def _units(kind: str, places: dict[str, int], x: FloatArray, head: list[str]) -> dict[str, str]:
    """Return units by what the header says in brackets, else by the size of the numbers."""
    units: dict[str, str] = {}
    for name, place in places.items():
        bracketed = _UNIT.search(head[place].lower()) if head else None
        unit = _SPELLINGS.get(bracketed[1].strip(), bracketed[1].strip()) if bracketed else ""
        suffix = name.rsplit("_", 1)[1]
        if unit in UNITS.get(suffix, {}):
            units[suffix] = unit
    if np.isnan(x[:, places["t_s"]]).all():
        units["s"] = "date"
    elif "s" not in units:
        step = float(np.nanmedian(np.diff(x[:, places["t_s"]])))
        longest_s = 0.1 if kind == "imu" else 10.0  # between samples, between fixes
        fits = [unit for unit in ("s", "ms", "us", "ns") if step * UNITS["s"][unit] <= longest_s]
        units["s"] = fits[0] if fits else "s"
    if kind == "imu" and "mps2" not in units:
        block = x[:, [places[name] for name in FORCE]]
        length = float(np.nanmedian(np.linalg.norm(block, axis=1)))
        units["mps2"] = _GRAVITY[min(_GRAVITY, key=lambda size: abs(np.log(length / size)))]
    if RATE[0] in places and "radps" not in units:
        block = np.abs(x[:, [places[name] for name in RATE]])
        # Vehicles turn less than once a second but for moments: more is degrees.
        units["radps"] = "deg/s" if np.nanpercentile(block, 99) > 2 * np.pi else "rad/s"
    return units
