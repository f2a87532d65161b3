"""Text files of columns, as the settings' ``[[csv]]`` describe them.

Rows of another number of columns than most are left out and counted: loggers cut lines where they
start and stop. Empty cells are missing values. Columns that no ``[[csv]]`` names are counted.
"""

import csv
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray, quoted, unused_of
from fgnav.geometry.earth import Origin
from fgnav.io.flight.columns import BASELINE, PLACE, Samples, vectors
from fgnav.io.flight.local_frame import place_of_n
from fgnav.io.flight.toml import ImuKeys, Place, gps_seconds
from fgnav.io.gps_time import GPS_EPOCH, UNIX_OF_GPS_S, gps_of_utc
from fgnav.io.importers.recording import ABOVE_SEA, Clock, Recording, unused_columns
from fgnav.io.importers.settings import UNITS, CsvTable, Settings
from fgnav.io.tables import is_number, numbers
from fgnav.io.user_files import plain_name, read_lines

_ZONE = re.compile(r"(?:[Zz]|[ ]?UTC|[+-]\d\d(?::?\d\d)?)$")
_DATE = re.compile(r"\d{4}[-/]\d\d?[-/]\d\d?")
_GRAVITY = ", or gravity is not in it"
_NOWHERE = Place(latitude_deg=45.0, longitude_deg=0.0, height_m=0.0)  # of middling gravity
_LOCAL = (
    "fixes are north, east, down of a place that no file states, and were laid at 45 deg, 0 deg, "
    "0 m: state [origin] in --settings, within some km"
)
_DOUBTS = {
    "gps clock": "its dates have no time zone and were read as GPS time; where they are UTC (18 s "
    'behind since 2017), write clock = "utc" in [[csv]]',
    "utc clock": "its times were read as seconds of UTC since 1970; where they are of GPS since "
    '1980, write clock = "gps" in [[csv]]',
    "columns": "no column has a known name: they were chosen by their numbers; amend columns",
}
_AXES = "no file states how the unit sits in the body; `fgnav check` says what x, y, z should read"


def read_csv(path: Path, settings: Settings, _: Path) -> Recording:
    """Read the tables that the settings describe for this file, one or more.

    Raises
    ------
    BadInputError
        If none is described, two are of one kind, their clocks differ, or the noise of an
        instrument that is described is not stated.
    """
    described = [o for o in settings.csv if o.file is None or plain_name(o.file) == path.name]
    kinds = [one.table for one in described]
    if not described or len(set(kinds)) < len(kinds):
        raise BadInputError(
            f"{path}: needs a [[csv]] for each of its tables in --settings, has "
            f"{', '.join(kinds) or 'none'}; `fgnav new` writes one to start from"
        )
    stated = {"barometer": settings.barometer, "magnetometer": settings.magnetometer}
    unstated = next((kind for kind in kinds if kind in stated and not stated[kind]), None)
    if unstated is not None:
        raise BadInputError(f"{path}: {unstated}: state its noise in [{unstated}] of --settings")
    missing = {"imu.axes": _AXES} if "imu" in kinds and settings.imu == ImuKeys() else {}
    lines, lost = read_lines(path)
    tables, counts = dict[str, Samples](), Counter[tuple[str, str]]()
    clocks, unnamed = list[tuple[Clock, float]](), list[list[str]]()
    for table in described:
        cells, others, cut = _cells(path, lines[table.skip_lines :], table)
        unnamed.append(others)
        counts[f"{path.name} line", "has another number of columns"] = cut
        clock, start_s, samples = _samples(path, table, cells)
        clocks.append((clock, start_s))
        if clock != clocks[0][0]:
            raise BadInputError(f"{path}: key csv.clock: must be the same of all its tables")
        if BASELINE[0] in samples:
            samples = _placed(samples, settings)
            missing |= {} if settings.origin else {"origin": _LOCAL}
        tables[table.table] = {**samples, "t_s": samples["t_s"] + (start_s - clocks[0][1])}
        missing |= _unconfirmed(path, table)
    names = [name for name in unnamed[0] if all(name in others for others in unnamed)]
    count = max(len(rows["t_s"]) for rows in tables.values())
    unused = (
        *(lost, *unused_of(counts)),
        unused_columns(path, names, count, "no [[csv]] names them"),
    )
    return Recording(
        source=path,
        tables=tables,
        clock=clocks[0][0],
        gps_start_s=clocks[0][1],
        unused=unused,
        notes={"fixes": ABOVE_SEA} if any("height" in o.unconfirmed for o in described) else {},
        missing=missing,
    )


def _placed(rows: Samples, settings: Settings) -> Samples:
    """Return fixes north, east, down of an origin with their places."""
    at = settings.origin or _NOWHERE
    angles = np.radians([at.latitude_deg, at.longitude_deg]).tolist()
    origin = Origin(latitude_rad=angles[0], longitude_rad=angles[1], height_m=at.height_m)
    place = place_of_n(origin, np.stack([rows[name] for name in BASELINE], axis=1))
    others = {name: column for name, column in rows.items() if name not in BASELINE}
    return others | vectors(PLACE, place)


def _unconfirmed(path: Path, table: CsvTable) -> dict[str, str]:
    """Return what the user must confirm of a guessed table, by the key of flight.toml."""
    texts = []
    for kind in table.unconfirmed:
        if kind == "height":
            continue
        if kind not in UNITS:
            texts.append(_DOUBTS[f"{table.clock} clock" if kind == "clock" else kind])
            continue
        names = ", ".join(name for name in table.columns if name.endswith(f"_{kind}"))
        usual = next(unit for unit, one in UNITS[kind].items() if one.factor == 1)
        assumed = table.units.get(kind, usual)
        texts.append(
            f"the unit of {names} is in doubt{_GRAVITY if kind == 'mps2' else ''}; {assumed} was "
            f"assumed; units are {', '.join(UNITS[kind])}: amend {kind} in units of [[csv]]"
        )
    again = "of import.toml, and import with --settings import.toml"
    return {f"{table.table}.samples": f"{path.name}: {'; '.join(texts)} {again}"} if texts else {}


def _samples(
    path: Path, table: CsvTable, columns: Mapping[str, np.ndarray]
) -> tuple[Clock, float, Samples]:
    """Return the clock of a table, the GPS time of its ``t_s = 0``, and its numbers."""
    dates = table.units.get("s") == "date"
    samples = {
        name: _numbers(path, table, name, cells)
        for name, cells in columns.items()
        if not (dates and name == "t_s")
    }
    if dates:
        t_s, zoned = read_dates(path, columns["t_s"], utc=table.clock == "utc")
        samples = {"t_s": t_s, **samples}
        if zoned and table.clock == "gps":
            raise BadInputError(
                f"{path}: key csv.clock: must be 'utc' where dates have a time zone, got 'gps' "
                f"and {quoted(str(columns['t_s'][0]))}"
            )
    elif table.clock == "utc":
        samples["t_s"] = gps_of_utc(samples["t_s"])
    if table.start is not None:
        return "gps", gps_seconds(path, table.start), samples
    if not dates and table.clock not in ("gps", "utc"):
        return ("week" if table.clock == "week" else "own"), 0.0, samples
    usable = samples["t_s"][np.isfinite(samples["t_s"])]
    start_s = float(np.floor(usable[0])) if len(usable) else 0.0
    return "gps", start_s, samples | {"t_s": samples["t_s"] - start_s}  # keeps 0.2 us of 1e9 s


def _cells(
    path: Path, lines: Sequence[str], table: CsvTable
) -> tuple[dict[str, np.ndarray], list[str], int]:
    """Return texts of the columns that are used, names of the others, and how many lines are cut.

    Texts are (k,) each.
    """
    reader = csv.reader(lines, delimiter=table.delimiter, skipinitialspace=True)
    try:
        rows = list(reader)
    except csv.Error as error:
        raise BadInputError(f"{path}: line {reader.line_num}: {error}") from None
    head = [cell.strip() for cell in rows.pop(0)] if table.header and rows else []
    width = usual_width(rows)
    places = _places(path, table, head, width)
    complete = [[row[k] for k in places] for row in rows if len(row) == width]
    cut = sum(0 < len(row) != width for row in rows)
    cells = np.array(complete, dtype=np.str_)
    names = [head[k] if k < len(head) and head[k] else str(k + 1) for k in range(width)]
    unnamed = [name for k, name in enumerate(names) if k not in places]
    return {name: cells[:, k] for k, name in enumerate(table.columns)}, unnamed, cut


def usual_width(rows: Sequence[Sequence[str]]) -> int:
    """Return how many columns most rows have; 0 without any."""
    counts = Counter(len(row) for row in rows if row)
    return max(counts, key=counts.__getitem__, default=0)


def _places(path: Path, table: CsvTable, head: list[str], width: int) -> list[int]:
    """Return where the columns are in a row."""
    if not width:
        raise BadInputError(f"{path}: holds no row of numbers")
    places = []
    for name, column in table.columns.items():
        if isinstance(column, int):
            place = abs(column) - 1
        else:
            wanted = column if column in head else column.removeprefix("-")
            place = head.index(wanted) if wanted in head else -1
        if not 0 <= place < width:
            has = ", ".join(head) if head else f"{width} columns without names"
            raise BadInputError(f"{path}: column {quoted(column)} of {name}: the file has {has}")
        places.append(place)
    return places


def _numbers(path: Path, table: CsvTable, name: str, cells: np.ndarray) -> FloatArray:
    """Return numbers in the flight's units, NaN of cells that are empty or none.

    Raises
    ------
    BadInputError
        If no cell is a number, or one would be with a decimal comma.
    """
    texts = np.char.strip(cells)
    if table.decimal == ",":
        texts = np.char.replace(texts, ",", ".")
    values = numbers(texts)
    others = [k for k in np.flatnonzero(np.isnan(values)) if texts[k] and not is_number(texts[k])]
    with_comma = [k for k in others if is_number(texts[k].replace(",", ".", 1))]
    if others and (with_comma or np.isnan(values).all()):
        row = (with_comma or others)[0]
        mend = '; write decimal = "," in [[csv]]' if with_comma else ""
        raise BadInputError(
            f"{path}: row {row + 1} of the numbers: column {quoted(table.columns[name])} must be a "
            f"number, got {quoted(str(cells[row]))}{mend}"
        )
    kind = name.rsplit("_", 1)[1]
    unit = UNITS[kind][table.units[kind]].factor if kind in table.units else 1.0
    column = table.columns[name]
    negative = column < 0 if isinstance(column, int) else column.startswith("-")
    return values * (-unit if negative else unit)


def is_date(cell: str) -> bool:
    """Return True if a cell begins with year, month and day."""
    return _DATE.match(cell.strip()) is not None


def time_zone(cell: str) -> str:
    """Return the time zone that ends a date, ``Z`` or ``+02:00``; nothing where there is none."""
    zone = _ZONE.search(cell.strip()[10:])
    return zone[0].strip() if zone else ""


def read_dates(path: Path, cells: np.ndarray, *, utc: bool = False) -> tuple[FloatArray, bool]:
    """Return seconds since 1980-01-06 of dates, NaN of none, and whether they have a time zone.

    Dates with a time zone are converted to UTC; others are GPS time unless ``utc``.
    """
    texts = [cell.strip() for cell in cells.tolist()]
    zones = [time_zone(text) for text in texts]
    bare = [text.removesuffix(zone).strip() for text, zone in zip(texts, zones, strict=True)]
    bare = [text.replace("/", "-").replace(" ", "T").replace(",", ".") for text in bare]
    dates = _dates(bare)
    if bare and np.isnat(dates).all():
        raise BadInputError(
            f"{path}: dates must be like 2025-07-08 19:34:18.5, got {quoted(texts[0])}"
        )
    gps_s = (dates - GPS_EPOCH.astype("datetime64[ns]")) / np.timedelta64(1, "s")
    if any(zones):
        ahead = {zone: _ahead_s(zone) for zone in set(zones)}
        gps_s = gps_s - np.array([ahead[zone] for zone in zones])
    return (gps_of_utc(gps_s + UNIX_OF_GPS_S) if utc or any(zones) else gps_s), any(zones)


def _dates(texts: Sequence[str]) -> np.ndarray:
    """Return dates, NaT of texts that are none."""
    try:
        return np.array(texts, dtype="datetime64[ns]")
    except ValueError:
        if len(texts) == 1:
            return np.array(["NaT"], dtype="datetime64[ns]")
        half = len(texts) // 2
        return np.concatenate([_dates(texts[:half]), _dates(texts[half:])])


def _ahead_s(zone: str) -> float:
    """Return what local time is ahead of UTC."""
    if zone[:1] not in ("+", "-"):
        return 0.0
    digits = zone[1:].replace(":", "")
    size_s = 3600.0 * int(digits[:2]) + 60.0 * int(digits[2:] or "0")
    return -size_s if zone[0] == "-" else size_s
