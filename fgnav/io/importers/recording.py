"""What one foreign file holds: tables of samples under the flight format's own column names."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, Loss
from fgnav.io.flight.columns import largest
from fgnav.io.flight.series import COLUMNS, LEAST_SIGMA
from fgnav.types.flight import TruthSource

Samples: TypeAlias = Mapping[str, FloatArray]
Clock: TypeAlias = Literal["gps", "week", "own"]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Recording:
    """What an importer has found in a file.

    Attributes
    ----------
    source : Path
        The file, for texts.
    tables : mapping of str to (mapping of str to ndarray, shape (k,))
        By kind, ``imu``, ``fixes``, ``barometer``, ``magnetometer`` or ``truth``; columns as
        ``fgnav.io.flight.series.COLUMNS`` has them. Values may be NaN, times may repeat: such rows
        are left out and counted.
    clock : {"gps", "week", "own"}
        What ``t_s`` counts from: ``gps_start_s``; the start of a GPS week that the file does not
        state; or something else, such as power-on.
    gps_start_s : float
        Of ``clock="gps"``: GPS time of ``t_s = 0``, seconds since 1980-01-06.
    truth_source : {"simulated", "survey", "filter"} or None
        What made the table ``truth``.
    imu_noise : mapping of str to float
        Noise that the format's unit is known for, by the names of ``[imu]`` in flight.toml.
    observations, navigation, orbits : tuple of Path
        RINEX observation files, one an antenna; navigation files; SP3 files.
    notes, missing : mapping of str to str
        What a user should know, and what he must state, by the key of flight.toml that it is about.
    """

    source: Path
    tables: Mapping[str, Samples] = field(default_factory=dict)
    clock: Clock = "gps"
    gps_start_s: float = 0.0
    truth_source: TruthSource | None = None
    imu_noise: Mapping[str, float] = field(default_factory=dict)
    observations: tuple[Path, ...] = ()
    navigation: tuple[Path, ...] = ()
    orbits: tuple[Path, ...] = ()
    losses: tuple[Loss, ...] = ()
    notes: Mapping[str, str] = field(default_factory=dict)
    missing: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Reject a file without anything, and tables whose columns are not the flight format's."""
        files = (*self.observations, *self.navigation, *self.orbits)
        if not files and not any(len(table["t_s"]) for table in self.tables.values()):
            raise BadInputError(f"{self.source}: holds nothing that a flight could use")
        for kind, table in self.tables.items():
            required, groups = COLUMNS[kind]
            surplus = set(table) - set(required)
            for group in groups:
                surplus -= set(group) if set(group) <= surplus else set()
            missing = sorted(set(required) - set(table))
            if surplus or missing:
                raise BadInputError(
                    f"{self.source}: {kind}: columns {', '.join(missing or sorted(surplus))} "
                    f"{'are missing' if missing else 'make no full group of known ones'}"
                )


def cleaned(kind: str, table: Samples, source: Path) -> tuple[dict[str, FloatArray], list[Loss]]:
    """Return the rows that a flight can have, and what was left out.

    Parameters
    ----------
    kind : str
        Of the table, for texts.
    table : mapping of str to ndarray, shape (k,)

    Raises
    ------
    BadInputError
        If no row is left.
    """
    good: BoolArray = np.ones(len(table["t_s"]), bool)
    for name, column in table.items():
        good &= np.abs(column) <= largest(name)  # false of NaN, too
        if name.startswith("sigma"):
            good &= column >= LEAST_SIGMA
    t_s = table["t_s"][good]
    latest_s = np.maximum.accumulate(t_s)
    later = np.ones(len(t_s), bool)
    later[1:] = t_s[1:] > latest_s[:-1]
    losses = [
        Loss(what=f"{kind} row", reason=f"{reason} ({source.name})", count=int(count))
        for reason, count in (
            ("a value is missing, or no instrument has it", (~good).sum()),
            ("its time does not increase", (~later).sum()),
        )
        if count
    ]
    if not later.any():
        raise BadInputError(
            f"{source}: {kind}: no row is usable of {len(good)}; look at columns and units"
        )
    return {name: np.asarray(column)[good][later] for name, column in table.items()}, losses


def vectors(names: tuple[str, ...], block: FloatArray) -> dict[str, FloatArray]:
    """Return columns by name of a block, (k, c)."""
    return {name: np.asarray(block[:, k], np.float64) for k, name in enumerate(names)}
