"""What the columns of a CSV file may be: by their names, else by their numbers.

A guess to start from: ``fgnav new`` writes it down, and the user looks at it. Units and clocks that
neither a name nor the size of the numbers determines are marked ``unconfirmed``.
"""

import csv
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray, quoted
from fgnav.io.flight.columns import BASELINE, FORCE, PLACE, POSITION_SIGMA, RATE, VELOCITY
from fgnav.io.importers.formats.text_columns import is_date, time_zone, usual_width
from fgnav.io.importers.settings import UNITS, CsvTable
from fgnav.io.tables import is_number, numbers
from fgnav.io.user_files import read_lines

_ROWS = 20_000  # looked at
_MOST_SHARE_ODD = 0.01  # of rows, that may break a rule: cut lines
_MOST_ODD = 20  # rows: of more, one may, whatever its share
# Names in the wild, lower case, without units: PX4's, Xsens', loggers', MATLAB's, ROS's.
_BEFORE = r"(?:.*[_./ ])?"
_TRIPLES = (
    (FORCE, "xyz", r"(?:a|f)(?:_rs_s)?|acc\w*?|lin\w*acc\w*|specific_?force", r"acc\w*"),
    (RATE, "xyz", r"(?:g|w)(?:_rs_s)?|gyr\w*?|omega|ang\w*(?:vel|rate)\w*|rate", r"gyr\w*"),
)
_AXIS_WORDS = {"n": "n(?:orth)?", "e": "e(?:ast)?", "d": "d(?:own)?", "u": "u(?:p)?"}
_POSITION = r"(?:.*[_./ ])?(?:p(?:os\w*)?[_. ]?{axis}|{axis}(?:[_. ]?pos\w*)?)"
_VELOCITY = r"(?:.*[_./ ])?(?:v(?:el\w*)?[_. ]?{axis}|{axis}[_. ]?v(?:el\w*)?)"
_NAMES = (
    {
        "t_s": rf"{_BEFORE}(?:t|i?tow|sow)|.*(?:time|stamp|utc|unix|epoch|date|sec(?:ond)?s?\b).*",
        "latitude_deg": rf"{_BEFORE}lat(?:itude)?(?:[^a-z].*)?",
        "longitude_deg": rf"{_BEFORE}(?:lon(?:g(?:itude)?)?|lng)(?:[^a-z].*)?",
        "height_m": rf"{_BEFORE}(?:h|(?:hgt|height|h_?(?:ell|ae|msl)|alt|ellips).*)",
    }
    | {
        name: rf"{_BEFORE}(?:(?:{first})[_. ]?(?:{axis}|\[{k}\])|{axis}[_. ]?(?:{last}))"
        for names, axes, first, last in _TRIPLES
        for k, (name, axis) in enumerate(zip(names, axes, strict=True))
    }
    | {
        name: pattern.format(axis=_AXIS_WORDS[axis])
        for names, pattern in ((VELOCITY, _VELOCITY), (BASELINE, _POSITION))
        for name, axis in zip(names, "ned", strict=True)
    }
    | {
        name: rf"{_BEFORE}(?:sigma|std|sd)[_. ]?(?:{axis})"
        for name, axis in zip(POSITION_SIGMA, (*"ne", "[du]"), strict=True)
    }
)
_UP = {
    names[2]: re.compile(pattern.format(axis=_AXIS_WORDS["u"]))
    for names, pattern in ((VELOCITY, _VELOCITY), (BASELINE, _POSITION))
}
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


def guessed(path: Path) -> CsvTable:
    """Return what a CSV file may hold: samples of an inertial unit, or fixes.

    Raises
    ------
    BadInputError
        If neither is found.
    """
    lines = read_lines(path)[0][:_ROWS]
    delimiter = _delimiter(lines)
    rows = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True))
    commas = [cell for row in rows[:200] for cell in row if "," in cell]
    decimal = "," if any(is_number(cell.replace(",", ".", 1)) for cell in commas) else "."
    rows = [[cell.strip().replace(decimal, ".") for cell in row] for row in rows]
    width = usual_width(rows)
    first = next((k for k, row in enumerate(rows) if len(row) == width), 0)
    header = len(rows) > first and not any(is_number(cell) for cell in rows[first])
    body = [row for row in rows[first + header :] if len(row) == width]
    if len(body) < 2:
        raise BadInputError(f"{path}: must hold two rows of numbers or more to guess columns by")
    head = rows[first] if header else []
    x = numbers(np.array(body))
    dates = [k for k in range(width) if any(is_date(r[k]) and ":" in r[k] for r in body[:100])]
    names = _by_name(head, x, dates)
    by_numbers = not any({"t_s", *wanted} <= set(names) for wanted in (FORCE, PLACE, BASELINE))
    if by_numbers:
        _refuse_partly_named(path, head, names)
        names = _by_numbers(path, x, names)
    kind = "imu" if set(FORCE) <= set(names) else "fixes"
    wanted = next((some for some in (FORCE, PLACE) if set(some) <= set(names)), BASELINE)
    if "t_s" not in names or not set(wanted) <= set(names):
        raise BadInputError(
            f"{path}: neither specific force nor places are found in its columns, or no time; "
            "describe them in [[csv]] of a file for `fgnav import --settings`, docs/own_log.md"
        )
    groups = ("t_s",), wanted, *([RATE] if kind == "imu" else [VELOCITY, POSITION_SIGMA])
    places = {n: names[n] for group in groups if set(group) <= set(names) for n in group}
    columns: dict[str, str | int] = {n: head[k] if header else k + 1 for n, k in places.items()}
    for name in set(_UP) & set(places) if header else ():
        if _UP[name].fullmatch(_plain(head[places[name]])):
            columns[name] = f"-{columns[name]}"
    units, unconfirmed = _units(path, kind, places, x, head)
    unconfirmed += ["columns"] * (by_numbers and header)
    if kind == "fixes" and header:
        _refuse_hemispheres(path, head, body)
        is_above_sea = PLACE[2] in places and _ABOVE_SEA.search(_plain(head[places[PLACE[2]]]))
        unconfirmed += ["height"] * bool(is_above_sea)
    clock, is_open = _clock(units["s"], places["t_s"], x, head, body)
    fields: dict[str, Any] = {"clock": clock} if clock != "own" else {}
    return CsvTable(
        table="imu" if kind == "imu" else "fixes",
        file=path.name,
        header=header,
        skip_lines=first,
        delimiter=delimiter,
        decimal="," if decimal == "," else ".",
        columns=columns,
        units=units,
        unconfirmed=tuple(unconfirmed + ["clock"] * is_open),
        **fields,
    )


def _delimiter(lines: list[str]) -> str:
    """Return what stands between columns: a comma only where nothing else does."""
    text = "".join(lines[1:200] or lines)
    return next((one for one in "\t;," if one in text), " ")


def _plain(cell: str) -> str:
    """Return a column's name in lower case, without its unit."""
    name = _BRACKETS.sub("", cell.strip().lower().lstrip("#% ")).strip()
    return _ENDING.sub("", name)


def _by_name(head: list[str], x: FloatArray, dates: list[int]) -> dict[str, int]:
    """Return places of columns by the names in a header."""
    plain = [_plain(cell) for cell in head]
    places_by_name = {}
    for name, pattern in _NAMES.items():
        places = [k for k, cell in enumerate(plain) if re.fullmatch(pattern, cell)]
        if name == "t_s":
            places = [k for k in places if k in dates or _runs(x[:, k])]
        elif name in _UP:
            places = places or [k for k, cell in enumerate(plain) if _UP[name].fullmatch(cell)]
        if name != "t_s" and name not in POSITION_SIGMA:
            places = [k for k in places if not _NO_VALUE.search(plain[k])]
        if name in (*PLACE, *VELOCITY, *BASELINE):
            places = [k for k in places if not _ACCURACY.search(plain[k])]
        if name == PLACE[2]:
            places.sort(key=lambda k: _ABOVE_SEA.search(plain[k]) is not None)
        if places:
            places_by_name[name] = places[0]
    return places_by_name


def _runs(column: FloatArray) -> bool:
    """Return True if numbers hardly ever fall, as times do; empty cells are passed over."""
    finite = column[np.isfinite(column)]
    falls = int((np.diff(finite) < 0).sum())
    most = max(_MOST_SHARE_ODD * len(finite), len(finite) > _MOST_ODD)  # one may be a wrap
    return len(finite) > 1 and falls <= most and bool(finite[-1] != finite[0])


def _refuse_partly_named(path: Path, head: list[str], names: dict[str, int]) -> None:
    """Refuse a header that names some of what is needed: numbers must not decide the rest."""
    named = [name for name in names if name in FORCE + RATE + PLACE + VELOCITY + BASELINE]
    if named:
        raise BadInputError(
            f"{path}: header must name a time (numbers, or a date and a time of day in one column) "
            "and all of specific force or of a place, has "
            f"{quoted(', '.join(head))}, of which {', '.join(named)} are known; describe them in "
            "[[csv]] of a file for `fgnav import --settings`, docs/own_log.md"
        )


def _refuse_hemispheres(path: Path, head: list[str], body: list[list[str]]) -> None:
    """Refuse degrees whose sign is a letter in another column."""
    for k, name in enumerate(head):
        if {row[k] for row in body} & {"S", "W", "s", "w"}:
            raise BadInputError(
                f"{path}: column {quoted(name)} has hemispheres; give latitude and longitude their "
                "signs, south and west negative"
            )


def _by_numbers(path: Path, x: FloatArray, names: dict[str, int]) -> dict[str, int]:
    """Return places of columns by what their numbers do: a time runs on, a force is gravity's."""
    runs = [k for k in range(x.shape[1]) if _runs(x[:, k])]
    time = names.get("t_s", next(iter(runs), None))
    if time is None:
        return {}
    for k in range(x.shape[1] - 2):
        if time not in {k, k + 1, k + 2} and _may_be_places(x[:, k : k + 3]):
            raise BadInputError(
                f"{path}: columns {k + 1} to {k + 3} may be latitude, longitude, height, and no "
                "header names them; describe them in [[csv]] of a file for `fgnav import "
                "--settings`, docs/own_log.md"
            )
    free = [k for k in range(x.shape[1]) if k not in (time, *runs) and np.isfinite(x[:, k]).any()]
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
    inside = largest[0] <= 90 and largest[1] <= 180 and largest[2] <= _HIGHEST_M
    return bool(inside and smooth and fraction and np.ptp(block[:, :2], axis=0).any())


def _units(
    path: Path, kind: str, places: dict[str, int], x: FloatArray, head: list[str]
) -> tuple[dict[str, str], list[str]]:
    """Return units by the header's names, else by the size of the numbers, and those in doubt."""
    units: dict[str, str] = {}
    for name, place in places.items():
        suffix = name.rsplit("_", 1)[1]
        cell = head[place].lower() if head else ""
        for unit, one in UNITS[suffix].items():
            if suffix not in units and re.search(one.names, cell):
                units[suffix] = unit
    columns = {
        suffix: x[:, [p for n, p in places.items() if n.endswith(f"_{suffix}")]]
        for suffix in ("s", "mps2", "radps", "deg", "m", "mps")
    }
    if np.isnan(columns["s"]).all():
        units["s"] = "date"
    unconfirmed = list[str]()
    if units.get("s") != "date":
        longest_s = _LONGEST_STEP_S[kind]
        step = _step(columns["s"][:, 0])
        steps_s = {unit: step * UNITS["s"][unit].factor for unit in ("s", "ms", "us", "ns")}
        fits = [unit for unit, step_s in steps_s.items() if step_s <= longest_s]
        may_be = [unit for unit, step_s in steps_s.items() if longest_s < step_s <= 10 * longest_s]
        unconfirmed += ["s"] * bool(may_be and "s" not in units)
        units.setdefault("s", fits[0] if fits else "s")
    of_kind = _imu_units if kind == "imu" else partial(_fix_units, path)
    units, others = of_kind(units, columns)
    return units, unconfirmed + others


def _step(t: FloatArray) -> float:
    """Return the usual step of times."""
    steps = np.diff(t[np.isfinite(t)])
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0


def _imu_units(
    units: dict[str, str], columns: dict[str, FloatArray]
) -> tuple[dict[str, str], list[str]]:
    """Return units with those of specific force and rates, and those in doubt."""
    unconfirmed = []
    length = max(float(np.nanmedian(np.linalg.norm(columns["mps2"], axis=1))), 1e-9)
    sizes = [size for size, unit in _GRAVITY.items() if units.get("mps2", unit) == unit]
    size = min(sizes, key=lambda one: abs(np.log(length / one)))
    units["mps2"] = _GRAVITY[size]
    unconfirmed += ["mps2"] * (abs(length / size - 1) > _NEAR)
    if columns["radps"].size and "radps" not in units:
        # Vehicles turn less than once a second but for moments: more is degrees.
        fast = np.nanpercentile(np.abs(columns["radps"]), 99) > 2 * np.pi
        units["radps"] = "deg/s" if fast else "rad/s"
        unconfirmed += ["radps"] * (not fast)
    return units, unconfirmed


def _fix_units(
    path: Path, units: dict[str, str], columns: dict[str, FloatArray]
) -> tuple[dict[str, str], list[str]]:
    """Return units with those of places and velocities, and those in doubt."""
    unconfirmed = list[str]()
    if not columns["deg"].size:  # north, east, down
        return units, unconfirmed
    largest = np.nanmax(np.abs(columns["deg"]), axis=0)
    if "deg" not in units and 360 < largest.max() <= _MOST_MINUTES:
        raise BadInputError(
            f"{path}: latitude and longitude must be degrees or 1e-7 degrees, got numbers up to "
            f"{largest.max():.9g}; convert degrees and minutes to degrees"
        )
    if "deg" not in units and largest.max() > 360:  # as u-blox and MAVLink send them
        units["deg"] = "1e-7deg"
        units.setdefault("m", "mm")
        if columns["mps"].size and "mps" not in units:
            units["mps"], unconfirmed = "cm/s", ["mps"]
    elif "deg" not in units and largest[0] <= np.pi / 2 and largest[1] <= np.pi:
        unconfirmed = ["deg"]
    return units, unconfirmed


def _clock(
    unit: str, place: int, x: FloatArray, head: list[str], body: list[list[str]]
) -> tuple[str, bool]:
    """Return what times count from, and whether that is in doubt."""
    name = head[place].lower() if head else ""
    if unit == "date":
        is_utc = bool(time_zone(body[0][place])) or "utc" in name
        return ("utc", False) if is_utc else ("gps", "gps" not in name)
    t_s = x[:, place] * UNITS["s"][unit].factor
    first_s = float(t_s[np.isfinite(t_s)][0])
    if _WEEK_NAMES.fullmatch(_plain(name)) and first_s <= 604_800:
        return "week", False
    if first_s > 1e9:  # as GPS time 2011 and later, as UTC 2001 and later
        is_gps = "gps" in name
        is_known = is_gps or first_s > _NO_GPS_S or re.search("utc|unix|posix|epoch", name)
        return ("gps" if is_gps else "utc"), not is_known
    return "own", False
