"""Guessing the columns of a CSV file by their names, else by their numbers.

A guess to start from: ``fgnav new`` writes it down, and the user looks at it. Units and clocks that
neither a name nor the size of the numbers determines are marked ``unconfirmed``.
"""

import csv
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fgnav.checks import BadInputError, FloatArray, quoted
from fgnav.io.flight.columns import BASELINE, FORCE, PLACE, POSITION_SIGMA, RATE, VELOCITY
from fgnav.io.importers.formats.text_columns import complete_rows, date_of
from fgnav.io.importers.settings import UNITS, CsvTable
from fgnav.io.tables import is_number, numbers
from fgnav.io.user_files import read_lines

_ROWS = 20_000  # looked at
_MOST_SHARE_ODD = 0.01  # of rows, that may break a rule: cut lines
_MOST_ODD = 20  # rows: of more, one may, whatever its share
# Names in the wild, lower case, without units: PX4's, Xsens', loggers', MATLAB's, ROS's.
_BEFORE = r"(?:.*[_./ ])?"
_AXES = {"n": "n(?:orth)?", "e": "e(?:ast)?", "d": "d(?:own)?", "u": "u(?:p)?"}
_NED = {  # patterns by columns north, east, down, or up
    VELOCITY: _BEFORE + r"(?:v(?:el\w*)?[_. ]?{axis}|{axis}[_. ]?v(?:el\w*)?)",
    BASELINE: _BEFORE + r"(?:p(?:os\w*)?[_. ]?{axis}|{axis}(?:[_. ]?pos\w*)?)",
}
_XYZ = {  # before an axis or its number, and after an axis
    FORCE: (r"(?:a|f)(?:_rs_s)?|acc\w*?|lin\w*acc\w*|specific_?force", r"acc\w*"),
    RATE: (r"(?:g|w)(?:_rs_s)?|gyr\w*?|omega|ang\w*(?:vel|rate)\w*|rate", r"gyr\w*"),
}
_NAMES = {
    "t_s": rf"{_BEFORE}(?:t|i?tow|sow)|.*(?:time|stamp|utc|unix|epoch|date|sec(?:ond)?s?\b).*",
    "latitude_deg": rf"{_BEFORE}lat(?:itude)?(?:[^a-z].*)?",
    "longitude_deg": rf"{_BEFORE}(?:lon(?:g(?:itude)?)?|lng)(?:[^a-z].*)?",
    "height_m": rf"{_BEFORE}(?:h|(?:hgt|height|h_?(?:ell|ae|msl)|alt|ellips).*)",
}
for _columns, (_first, _last) in _XYZ.items():
    for _k, _name in enumerate(_columns):
        _axis = "xyz"[_k]
        _NAMES[_name] = (
            rf"{_BEFORE}(?:(?:{_first})[_. ]?(?:{_axis}|\[{_k}\])|{_axis}[_. ]?(?:{_last}))"
        )
for _columns, _pattern in _NED.items():
    _NAMES |= {n: _pattern.format(axis=_AXES[a]) for n, a in zip(_columns, "ned", strict=True)}
for _name, _axis in zip(POSITION_SIGMA, (*"ne", "[du]"), strict=True):
    _NAMES[_name] = rf"{_BEFORE}(?:sigma|std|sd)[_. ]?(?:{_axis})"
_UP = {columns[2]: pattern.format(axis=_AXES["u"]) for columns, pattern in _NED.items()}
_NO_VALUE = re.compile(r"^b_|bias|sigma|std|sd[neuv]|err|cov|var|dop|rms|valid|status|noise|offset")
_ACCURACY = re.compile(r"acc(?:uracy)?$")
_ABOVE_SEA = re.compile(r"msl|sea|geoid|undul|agl|baro|rel")
_BRACKETS = re.compile(r"[\[(]([^\])]*[^\])\d][^\])]*)[\])]\s*$")  # [0] is an index
_ENDING = re.compile(
    r"[_ .](?:m?dps|degps|m?deg(?:[_/]?s)?|rad(?:[_/]?s|ps)?|m?g|mps2?|m_?s2?|m_s_?2|kmh|kts?|"
    r"knots|[mun]?s|[mun]?secs?|[mck]?m|ft|d?e-?7)$"
)
_GRAVITY = {1.0: "g", 9.80665: "m/s2", 1000.0: "mg"}  # median length of specific force, by unit
_NEAR = 0.3  # of that: a vehicle's mean is gravity's, vibration and biases make up to some tenths
_SMOOTH_DEG = 1e-3  # between rows: no vehicle moves by 100 m, and an accelerometer's noise is more
_HIGHEST_M = 20_000.0
_MOST_MINUTES = 18_000.0  # 180 degrees as NMEA writes them, dddmm.mmmm
_LONGEST_STEP_S = {"imu": 0.1, "fixes": 10.0}  # usually; ten times as long leaves the unit in doubt
_NO_GPS_S = 1.6e9  # of GPS: 2030
_WEEK_NAMES = re.compile(r"(?:i|gps_?)?tow.*|sow.*|.*(?:time_?of_?week|week_?sec).*")
_DESCRIBE = "in [[csv]] of a file for `fgnav import --settings`, docs/own_log.md"


class _Text(NamedTuple):
    """Rows of a file of columns."""

    path: Path
    delimiter: str
    decimal: str
    skipped: int  # lines
    head: list[str]  # names of columns, none without a header
    rows: list[list[str]]  # of as many cells as most have
    x: FloatArray  # (k, c), NaN of cells that are no numbers

    def name(self, column: int) -> str:
        """Return the name of a column in lower case, nothing without a header."""
        return self.head[column].lower() if self.head else ""


def guess_table(path: Path) -> CsvTable:
    r"""Guess the columns of a CSV file: samples of an inertial unit, or fixes.

    Examples
    --------
    >>> _ = Path("unit.csv").write_text("t [ms],ax,ay,az\n0,0,0,-9.8\n10,0,0,-9.8\n")
    >>> table = guess_table(Path("unit.csv"))
    >>> table.table, table.columns["fz_mps2"], table.units
    ('imu', 'az', {'s': 'ms', 'mps2': 'm/s2'})
    """
    text = _text(path)
    names = _by_name(text)
    by_numbers = not any({"t_s", *wanted} <= set(names) for wanted in (FORCE, PLACE, BASELINE))
    if by_numbers:
        _refuse_partly_named(text, names)
        names = _by_numbers(text, names)
    wanted = next((some for some in (FORCE, PLACE) if set(some) <= set(names)), BASELINE)
    kind = "imu" if wanted == FORCE else "fixes"
    if "t_s" not in names or not set(wanted) <= set(names):
        raise BadInputError(
            f"{path}: neither specific force nor places are found in its columns, or no time; "
            f"describe them {_DESCRIBE}"
        )
    groups = ("t_s",), wanted, *([RATE] if kind == "imu" else [VELOCITY, POSITION_SIGMA])
    found = {n: names[n] for group in groups if set(group) <= set(names) for n in group}
    columns: dict[str, str | int] = {
        n: text.head[k] if text.head else k + 1 for n, k in found.items()
    }
    for name in set(_UP) & set(found) if text.head else ():
        if re.fullmatch(_UP[name], _plain(text.name(found[name]))):
            columns[name] = f"-{columns[name]}"
    units, unconfirmed = _units(text, kind, found)
    unconfirmed += ["columns"] * (by_numbers and bool(text.head))
    if kind == "fixes" and text.head:
        _refuse_hemispheres(text)
        height = _plain(text.name(found[PLACE[2]])) if PLACE[2] in found else ""
        unconfirmed += ["height"] * bool(_ABOVE_SEA.search(height))
    clock, is_open = _clock(text, units["s"], found["t_s"])
    fields: dict[str, Any] = {"clock": clock} if clock != "own" else {}
    return CsvTable(
        table="imu" if kind == "imu" else "fixes",
        file=path.name,
        header=bool(text.head),
        skip_lines=text.skipped,
        delimiter=text.delimiter,
        decimal="," if text.decimal == "," else ".",
        columns=columns,
        units=units,
        unconfirmed=tuple(unconfirmed + ["clock"] * is_open),
        **fields,
    )


def _text(path: Path) -> _Text:
    """Return the rows of a file, by the character that separates columns and that of decimals."""
    lines = read_lines(path)[0][:_ROWS]
    content = "".join(lines[1:200] or lines)
    delimiter = next((character for character in "\t;," if character in content), " ")
    rows = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True))
    commas = [cell for row in rows[:200] for cell in row if "," in cell]
    decimal = "," if any(is_number(cell.replace(",", ".", 1)) for cell in commas) else "."
    rows = [[cell.strip().replace(decimal, ".") for cell in row] for row in rows]
    width = complete_rows(path, rows)[0].shape[1]
    first = next((k for k, row in enumerate(rows) if len(row) == width), 0)
    header = len(rows) > first and not any(is_number(cell) for cell in rows[first])
    body = [row for row in rows[first + header :] if len(row) == width]
    if len(body) < 2:
        raise BadInputError(f"{path}: must hold two rows of numbers or more to guess columns by")
    head = rows[first] if header else []
    return _Text(path, delimiter, decimal, first, head, body, numbers(np.array(body)))


def _plain(name: str) -> str:
    """Return a column's name in lower case, without its unit."""
    return _ENDING.sub("", _BRACKETS.sub("", name.strip().lower().lstrip("#% ")).strip())


def _by_name(text: _Text) -> dict[str, int]:
    """Return columns by the names in a header."""
    plain = [_plain(cell) for cell in text.head]
    found = {}
    for name, pattern in _NAMES.items():
        columns = [k for k, cell in enumerate(plain) if re.fullmatch(pattern, cell)]
        if name == "t_s":
            dates = [
                k for k in columns if any(":" in r[k] and date_of(r[k]) for r in text.rows[:99])
            ]
            columns = [k for k in columns if k in dates or _increases(text.x[:, k])]
        elif name in _UP and not columns:
            columns = [k for k, cell in enumerate(plain) if re.fullmatch(_UP[name], cell)]
        if name != "t_s" and name not in POSITION_SIGMA:
            columns = [k for k in columns if not _NO_VALUE.search(plain[k])]
        if name in (*PLACE, *VELOCITY, *BASELINE):
            columns = [k for k in columns if not _ACCURACY.search(plain[k])]
        if columns:
            above_sea = [
                name == PLACE[2] and _ABOVE_SEA.search(plain[k]) is not None for k in columns
            ]
            found[name] = columns[int(np.argmin(above_sea))]
    return found


def _increases(column: FloatArray) -> bool:
    """Return True if numbers hardly ever fall, as times do; empty cells are passed over."""
    finite = column[np.isfinite(column)]
    falls = int((np.diff(finite) < 0).sum())
    most = max(_MOST_SHARE_ODD * len(finite), len(finite) > _MOST_ODD)  # one may be a wrap
    return len(finite) > 1 and falls <= most and bool(finite[-1] != finite[0])


def _refuse_partly_named(text: _Text, names: dict[str, int]) -> None:
    """Refuse a header that names some of what is needed: numbers must not decide the rest."""
    named = [name for name in names if name in FORCE + RATE + PLACE + VELOCITY + BASELINE]
    if named:
        raise BadInputError(
            f"{text.path}: header must name a time (numbers, or a date and a time of day in one "
            "column) and all of specific force or of a place, has "
            f"{quoted(', '.join(text.head))}, of which {', '.join(named)} are known; describe them "
            f"{_DESCRIBE}"
        )


def _refuse_hemispheres(text: _Text) -> None:
    """Refuse degrees whose sign is a letter in another column."""
    for name, *cells in zip(text.head, *text.rows, strict=True):
        if set(cells) & {"S", "W", "s", "w"}:
            raise BadInputError(
                f"{text.path}: column {quoted(name)} has hemispheres; give latitude and longitude "
                "their signs, south and west negative"
            )


def _by_numbers(text: _Text, names: dict[str, int]) -> dict[str, int]:
    """Return columns by what their numbers do: a time increases, a force is gravity's."""
    x = text.x
    times = [k for k in range(x.shape[1]) if _increases(x[:, k])]
    time = names.get("t_s", next(iter(times), None))
    if time is None:
        return {}
    for k in range(x.shape[1] - 2):
        if time not in {k, k + 1, k + 2} and _may_be_places(x[:, k : k + 3]):
            raise BadInputError(
                f"{text.path}: columns {k + 1} to {k + 3} may be latitude, longitude, height, and "
                f"no header names them; describe them {_DESCRIBE}"
            )
    free = [k for k in range(x.shape[1]) if k not in (time, *times) and np.isfinite(x[:, k]).any()]
    triples = [free[k : k + 3] for k in range(0, len(free) - 2, 3)]
    lengths = [float(np.nanmedian(np.linalg.norm(x[:, some], axis=1))) for some in triples]
    near = [min(abs(length / size - 1) for size in _GRAVITY) for length in lengths]
    force = int(np.argmin(near)) if near else -1
    if force < 0 or near[force] > _NEAR:
        return {"t_s": time}
    columns = {"t_s": time, **dict(zip(FORCE, triples[force], strict=True))}
    others = [*triples[force + 1 :], *triples[:force]]
    return columns | (dict(zip(RATE, others[0], strict=True)) if others else {})


def _may_be_places(block: FloatArray) -> bool:
    """Return True if three columns may be degrees and metres of a vehicle that moves a little."""
    if not np.isfinite(block).any(axis=0).all():
        return False
    largest = np.nanmax(np.abs(block), axis=0)
    smooth = np.nanmax(np.abs(np.diff(block[:, :2], axis=0)), initial=0.0) < _SMOOTH_DEG
    fraction = (block[:, :2] % 1e-3 != 0).any()
    inside = (largest <= [90, 180, _HIGHEST_M]).all()
    return bool(inside and smooth and fraction and np.ptp(block[:, :2], axis=0).any())


def _units(text: _Text, kind: str, found: dict[str, int]) -> tuple[dict[str, str], list[str]]:
    """Return units by the header's names, else by the size of the numbers, and those in doubt."""
    units, of_unit = dict[str, str](), dict[str, list[int]]()
    for name, column in found.items():
        suffix = name.rsplit("_", 1)[1]
        of_unit.setdefault(suffix, []).append(column)
        named = (u for u, unit in UNITS[suffix].items() if re.search(unit.names, text.name(column)))
        if suffix not in units and (unit := next(named, None)):
            units[suffix] = unit
    x = {suffix: text.x[:, columns] for suffix, columns in of_unit.items()}
    unconfirmed = _time_unit(units, x["s"][:, 0], _LONGEST_STEP_S[kind])
    if kind == "imu":
        return units, unconfirmed + _imu_units(units, x)
    if "deg" not in x or "deg" in units:  # north, east, down, or named
        return units, unconfirmed
    largest = np.nanmax(np.abs(x["deg"]), axis=0)
    if 360 < largest.max() <= _MOST_MINUTES:
        raise BadInputError(
            f"{text.path}: latitude and longitude must be degrees or 1e-7 degrees, got numbers up "
            f"to {largest.max():.9g}; convert degrees and minutes to degrees"
        )
    if largest.max() > 360:  # as u-blox and MAVLink send them
        units |= {"deg": "1e-7deg", "m": units.get("m", "mm")}
        if "mps" in x and "mps" not in units:
            units["mps"] = "cm/s"
            unconfirmed.append("mps")
    elif (largest <= [np.pi / 2, np.pi]).all():
        unconfirmed.append("deg")
    return units, unconfirmed


def _time_unit(units: dict[str, str], t: FloatArray, longest_s: float) -> list[str]:
    """Add the unit of times; return it where it is in doubt."""
    if np.isnan(t).all():
        units["s"] = "date"
        return []
    steps = np.diff(t[np.isfinite(t)])
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    steps_s = {unit: step * UNITS["s"][unit].factor for unit in ("s", "ms", "us", "ns")}
    may_be = any(longest_s < step_s <= 10 * longest_s for step_s in steps_s.values())
    is_open = may_be and "s" not in units
    units.setdefault("s", next((u for u, step_s in steps_s.items() if step_s <= longest_s), "s"))
    return ["s"] * is_open


def _imu_units(units: dict[str, str], x: dict[str, FloatArray]) -> list[str]:
    """Add the units of specific force and rates; return those in doubt."""
    length = max(float(np.nanmedian(np.linalg.norm(x["mps2"], axis=1))), 1e-9)
    sizes = [size for size, unit in _GRAVITY.items() if units.get("mps2", unit) == unit]
    size = min(sizes, key=lambda size: abs(np.log(length / size)))
    units["mps2"] = _GRAVITY[size]
    unconfirmed = ["mps2"] * (abs(length / size - 1) > _NEAR)
    if "radps" in x and "radps" not in units:
        # Vehicles turn less than once a second but for moments: more is degrees.
        fast = np.nanpercentile(np.abs(x["radps"]), 99) > 2 * np.pi
        units["radps"] = "deg/s" if fast else "rad/s"
        unconfirmed += ["radps"] * (not fast)
    return unconfirmed


def _clock(text: _Text, unit: str, column: int) -> tuple[str, bool]:
    """Return the epoch that times count from, and whether that is in doubt."""
    name = text.name(column)
    if unit == "date":
        date = date_of(text.rows[0][column])
        is_utc = "utc" in name or (date is not None and date.tzinfo is not None)
        return ("utc", False) if is_utc else ("gps", "gps" not in name)
    t_s = text.x[:, column] * UNITS["s"][unit].factor
    first_s = float(t_s[np.isfinite(t_s)][0])
    if _WEEK_NAMES.fullmatch(_plain(name)) and first_s <= 604_800:
        return "week", False
    if first_s > 1e9:  # as GPS time 2011 and later, as UTC 2001 and later
        is_gps = "gps" in name
        is_known = is_gps or first_s > _NO_GPS_S or re.search("utc|unix|posix|epoch", name)
        return ("gps" if is_gps else "utc"), not is_known
    return "own", False
