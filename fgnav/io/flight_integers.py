"""True integers of a flight as CSV: one row per arc of a link."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.flight import LinkIntegers
from fgnav.io.rinex_text import read_bytes

COLUMNS = ("antenna", "satellite", "signal", "from_s", "cycles")


def write_integers(path: Path, integers: LinkIntegers) -> None:
    """Write integers; what is read back is equal to the last bit."""
    cycles = [f"{x:.0f}" if x.is_integer() else repr(x) for x in integers.cycles.tolist()]
    rows = zip(integers.links, integers.from_s.tolist(), cycles, strict=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows((*link, from_s, number) for link, from_s, number in rows)


def read_integers(path: Path) -> LinkIntegers:
    """Read integers.

    Raises
    ------
    BadInputError
        Naming file, line, column, rule and value.
    """
    lines = read_bytes(path).decode("utf-8", "replace").splitlines()
    header, *rows = csv.reader(lines) if lines else ([],)
    if tuple(header) != COLUMNS:
        raise BadInputError(
            f"{path}: line 1: columns must be {','.join(COLUMNS)}, got {','.join(header)!r}"
        )
    for line, row in enumerate(rows, start=2):
        if len(row) != len(COLUMNS):
            raise BadInputError(
                f"{path}: line {line}: must have {len(COLUMNS)} columns, got {len(row)}"
            )
    antennas, satellites, signals, _, _ = zip(*rows, strict=True) if rows else ((),) * 5
    try:
        return LinkIntegers(
            antennas=antennas,
            satellites=satellites,
            signals=signals,
            from_s=_numbers(path, rows, 3),
            cycles=_numbers(path, rows, 4),
        )
    except BadInputError as error:
        if str(error).startswith(str(path)):
            raise
        raise BadInputError(f"{path}: {error}") from None


def _numbers(path: Path, rows: Sequence[Sequence[str]], column: int) -> FloatArray:
    """Return a column of finite numbers."""
    values = np.empty(len(rows))
    for k, row in enumerate(rows):
        try:
            values[k] = float(row[column])
        except ValueError:
            values[k] = np.nan
        if not np.isfinite(values[k]):
            raise BadInputError(
                f"{path}: line {k + 2}: {COLUMNS[column]} must be a finite number, "
                f"got {row[column]!r}"
            )
    return values
