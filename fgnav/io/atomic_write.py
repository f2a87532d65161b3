"""Files and folders that appear whole or not at all.

What is being written has another name, ``.NAME.PID.part``: the next write of NAME removes what
killed processes have left.
"""

import errno
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path

from fgnav.checks import BadInputError

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def atomic_file(path: Path, *, tidy: bool = True) -> AbstractContextManager[Path]:
    """Yield a temporary path beside ``path``; it takes the name at the end, or goes on an error.

    Parameters
    ----------
    tidy : bool
        Whether to remove what killed writers of ``path`` have left, which lists its folder. One
        who writes a million files into a folder does that once, before.
    """
    return _atomic(path, Path.touch, tidy=tidy)


def atomic_folder(path: Path) -> AbstractContextManager[Path]:
    """Yield a temporary folder, as ``atomic_file`` does; ``path`` is empty or new."""
    made_folder(path.parent)
    return _atomic(path, Path.mkdir, tidy=True)


@contextmanager
def _atomic(path: Path, make: Callable[[Path], None], *, tidy: bool) -> Iterator[Path]:
    """Yield what is made beside ``path`` and takes its name."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        make(temporary)
        if tidy:
            _remove_leftovers(path)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        mend = f"; free space in {path.resolve().parent}" if error.errno in _FULL else ""
        text = f"{path}: cannot be written: {error.strerror or error}{mend}"
        raise BadInputError(text) from error
    finally:
        _remove(temporary)


def write_text(path: Path, text: str, *, tidy: bool = True) -> None:
    """Write a text file, whole or not at all; parameters and errors as of ``atomic_file``."""
    with atomic_file(path, tidy=tidy) as temporary:
        temporary.write_text(text, encoding="utf-8")


def check_place(path: Path) -> None:
    """Raise unless a file of that name could be written."""
    if not path.parent.is_dir():
        raise BadInputError(f"{path}: its folder does not exist; make it first")
    if path.is_dir():
        raise BadInputError(f"{path}: is a folder; name a file")


def check_folder(path: Path) -> None:
    """Raise unless a folder is there to be written, or could be made; nothing is made yet."""
    nearest = next((parent for parent in (path, *path.parents) if parent.exists()), Path())
    if not nearest.is_dir():
        raise _file_in_way(nearest)
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise BadInputError(f"{path}: {nearest} may not be written; name another place")


def made_folder(path: Path) -> Path:
    """Make a folder and those above it where they are absent; return it."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        file = next((parent for parent in (path, *path.parents) if parent.is_file()), path)
        raise _file_in_way(file) from None
    except OSError as error:
        raise BadInputError(f"{path}: cannot be made: {error.strerror or error}") from error
    return path


def _file_in_way(path: Path) -> BadInputError:
    return BadInputError(f"{path}: is a file, not a folder; name another place")


def _remove_leftovers(path: Path) -> None:
    """Remove what writers of ``path`` have left that are no more."""
    start = f".{path.name}."
    for other in path.parent.iterdir():
        pid = other.name.removeprefix(start).removesuffix(".part")
        if other.name == f"{start}{pid}.part" and pid.isdigit() and not _is_running(int(pid)):
            _remove(other)


def _remove(path: Path) -> None:
    with suppress(OSError):  # gone meanwhile, or not ours to remove
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True
