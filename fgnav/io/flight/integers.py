"""True integers of a flight as CSV: one row per arc of a link."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, quoted
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
    """Read integers."""
    text = read_bytes(path, is_text=True).decode("utf-8", "replace").replace("\r\n", "\n")
    lines = text.split("\n")
    if lines.pop():
        raise BadInputError(
            f"{path}: must end with a line end, the last line is cut; take the file again"
        )
    for line, content in enumerate(lines, start=1):
        if not content.isprintable():
            raise BadInputError(f"{path}: line {line}: must be plain text, got {quoted(content)}")
    try:
        header, *rows = list(csv.reader(lines, strict=True)) or [[]]
        _check(header, rows)
        columns = list(zip(*rows, strict=True)) or [()] * len(COLUMNS)
        numbers = [np.array(column, np.float64) for column in columns[3:]]
        return LinkIntegers(
            antennas=columns[0],
            satellites=columns[1],
            signals=columns[2],
            from_s=numbers[0],
            cycles=numbers[1],
        )
    except csv.Error as error:
        raise BadInputError(f"{path}: must be CSV, {error}") from None
    except BadInputError as error:
        raise BadInputError(f"{path}: {error}") from None


def _check(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Raise unless all rows have all columns, and finite numbers in the last two."""
    names = ",".join(COLUMNS)
    if tuple(header) != COLUMNS:
        raise BadInputError(f"line 1: columns must be {names}, got {quoted(','.join(header))}")
    for line, row in enumerate(rows, start=2):
        if len(row) != len(COLUMNS):
            raise BadInputError(f"line {line}: must have {len(COLUMNS)} columns, got {len(row)}")
        for name, cell in zip(COLUMNS[3:], row[3:], strict=True):
            if not (is_number(cell) and np.isfinite(float(cell))):
                raise BadInputError(
                    f"line {line}: {name} must be a finite number, got {quoted(cell)}"
                )
