"""Third parties' readers: an extra, imported when a file needs one; what they print is kept."""

from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path
from types import ModuleType

from fgnav.checks import BadInputError, FgnavError


def reader(module: str, format: str) -> ModuleType:  # noqa: A002
    """Return a third party's module; the error of one that is not installed names the extra."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise BadInputError(
            f"format {format} needs {module.partition('.')[0]} ({error}); "
            "pip install 'fgnav[importers]'"
        ) from None


@contextmanager
def guard_reading(path: Path, format: str) -> Iterator[StringIO]:  # noqa: A002
    """Yield what a third party's reader prints; whatever it raises is a damaged file."""
    if not path.exists():
        raise BadInputError(f"{path}: no such file; check the name")
    output = StringIO()
    try:
        with redirect_stdout(output), redirect_stderr(output):
            yield output
    except (FgnavError, MemoryError):
        raise
    except Exception as error:  # whatever a reader's parsing trips over
        detail = f"{type(error).__name__}: {error}"
        raise BadInputError(
            f"{path}: cannot be read as {format}, {detail:.200}; the file is damaged or another's"
        ) from error
