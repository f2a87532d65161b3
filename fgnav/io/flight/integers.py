"""True integers of a flight as CSV: one row per arc of a link."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray, quoted
from fgnav.io.tables import is_number
from fgnav.io.user_files import read_bytes
from fgnav.types.flight import LinkIntegers

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
    header, *rows = _rows(path)
    if tuple(header) != COLUMNS:
        raise BadInputError(
            f"{path}: line 1: columns must be {','.join(COLUMNS)}, got {quoted(','.join(header))}"
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


def _rows(path: Path) -> list[list[str]]:
    """Return the cells of each line, one line or more."""
    text = read_bytes(path, is_text=True).decode("utf-8", "replace").replace("\r\n", "\n")
    if text and not text.endswith("\n"):
        raise BadInputError(
            f"{path}: must end with a line end, the last line is cut; take the file again"
        )
    lines = text.split("\n")[:-1]
    for line, content in enumerate(lines, start=1):
        if not content.isprintable():
            raise BadInputError(f"{path}: line {line}: must be plain text, got {quoted(content)}")
    try:
        return list(csv.reader(lines, strict=True)) if lines else [[]]
    except csv.Error as error:
        raise BadInputError(f"{path}: must be CSV, {error}") from None


def _numbers(path: Path, rows: Sequence[Sequence[str]], column: int) -> FloatArray:
    """Return a column of finite numbers."""
    for k, row in enumerate(rows):
        if not (is_number(row[column]) and np.isfinite(float(row[column]))):
            raise BadInputError(
                f"{path}: line {k + 2}: {COLUMNS[column]} must be a finite number, "
                f"got {quoted(row[column])}"
            )
    return np.array([float(row[column]) for row in rows])
