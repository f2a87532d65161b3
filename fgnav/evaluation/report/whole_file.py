"""Files that are either whole or not there."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fgnav.checks import BadInputError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; it takes the name at the end, or goes on an error.

    Raises
    ------
    BadInputError
        If the place cannot be written.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        raise BadInputError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all; BadInputError as ``whole_file``."""
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")


def check_place(path: Path) -> None:
    """Raise unless a file of that name could be written.

    Raises
    ------
    BadInputError
        If its folder is absent, or it is a folder itself.
    """
    if not path.parent.is_dir():
        raise BadInputError(f"{path}: its folder does not exist; make it first")
    if path.is_dir():
        raise BadInputError(f"{path}: is a folder; name a file")


def made_folder(path: Path) -> Path:
    """Make a folder and those above it where they are absent; return it.

    Raises
    ------
    BadInputError
        If it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInputError(f"{path}: cannot be made: {error.strerror or error}") from error
    return path
