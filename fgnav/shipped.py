"""Files that come with a package, by name: ``demo`` is ``fgnav_sim/scenarios/demo.toml``."""

from difflib import get_close_matches
from importlib.util import find_spec
from itertools import takewhile
from pathlib import Path

from fgnav.checks import BadInputError


def shipped(package: str, kind: str) -> dict[str, Path]:
    """Return the files in a package's folder ``kind``, by name without suffix, sorted."""
    spec = find_spec(package)
    folders = () if spec is None else spec.submodule_search_locations or ()
    files = (file for folder in folders for file in (Path(folder) / kind).glob("*.*"))
    return {file.stem: file for file in sorted(files)}


def file_or_shipped(given: Path | str, package: str, kind: str) -> Path:
    """Return the file of that path, else the one that comes with a package under that name.

    With its suffix or without: ``demo`` or ``demo.toml``.

    Raises
    ------
    BadInputError
        If a bare name is neither; the text lists what there is. A path with a folder or a suffix
        is returned as it is: whoever reads it says what is wrong with it.
    """
    path, files = Path(given), shipped(package, kind)
    if path.is_file() or len(path.parts) != 1:
        return path
    by_file_name = {file.name: file for file in files.values()}
    if path.name in files or path.name in by_file_name:
        return (files | by_file_name)[path.name]
    if path.suffix:
        return path
    meant = get_close_matches(path.name, files, n=1)
    hint = f"; did you mean {meant[0]}?" if meant else ""
    raise BadInputError(f"{given}: neither a file nor one of the {kind} {', '.join(files)}{hint}")


def summary(file: Path) -> str:
    """Return a file's description: its leading comment, or the text under its heading."""
    lines = file.read_text(encoding="utf-8").splitlines()
    if file.suffix == ".md":
        return " ".join(takewhile(bool, lines[2:]))
    return " ".join(
        line.lstrip("# ") for line in takewhile(lambda table: table.startswith("#"), lines)
    )
