"""Time series as CSV: one header line of column names, then numbers; strict both ways."""

import re
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, quoted
from fgnav.io.flight.columns import fault_of_columns, largest
from fgnav.io.user_files import read_bytes

_ROWS_AT_ONCE = 20_000
_LONGEST_HEAD = 4096  # bytes; a line without an end is no list of columns
_NO_NUMBER = re.compile(rb"[^\t\n\x20-\x7e]")  # characters that no row holds


def read_table(
    path: Path,
    required: Sequence[str],
    optional: Sequence[Sequence[str]] = (),
    *,
    increasing: str = "t_s",
) -> dict[str, FloatArray]:
    """Read the columns of a table, (k,) each, of which one must increase.

    Those that are required stand in any order; groups that are optional are there in full or not
    at all.
    """
    content = read_bytes(path, is_text=True)
    names, body = _head(path, content)
    fault = fault_of_columns(names, required, optional)
    if fault:
        raise BadInputError(f"{path}: line 1: {fault}")
    if not body.strip():
        raise BadInputError(f"{path}: must hold a row below the column names, has none")
    values = _parse(path, body.replace(b"\r\n", b"\n"), names)
    column = names.index(increasing)
    backwards = np.diff(values[:, column]) <= 0
    if backwards.any():
        k = int(np.argmax(backwards)) + 1
        raise BadInputError(
            f"{path}: line {k + 2}: {increasing} must increase, "
            f"got {values[k, column]:.9g} after {values[k - 1, column]:.9g}"
        )
    return {name: values[:, k] for k, name in enumerate(names)}


def _head(path: Path, content: bytes) -> tuple[list[str], bytes]:
    """Return the names of the columns, and the rows."""
    if not content.strip():
        raise BadInputError(f"{path}: must be a table, the file is empty")
    if not content.endswith(b"\n"):
        raise BadInputError(
            f"{path}: must end with a line end, the last line is cut; take the file again, or "
            "append a line end if it is whole"
        )
    size = content.find(b"\n", 0, _LONGEST_HEAD)
    if size < 0:
        raise BadInputError(
            f"{path}: line 1: must hold the names of columns, got {quoted(content[:80])}"
        )
    head = content[:size].decode("utf-8-sig", "replace").removesuffix("\r")
    return [name.strip(" ") for name in head.split(",")], content[size + 1 :]


def _parse(path: Path, body: bytes, names: Sequence[str]) -> FloatArray:
    """Return the numbers, (k, columns)."""
    wrong = _NO_NUMBER.search(body)
    if wrong is not None:
        line = body.count(b"\n", 0, wrong.start()) + 2
        raise BadInputError(
            f"{path}: line {line}: must hold numbers and commas, got byte 0x{wrong[0][0]:02x}; "
            "take the file again"
        )
    lines = body.decode("ascii").split("\n")[:-1]
    try:
        values = np.loadtxt(lines, delimiter=",", comments=None, ndmin=2)
    except ValueError:
        values = np.zeros((0, 0))
    if values.shape != (len(lines), len(names)):
        raise BadInputError(f"{path}: {_fault(lines, names)}") from None
    most = np.array([largest(name) for name in names])
    beyond = ~(np.abs(values) <= most)
    if beyond.any():
        line, column = np.argwhere(beyond)[0]
        got_value, name = values[line, column], names[column]
        rule = "finite" if not np.isfinite(got_value) else f"within {most[column]:g} of 0"
        raise BadInputError(f"{path}: line {line + 2}: {name} must be {rule}, got {got_value:.9g}")
    return values


def _fault(lines: Sequence[str], names: Sequence[str]) -> str:
    """Return the first line that is no row of numbers, and why."""
    for number, line in enumerate(lines, 2):
        cells = line.split(",") if line else []
        if len(cells) != len(names):
            return f"line {number}: must have {len(names)} columns, got {len(cells)}"
        for name, cell in zip(names, cells, strict=True):
            if not is_number(cell) or "_" in cell:
                return f"line {number}: {name} must be a number, got {quoted(cell.strip())}"
    return "must hold numbers and commas"


def is_number(text: str | bytes) -> bool:
    """Return True if a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def increasing(t: FloatArray | IntArray) -> BoolArray:
    """Return the longest increasing selection of (k,) times as a mask, by patience sorting [1]_.

    A time that is wrong costs itself alone, and of a clock that begins anew the longer part is
    left.

    References
    ----------
    .. [1] D. E. Knuth, The Art of Computer Programming, volume 3, 1998, section 5.1.4.
    """
    kept: BoolArray = np.ones(len(t), np.bool_)
    if (np.diff(t) > 0).all():
        return kept
    last, ends, before = list[float](), list[int](), list[int]()  # of the best row of each length
    longest = -1  # where the first of the longest rows ends
    for k, time in enumerate(t.tolist()):
        length = bisect_left(last, time)
        longest = k if length == len(last) else longest
        before.append(ends[length - 1] if length else -1)
        last[length : length + 1] = [time]
        ends[length : length + 1] = [k]
    kept[:] = False
    while longest >= 0:
        kept[longest], longest = True, before[longest]
    return kept


def numbers(texts: np.ndarray) -> FloatArray:
    """Return texts as numbers, NaN of those that are none."""
    try:
        return np.asarray(texts.astype(np.float64))
    except ValueError:
        values = [float(x) if is_number(x) else np.nan for x in texts.ravel().tolist()]
        return np.array(values).reshape(texts.shape)


def write_table(path: Path, columns: Mapping[str, FloatArray], formats: Mapping[str, str]) -> None:
    """Write columns, (k,) each.

    Formats are printf's by the end of a column's name, ``{"_deg": "%.12f"}``; others are ``%.12g``.
    """
    form = ",".join(
        next((form for end, form in formats.items() if name.endswith(end)), "%.12g")
        for name in columns
    )
    values = np.stack(list(columns.values()), axis=1)
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(",".join(columns) + "\n")
        for start in range(0, len(values), _ROWS_AT_ONCE):
            block = values[start : start + _ROWS_AT_ONCE]
            file.write((form + "\n") * len(block) % tuple(block.ravel().tolist()))
