"""Data sets on disk: shards of arrays, and a manifest that says what they hold."""

from pathlib import Path
from typing import Any, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from fgnav.io.atomic_write import atomic_folder
from fgnav.progress import report
from fgnav_sim.data_sets.epochs import ArrayEpochs, array_epochs
from fgnav_sim.data_sets.gravity import GravityEpochs, gravity_epochs
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.data_sets.world import World

MANIFEST = "data_set.json"
AnyWorld: TypeAlias = World | GravityWorld
# Columns of every shard: numpy type, unit, meaning of the axes.
_ARRAY = {
    "t_s": ("f8", "s", "epoch"),
    "run": ("i4", "1", "epoch"),
    "R_nb": ("f8", "1", "epoch n b"),
    "antennas_b_m": ("f8", "m", "antenna b"),
    "satellites": ("S3", "RINEX", "epoch slot"),
    "signals": ("S2", "RINEX", "slot"),
    "group": ("i2", "1", "slot"),
    "wavelength_m": ("f8", "m", "slot"),
    "e_n": ("f8", "1", "epoch slot n"),
    "elevation_rad": ("f4", "rad", "epoch slot"),
    "code_m": ("f4", "m", "epoch antenna slot"),
    "phase_m": ("f8", "m", "epoch antenna slot"),
    "integers": ("i2", "cycle", "epoch antenna slot"),
    "outlier": ("?", "1", "epoch antenna slot"),
    "code_sigma_m": ("f4", "m", "epoch slot"),
    "phase_sigma_m": ("f4", "m", "epoch slot"),
}
_GRAVITY = {
    "t_s": ("f8", "s", "window"),
    "flight": ("i4", "1", "window"),
    "phase": ("i1", "1", "window"),
    "f_b_mps2": ("f4", "m/s2", "window sample b"),
    "v_n_mps": ("f4", "m/s", "window velocity n"),
    "g_b": ("f8", "1", "window b"),
    "R_nb": ("f8", "1", "window n b"),
}


def write_data_set(world: AnyWorld, seed: int, folder: Path) -> dict[str, int]:
    """Write the data set of a world; return the epochs of each shard by its file's name.

    A shard depends on the world, the seed and its own number alone; the folder appears whole or not
    at all.

    Parameters
    ----------
    folder : Path
        New or empty.

    Raises
    ------
    BadInputError
        If the folder cannot be made, or the world has nothing to draw.
    """
    starts, shards = range(0, world.epochs, world.shard_epochs), dict[str, int]()
    with atomic_folder(folder) as unfinished:
        for k, first in enumerate(starts):
            name, count = f"{k + 1:04d}.npz", min(world.shard_epochs, world.epochs - first)
            with (unfinished / name).open("wb") as file:
                np.savez(file, allow_pickle=False, **shard_columns(world, seed, k, count))
            shards[name] = count
            report((k + 1) / len(starts))
        manifest = {
            "format": "fgnav-data-set/2",
            "seed": seed,
            "world": world,
            "columns": _columns_of(world),
            "shards": shards,
        }
        text = msgspec.json.format(msgspec.json.encode(manifest), indent=2) + b"\n"
        (unfinished / MANIFEST).write_bytes(text)
    return shards


def shard_columns(world: AnyWorld, seed: int, k: int, count: int) -> dict[str, NDArray[Any]]:
    """Return the columns of shard k; runs, or flights, are numbered through all shards."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(k,)))
    epochs: ArrayEpochs | GravityEpochs
    if isinstance(world, World):
        epochs, number, each = array_epochs(world, rng, count), "run", world.runs.epochs
    else:
        epochs, number, each = gravity_epochs(world, rng, count), "flight", world.windows.per_flight
    columns = {name: np.asarray(getattr(epochs, name)) for name in _columns_of(world)}
    columns[number] = columns[number] + k * (world.shard_epochs // each)
    return {name: columns[name].astype(kind) for name, (kind, *_) in _columns_of(world).items()}


def _columns_of(world: AnyWorld) -> dict[str, tuple[str, str, str]]:
    return _ARRAY if isinstance(world, World) else _GRAVITY
