"""True integers of a flight as CSV: one row per arc of a link."""

import csv
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
    try:
        rows = [_row(number, line) for number, line in enumerate(lines or [""], start=1)]
        columns = list(zip(*rows[1:], strict=True)) or [()] * len(COLUMNS)
        return LinkIntegers(
            antennas=columns[0],
            satellites=columns[1],
            signals=columns[2],
            from_s=np.array(columns[3], np.float64),
            cycles=np.array(columns[4], np.float64),
        )
    except csv.Error as error:
        raise BadInputError(f"{path}: must be CSV, {error}") from None
    except BadInputError as error:
        raise BadInputError(f"{path}: {error}") from None


def _row(number: int, line: str) -> list[str]:
    """Return the cells of a line: names in the first, finite numbers in the last two columns."""
    if not line.isprintable():
        raise BadInputError(f"line {number}: must be plain text, got {quoted(line)}")
    row = next(csv.reader([line], strict=True), [])
    if number == 1 and tuple(row) != COLUMNS:
        raise BadInputError(f"line 1: columns must be {','.join(COLUMNS)}, got {quoted(line)}")
    if len(row) != len(COLUMNS):
        raise BadInputError(f"line {number}: must have {len(COLUMNS)} columns, got {len(row)}")
    for name, cell in zip(COLUMNS[3:], row[3:], strict=True) if number > 1 else ():
        if not (is_number(cell) and np.isfinite(float(cell))):
            raise BadInputError(
                f"line {number}: {name} must be a finite number, got {quoted(cell)}"
            )
    return row
