"""Data sets on disk: shards of arrays, and a manifest that says what they hold."""

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError
from fgnav.io.atomic_write import atomic_file, made_folder
from fgnav.io.strict_toml import Table, as_table
from fgnav.io.user_files import read_bytes
from fgnav_sim.data_sets.columns import COLUMNS, Column, packed, unpacked
from fgnav_sim.data_sets.epochs import ArrayEpochs, array_epochs
from fgnav_sim.data_sets.gravity import GravityEpochs, gravity_epochs
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.data_sets.world import World

MANIFEST = "data_set.json"
_PART = re.compile(rf"\.{re.escape(MANIFEST)}\.\d+\.part")
Epochs: TypeAlias = ArrayEpochs | GravityEpochs


class Shard(Table, frozen=True):
    """A file of a data set: ``epochs`` rows."""

    name: str
    epochs: int
    sha256: str


class Manifest(Table, frozen=True):
    """What a data set holds; its world says from what it was drawn.

    Files that the world names stand without their folders.
    """

    format: Literal["fgnav-data-set/1"]
    seed: int
    epochs: int
    world: World | GravityWorld
    columns: dict[str, Column]
    shards: tuple[Shard, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class DataSet:
    """A data set on disk: iterate over it for the epochs of one shard after the other."""

    folder: Path
    manifest: Manifest

    def __len__(self) -> int:
        """Return the number of shards."""
        return len(self.manifest.shards)

    @property
    def planned(self) -> int:
        """Number of shards of the finished set."""
        return -(-self.manifest.epochs // self.manifest.world.shard_epochs)

    def __iter__(self) -> Iterator[Epochs]:
        """Return the shards' epochs, in order.

        Raises
        ------
        BadInputError
            If the set is not finished, or a file is not what was written.
        """
        if len(self) < self.planned:
            raise BadInputError(
                f"{self.folder}: holds {len(self)} of {self.planned} shards; "
                "call fgnav data-set again, which goes on where it stopped"
            )
        return (self.read(k) for k in range(len(self)))

    def read(self, k: int) -> Epochs:
        """Return the epochs of a shard.

        Raises
        ------
        BadInputError
            If the file is missing or not what was written.
        """
        shard = self.manifest.shards[k]
        path = self.folder / shard.name
        if not path.is_file():
            raise BadInputError(f"{path}: no such file, but the manifest names it; make it again")
        if _digest(path) != shard.sha256:
            raise BadInputError(f"{path}: is not the file that was written; make it again")
        with np.load(path, allow_pickle=False) as content:
            return unpacked({name: content[name] for name in content.files})


def load_data_set(folder: Path) -> DataSet:
    """Return the data set in a folder; nothing but its manifest is read.

    Raises
    ------
    BadInputError
        If the manifest is missing or breaks a rule.
    """
    path = folder / MANIFEST
    if not path.is_file():
        raise BadInputError(f"{path}: no such file; a data set is a folder with a {MANIFEST}")
    try:
        content = msgspec.json.decode(read_bytes(path))
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadInputError(f"{path}: must be JSON, {error}") from None
    if not isinstance(content, dict):
        raise BadInputError(f"{path}: must be a JSON object, got {content!r}")
    return DataSet(folder=folder, manifest=as_table(path, content, Manifest))


def make_data_set(
    world: World | GravityWorld,
    seed: int,
    folder: Path,
    progress: Callable[[float], None] = lambda _share: None,
) -> DataSet:
    """Write the data set of a world, shard by shard; go on where an earlier call stopped.

    A shard depends on the world, the seed and its own number alone: the same seed gives the same
    bytes, whether made at once or with interruptions.

    Parameters
    ----------
    folder : Path
        New, empty, or what an earlier call with the same world and seed has left.
    progress : callable
        Told the share done, up to 1.

    Raises
    ------
    BadInputError
        If the folder holds something else or cannot be made, or the world has nothing to draw.
    """
    manifest = Manifest(
        format="fgnav-data-set/1",
        seed=seed,
        epochs=world.epochs,
        world=_portable(world),
        columns=COLUMNS[type(world)],
    )
    done = _begun(folder, manifest)
    sizes = [
        min(world.shard_epochs, world.epochs - first)
        for first in range(0, world.epochs, world.shard_epochs)
    ]
    for k, size in enumerate(sizes):
        name = f"{k + 1:04d}.npz"
        path = folder / name
        if not (k < len(done) and path.is_file() and _digest(path) == done[k].sha256):
            columns = _drawn(world, seed, k, size)
            if not (folder / MANIFEST).exists():  # before any shard: a folder always says whose
                made_folder(folder)
                _write_manifest(folder, manifest)
            shard = Shard(name=name, epochs=size, sha256=_write(path, columns))
            done = (*done[:k], shard, *done[k + 1 :])
            _write_manifest(folder, msgspec.structs.replace(manifest, shards=done))
        progress((k + 1) / len(sizes))
    return DataSet(folder=folder, manifest=msgspec.structs.replace(manifest, shards=done))


def _drawn(world: World | GravityWorld, seed: int, k: int, size: int) -> dict[str, NDArray[Any]]:
    """Return the columns of a shard."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(k,)))
    epochs: Epochs
    if isinstance(world, World):
        epochs = array_epochs(world, rng, size)
        runs = k * (world.shard_epochs // world.runs.epochs)
    else:
        epochs = gravity_epochs(world, rng, size)
        runs = k * (world.shard_epochs // world.windows.per_flight)
    return packed(epochs, runs)


def _write(path: Path, columns: Mapping[str, NDArray[Any]]) -> str:
    """Write a shard; return its digest."""
    with atomic_file(path) as part:
        with part.open("wb") as file:
            np.savez(file, allow_pickle=False, **columns)
        return _digest(part)


def _begun(folder: Path, manifest: Manifest) -> tuple[Shard, ...]:
    """Return the shards that an earlier call has left."""
    if folder.exists() and not folder.is_dir():
        raise BadInputError(f"{folder}: must be a folder, it is a file")
    if not (folder / MANIFEST).exists():
        # What a call that was killed has begun to write does not count.
        if folder.exists() and not all(_PART.fullmatch(path.name) for path in folder.iterdir()):
            raise BadInputError(f"{folder}: must be new, empty or a data set; it holds other files")
        return ()
    before = load_data_set(folder).manifest
    if msgspec.structs.replace(before, shards=()) != manifest:
        raise BadInputError(
            f"{folder}: holds a data set of another world or seed; name another folder"
        )
    return before.shards


def _portable(world: World | GravityWorld) -> World | GravityWorld:
    """Return the world, the files it names without their folders."""
    if isinstance(world, GravityWorld):
        return world
    table = world.satellites
    files = {
        key: tuple(Path(name).name for name in getattr(table, key))
        for key in ("navigation", "orbits")
    }
    return msgspec.structs.replace(world, satellites=msgspec.structs.replace(table, **files))


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _write_manifest(folder: Path, manifest: Manifest) -> None:
    text = msgspec.json.format(msgspec.json.encode(manifest), indent=2) + b"\n"
    with atomic_file(folder / MANIFEST) as part:
        part.write_bytes(text)
