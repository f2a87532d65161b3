"""Columns of a data set's files: their types, units and axes, packed and unpacked."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fgnav.io.strict_toml import Table
from fgnav_sim.data_sets.epochs import ArrayEpochs
from fgnav_sim.data_sets.gravity import GravityEpochs
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.data_sets.world import World


class Column(Table, frozen=True):
    """One array of every file: numpy type, unit and the meaning of its axes."""

    type: str
    unit: str
    axes: tuple[str, ...]


def _column(kind: str, unit: str, axes: str) -> Column:
    return Column(type=kind, unit=unit, axes=tuple(axes.split()))


_ARRAY = {
    "t_s": _column("f8", "s", "epoch"),
    "run": _column("i4", "1", "epoch"),
    "R_nb": _column("f8", "1", "epoch n b"),
    "antennas_b_m": _column("f8", "m", "epoch-or-1 antenna b"),
    "satellites": _column("S3", "RINEX", "epoch slot"),
    "signals": _column("S2", "RINEX", "slot"),
    "group": _column("i2", "1", "slot"),
    "wavelength_m": _column("f8", "m", "slot"),
    "e_n": _column("f8", "1", "epoch slot n"),
    "elevation_rad": _column("f4", "rad", "epoch slot"),
    "code_m": _column("f4", "m", "epoch antenna slot"),
    "phase_m": _column("f8", "m", "epoch antenna slot"),
    "integers": _column("i2", "cycle", "epoch antenna slot"),
    "outlier": _column("?", "1", "epoch antenna slot"),
    "code_sigma_m": _column("f4", "m", "epoch slot"),
    "phase_sigma_m": _column("f4", "m", "epoch slot"),
}
_GRAVITY = {
    "t_s": _column("f8", "s", "window"),
    "flight": _column("i4", "1", "window"),
    "phase": _column("i1", "1", "window"),
    "f_b_mps2": _column("f4", "m/s2", "window sample b"),
    "v_n_mps": _column("f4", "m/s", "window velocity n"),
    "g_b": _column("f8", "1", "window b"),
    "R_nb": _column("f8", "1", "window n b"),
}
COLUMNS: dict[type, dict[str, Column]] = {World: _ARRAY, GravityWorld: _GRAVITY}


def packed(epochs: ArrayEpochs | GravityEpochs, first_run: int) -> dict[str, NDArray[Any]]:
    """Return the columns of epochs whose runs, or flights, are numbered from ``first_run``."""
    table = _ARRAY if isinstance(epochs, ArrayEpochs) else _GRAVITY
    columns = {name: np.asarray(getattr(epochs, name)) for name in table}
    number = "run" if isinstance(epochs, ArrayEpochs) else "flight"
    columns[number] = columns[number] + first_run
    if isinstance(epochs, ArrayEpochs) and epochs.antennas_b_m.strides[0] == 0:
        columns["antennas_b_m"] = epochs.antennas_b_m[:1]  # one array for all
    return {name: value.astype(table[name].type) for name, value in columns.items()}


def unpacked(columns: dict[str, NDArray[Any]]) -> ArrayEpochs | GravityEpochs:
    """Return epochs of columns, in the library's own types."""
    wide: dict[str, Any] = {}
    for name, value in columns.items():
        kind = {"f": np.float64, "i": np.int64, "S": np.str_, "b": np.bool_}[value.dtype.kind]
        wide[name] = value.astype(kind)
    if "flight" in wide:
        return GravityEpochs(**wide)
    array = wide["antennas_b_m"]
    wide["antennas_b_m"] = np.broadcast_to(array, (len(wide["t_s"]), *array.shape[1:]))
    wide["signals"] = tuple(str(signal) for signal in wide["signals"])
    return ArrayEpochs(**wide)
