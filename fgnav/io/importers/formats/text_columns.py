"""Text files of columns, as the settings' ``[[csv]]`` describe them.

Rows of another number of columns than most are left out and counted: loggers cut lines where they
start and stop. Empty cells are missing values. Columns that no ``[[csv]]`` names are counted.
"""

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray, Unused, quoted
from fgnav.geometry.earth import Origin
from fgnav.io.flight.columns import BASELINE, PLACE, Samples, vectors
from fgnav.io.flight.keys import values_of
from fgnav.io.flight.local_frame import place_of_n
from fgnav.io.flight.toml import BarometerKeys as BarometerKeys
from fgnav.io.flight.toml import ImuKeys, Place, gps_seconds
from fgnav.io.gps_time import GPS_EPOCH, UNIX_OF_GPS_S, gps_of_utc
from fgnav.io.importers.recording import ABOVE_SEA, Clock, Recording, unused_columns
from fgnav.io.importers.settings import UNITS, CsvTable, Settings
from fgnav.io.tables import is_number, numbers
from fgnav.io.user_files import plain_name, read_lines

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
    r"""Read the tables that the settings describe for this file, one or more.

    Examples
    --------
    >>> _ = Path("height.csv").write_text("time,alt\n0,700\n1,701\n")
    >>> table = CsvTable(table="barometer", columns={"t_s": "time", "height_m": "alt"})
    >>> noise = BarometerKeys(noise_m=0.5, offset_m=30.0)
    >>> recording = read_csv(Path("height.csv"), Settings(csv=(table,), barometer=noise), Path())
    >>> recording.tables["barometer"]["height_m"].tolist()
    [700.0, 701.0]
    """
    described = [t for t in settings.csv if t.file is None or plain_name(t.file) == path.name]
    kinds = [table.table for table in described]
    if not described or len(set(kinds)) < len(kinds):
        raise BadInputError(
            f"{path}: needs a [[csv]] for each of its tables in --settings, has "
            f"{', '.join(kinds) or 'none'}; `fgnav new` writes one to start from"
        )
    for kind in {"barometer", "magnetometer"} & set(kinds):
        if getattr(settings, kind) is None:
            raise BadInputError(f"{path}: {kind}: state its noise in [{kind}] of --settings")
    missing = {"imu.axes": _AXES} if "imu" in kinds and settings.imu == ImuKeys() else {}
    lines, lost = read_lines(path)
    tables, clocks = dict[str, Samples](), list[tuple[Clock, float]]()
    cut, unnamed = lost, dict[str, None]()
    for table in described:
        cells, others, cut = _cells(path, lines[table.skip_lines :], table)
        unnamed = {name: None for name in others if not clocks or name in unnamed}
        clock, start_s, samples = _samples(path, table, cells)
        clocks.append((clock, start_s))
        if clock != clocks[0][0]:
            raise BadInputError(f"{path}: key csv.clock: must be the same of all its tables")
        if BASELINE[0] in samples:
            samples = _placed(samples, settings.origin or _NOWHERE)
            missing |= {} if settings.origin else {"origin": _LOCAL}
        tables[table.table] = {**samples, "t_s": samples["t_s"] + (start_s - clocks[0][1])}
        missing |= _unconfirmed(path, table)
    count = max(len(rows["t_s"]) for rows in tables.values())
    return Recording(
        source=path,
        tables=tables,
        clock=clocks[0][0],
        gps_start_s=clocks[0][1],
        unused=(
            lost,
            cut,
            unused_columns(path, [*unnamed], count, "no [[csv]] names them"),
        ),
        notes={"fixes": ABOVE_SEA} if any("height" in t.unconfirmed for t in described) else {},
        missing=missing,
    )


def _placed(rows: Samples, origin: Place) -> Samples:
    """Return fixes north, east, down of an origin with their latitude, longitude and height."""
    p_n_m = np.stack([rows[name] for name in BASELINE], axis=1)
    others = {name: column for name, column in rows.items() if name not in BASELINE}
    return others | vectors(PLACE, place_of_n(Origin(**values_of(origin, Origin)), p_n_m))


def _unconfirmed(path: Path, table: CsvTable) -> dict[str, str]:
    """Return the doubts of a guessed table, by the key of flight.toml."""
    texts = []
    for kind in table.unconfirmed:
        if kind in UNITS:
            names = ", ".join(name for name in table.columns if name.endswith(f"_{kind}"))
            usual = next(name for name, scale in UNITS[kind].items() if scale.factor == 1)
            texts.append(
                f"the unit of {names} is in doubt{_GRAVITY if kind == 'mps2' else ''}; "
                f"{table.units.get(kind, usual)} was assumed; units are {', '.join(UNITS[kind])}: "
                f"amend {kind} in units of [[csv]]"
            )
        elif kind != "height":
            texts.append(_DOUBTS[f"{table.clock} clock" if kind == "clock" else kind])
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
) -> tuple[dict[str, np.ndarray], list[str], Unused]:
    """Return texts of the columns that are used, (k,), names of the others, and cut lines."""
    reader = csv.reader(lines, delimiter=table.delimiter, skipinitialspace=True)
    try:
        rows = list(reader)
    except csv.Error as error:
        raise BadInputError(f"{path}: line {reader.line_num}: {error}") from None
    head = [cell.strip() for cell in rows.pop(0)] if table.header and rows else []
    cells, cut = complete_rows(path, rows)
    width = cells.shape[1]
    if not width:
        raise BadInputError(f"{path}: holds no row of numbers")
    columns = []
    for name, column in table.columns.items():
        if isinstance(column, str):
            wanted = column if column in head else column.removeprefix("-")
            columns.append(head.index(wanted) if wanted in head else -1)
        else:
            columns.append(abs(column) - 1)
        if not 0 <= columns[-1] < width:
            has = ", ".join(head) if head else f"{width} columns without names"
            raise BadInputError(f"{path}: column {quoted(column)} of {name}: the file has {has}")
    names = [head[k] if k < len(head) and head[k] else str(k + 1) for k in range(width)]
    unnamed = [name for k, name in enumerate(names) if k not in columns]
    return {name: cells[:, k] for k, name in zip(columns, table.columns, strict=True)}, unnamed, cut


def complete_rows(
    path: Path, rows: Sequence[Sequence[str]], width: int = 0
) -> tuple[np.ndarray, Unused]:
    """Return the cells, (k, c), of rows of a width, else of that of most; count the others."""
    counts = Counter(len(row) for row in rows if row)
    width = width or max(counts, key=counts.__getitem__, default=0)
    complete = [row for row in rows if len(row) == width and row]
    cells = np.array(complete, np.str_).reshape(len(complete), width)
    reason = "has another number of columns: the file is cut, or of mixed formats"
    count = counts.total() - counts[width]
    return cells, Unused(what=f"{path.name} line", reason=reason, count=count)


def _numbers(path: Path, table: CsvTable, name: str, cells: np.ndarray) -> FloatArray:
    """Return numbers in the flight's units, NaN of cells that are empty or none.

    It is an error if no cell is a number, or one would be with a decimal comma.
    """
    texts = np.char.strip(cells)
    if table.decimal == ",":
        texts = np.char.replace(texts, ",", ".")
    values = numbers(texts)
    others = [k for k in np.flatnonzero(np.isnan(values)) if texts[k] and not is_number(texts[k])]
    with_comma = [k for k in others if is_number(texts[k].replace(",", ".", 1))]
    column = table.columns[name]
    if others and (with_comma or np.isnan(values).all()):
        row = (with_comma or others)[0]
        mend = '; write decimal = "," in [[csv]]' if with_comma else ""
        raise BadInputError(
            f"{path}: row {row + 1} of the numbers: column {quoted(column)} must be a "
            f"number, got {quoted(str(cells[row]))}{mend}"
        )
    kind = name.rsplit("_", 1)[1]
    factor = UNITS[kind][table.units[kind]].factor if kind in table.units else 1.0
    return values * (-factor if str(column).startswith("-") else factor)


def date_of(text: str) -> datetime | None:
    """Return the date of a text such as ``2025/07/08 10:00:00.5 UTC``, None of others."""
    text = text.strip().replace("/", "-").replace("z", "Z")
    try:
        return datetime.fromisoformat(f"{text[:-3].strip()}Z" if text.endswith("UTC") else text)
    except ValueError:
        return None


def read_dates(path: Path, cells: np.ndarray, *, utc: bool = False) -> tuple[FloatArray, bool]:
    """Return seconds since 1980-01-06 of dates, NaN of none, and whether they have a time zone.

    Dates with a time zone are converted to UTC; others are GPS time unless ``utc``.
    """
    dates = [date_of(text) for text in cells.tolist()]
    if not any(dates):
        raise BadInputError(
            f"{path}: dates must be like 2025-07-08 19:34:18.5, got {quoted(str(cells[0]).strip())}"
        )
    epoch, second = GPS_EPOCH.item(), timedelta(seconds=1)
    gps_s = np.array(
        [
            np.nan
            if date is None
            else (date.replace(tzinfo=None) - (date.utcoffset() or 0 * second) - epoch) / second
            for date in dates
        ]
    )
    zoned = any(date is not None and date.tzinfo is not None for date in dates)
    return (gps_of_utc(gps_s + UNIX_OF_GPS_S) if utc or zoned else gps_s), zoned
