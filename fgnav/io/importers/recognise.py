"""Of which format a file is: by its content, by its name where that says nothing."""

import re
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from fgnav.checks import BadInputError, FloatArray, quoted
from fgnav.io.importers import FORMATS, importer_names
from fgnav.io.importers.formats.kfgins import is_increments
from fgnav.io.importers.formats.streams import messages
from fgnav.io.tables import is_number
from fgnav.io.user_files import PACKED, encoding_of, plain_name, read_bytes, remove_mark, unpack

_HEAD_BYTES = 8192
_TAKEN_PACKED = ("rinex", "sp3")  # their readers unpack


class UnknownFormatError(BadInputError):
    """Nothing tells what format a file is of."""


def recognise_format(path: Path, scratch: Path, format: str | None = None) -> tuple[str, Path]:  # noqa: A002
    """Return a file's format, and the file; what is packed is unpacked into a folder.

    Parameters
    ----------
    format : str or None
        Its format, where the user states it.

    Examples
    --------
    >>> recognise_format(Path("igs.sp3"), Path())
    ('sp3', PosixPath('igs.sp3'))
    """
    file = plain(path, scratch)
    name = format or ("rosbag" if file.is_dir() else _format(file))
    return name, path if name in _TAKEN_PACKED else file


def plain(path: Path, scratch: Path) -> Path:
    """Return a file, or where it is packed what it holds, unpacked into a folder."""
    if (path / "metadata.yaml").is_file():  # a bag of ROS 2
        return path
    if path.is_dir():
        raise BadInputError(f"{path}: is a folder, and no bag; name the files in it")
    if not path.is_file():
        raise BadInputError(f"{path}: no such file; check the name")
    with path.open("rb") as stream:
        head = stream.read(8)
    if not head.startswith(tuple(PACKED)):
        return path
    target = Path(mkdtemp(dir=scratch)) / plain_name(path.name)
    target.write_bytes(unpack(path, read_bytes(path)))
    return target


def _format(path: Path) -> str:
    with path.open("rb") as file:
        head = remove_mark(file.read(_HEAD_BYTES))
    lines = head.split(b"\n")
    for name, spec in FORMATS.items():
        if head.startswith(spec.begins) or any(re.match(spec.line, line) for line in lines):
            return name
    suffix = path.suffix.lower()
    named = next((name for name, spec in FORMATS.items() if suffix and spec.suffix == suffix), None)
    if named not in (None, "csv"):
        return str(named)
    text = head.decode(encoding_of(head[:4]), "replace")
    whole = text.splitlines()[: -1 if len(head) == _HEAD_BYTES else None]
    rows = [line.replace(",", " ").split() for line in whole]
    rows = [cells for cells in rows if cells and all(map(is_number, cells))]
    width = {len(cells) for cells in rows}
    is_table = len(rows) > 1 and len(width) == 1 and width <= {7, 11} and b"," not in head
    if is_table and _is_kfgins(np.array(rows, np.float64)):
        return "kfgins"
    if named is None:
        for message in messages(head)[0]:  # text goes before them, or the log begins within one
            return message.protocol
        raise UnknownFormatError(
            f"{path}: of no known format, it starts with {quoted(head[:12])}; state it by "
            f"--format, one of {', '.join(importer_names())}"
        )
    return named


def _is_kfgins(x: FloatArray) -> bool:
    """Return True if rows may be KF-GINS's: a reference, increments, or fixes with sigmas."""
    shift = int(x.shape[1] == 11)  # a week goes before
    if not (np.diff(x[:, shift]) > 0).all() or not (np.abs(x[:, shift]) <= 604_800).all():
        return False
    if shift:
        return bool((x[:, 0] == np.round(x[:, 0])).all() and (np.abs(x[:, 2]) <= 90).all())
    largest = np.abs(x).max(axis=0)
    is_fix = largest[1] <= 90 and largest[2] <= 180 and (x[:, 4:] > 0).all()
    return bool(is_increments(x) or (is_fix and (x[:, 1:3] % 1e-3 != 0).any()))
