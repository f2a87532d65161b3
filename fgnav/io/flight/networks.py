"""Networks that a flight brings: manifests of factors, each with its ONNX file beside it.

What a manifest says is read where it is used (``fgnav.neural``); here it is a file with another.
"""

from collections.abc import Iterable
from pathlib import Path
from shutil import copyfile

from fgnav.checks import BadInputError
from fgnav.io.flight.toml import NetworkTable
from fgnav.io.strict_toml import read_toml_or_json

_ENDS = (".toml", ".json")


def manifests(folder: Path, tables: Iterable[NetworkTable]) -> tuple[Path, ...]:
    """Return the manifests that a flight's tables name."""
    paths: list[Path] = []
    for number, table in enumerate(tables):
        path = folder / table.manifest
        where = f"key network[{number}].manifest"
        if path.suffix not in _ENDS:
            raise BadInputError(
                f"{where}: must be the name of a .toml or .json file, got {table.manifest!r}"
            )
        if not path.is_file():
            raise BadInputError(f"{where}: {path}: no such file; put it there, or leave it out")
        if any(path.samefile(other) for other in paths):
            raise BadInputError(f"{where}: {table.manifest!r} is named twice; it counts once")
        paths.append(path)
    return tuple(paths)


def files(manifest: Path) -> tuple[Path, ...]:
    """Return a manifest and, where it names one, the ONNX file beside it."""
    onnx = read_toml_or_json(manifest).get("onnx")
    if not isinstance(onnx, str) or onnx != Path(onnx).name:
        return (manifest,)
    return manifest, manifest.with_name(onnx)


def write(networks: Iterable[Path], folder: Path) -> tuple[NetworkTable, ...]:
    """Copy networks into a flight's folder, a folder for each; return their tables."""
    tables = []
    for number, manifest in enumerate(networks, start=1):
        target = folder / f"network-{number}"
        target.mkdir()
        for file in files(manifest):
            try:
                copyfile(file, target / file.name)
            except OSError as error:
                raise BadInputError(f"{file}: {error.strerror}") from error
        tables.append(NetworkTable(manifest=f"{target.name}/{manifest.name}"))
    return tuple(tables)
