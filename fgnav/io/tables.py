"""Time series as CSV: one header line of column names, then numbers; strict both ways."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray, quoted
from fgnav.io.flight.columns import largest
from fgnav.io.user_files import read_bytes

_ROWS_AT_ONCE = 20_000
_LONGEST_HEAD = 4096  # bytes; a line without an end is no list of columns
_CR, _LF, _TAB, _DELETE = 13, 10, 9, 127


def read_table(
    path: Path,
    required: Sequence[str],
    optional: Sequence[Sequence[str]] = (),
    *,
    increasing: str = "t_s",
) -> dict[str, FloatArray]:
    """Read a table whose first column increases.

    Parameters
    ----------
    required : sequence of str
        Columns that must be there, in any order.
    optional : sequence of sequence of str
        Groups of columns that are there in full or not at all.
    increasing : str
        Name of the column whose values must increase.

    Returns
    -------
    dict of str to ndarray, shape (k,)

    Raises
    ------
    BadInputError
        Naming file, line, column, rule and value.
    """
    content = read_bytes(path, is_text=True)
    names, body = _head(path, content)
    _check_names(path, names, required, optional)
    if not body.strip():
        raise BadInputError(f"{path}: must hold a row below the column names, has none")
    _check_characters(path, body)
    body = body.replace(b"\r\n", b"\n")
    _check_widths(path, body, len(names))
    values = _parse(path, body, names)
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


def _check_characters(path: Path, body: bytes) -> None:
    """Raise at a control character, or one that is no ASCII: no number holds any."""
    text = np.frombuffer(body, np.uint8)
    wrong = ((text < 32) & (text != _LF) & (text != _TAB)) | (text >= _DELETE)
    wrong[:-1] &= ~((text[:-1] == _CR) & (text[1:] == _LF))
    if wrong.any():
        at = int(np.argmax(wrong))
        line = body.count(b"\n", 0, at) + 2
        raise BadInputError(
            f"{path}: line {line}: must hold numbers and commas, got byte 0x{text[at]:02x}; "
            "take the file again"
        )


def _check_names(
    path: Path, names: Sequence[str], required: Sequence[str], optional: Sequence[Sequence[str]]
) -> None:
    allowed = [*required, *(name for group in optional for name in group)]
    for name in names:
        if name not in allowed:
            near = get_close_matches(name[:80], allowed, n=1, cutoff=0.0)[0]
            raise BadInputError(
                f"{path}: line 1: unknown column {quoted(name)}; the nearest known one is {near!r}"
            )
        if names.count(name) > 1:
            raise BadInputError(f"{path}: line 1: column {name!r} must appear once")
    wanted = [list(required)] + [list(g) for g in optional if any(name in names for name in g)]
    missing = [name for group in wanted for name in group if name not in names]
    if missing:
        raise BadInputError(f"{path}: line 1: column {missing[0]!r} is missing")


def _check_widths(path: Path, body: bytes, width: int) -> None:
    """Raise unless every line has as many columns as the first."""
    text = np.frombuffer(body, np.uint8)
    ends = np.flatnonzero(text == ord("\n"))
    commas = np.searchsorted(np.flatnonzero(text == ord(",")), ends)
    columns = np.diff(commas, prepend=0) + 1
    blank = np.diff(ends, prepend=-1) == 1
    wrong = (columns != width) | blank
    if wrong.any():
        k = int(np.argmax(wrong))
        got = 0 if blank[k] else columns[k]
        raise BadInputError(f"{path}: line {k + 2}: must have {width} columns, got {got}")


def _parse(path: Path, body: bytes, names: Sequence[str]) -> FloatArray:
    """Return the numbers, (k, columns)."""
    lines = body.decode("ascii").splitlines()  # no other line end is left
    try:
        values = np.loadtxt(lines, delimiter=",", comments=None, ndmin=2)
    except ValueError:
        k, name, got = _first_not_number(lines, names)
        raise BadInputError(
            f"{path}: line {k + 2}: {name} must be a number, got {quoted(got.strip())}"
        ) from None
    most = np.array([largest(name) for name in names])
    wrong = ~(np.abs(values) <= most)
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        got_value, name = values[row, column], names[column]
        rule = "finite" if not np.isfinite(got_value) else f"within {most[column]:g} of 0"
        raise BadInputError(f"{path}: line {row + 2}: {name} must be {rule}, got {got_value:.9g}")
    return values


def _first_not_number(lines: Sequence[str], names: Sequence[str]) -> tuple[int, str, str]:
    for k, line in enumerate(lines):
        for name, field in zip(names, line.split(","), strict=True):
            if not is_number(field.replace("_", "x")):
                return k, name, field
    return 0, names[0], lines[0]


def is_number(text: str | bytes) -> bool:
    """Return True if a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def write_table(path: Path, columns: Mapping[str, FloatArray], formats: Mapping[str, str]) -> None:
    """Write a table.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (k,)
    formats : mapping of str to str
        printf formats by the end of a column's name, ``{"_deg": "%.12f"}``; others are ``%.12g``.
    """
    row = ",".join(
        next((form for end, form in formats.items() if name.endswith(end)), "%.12g")
        for name in columns
    )
    values = np.stack(list(columns.values()), axis=1)
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(",".join(columns) + "\n")
        for start in range(0, len(values), _ROWS_AT_ONCE):
            block = values[start : start + _ROWS_AT_ONCE]
            file.write((row + "\n") * len(block) % tuple(block.ravel().tolist()))
