"""What the user says about foreign files: a small TOML, ``fgnav import --settings``."""

from pathlib import Path
from typing import Literal

import msgspec

from fgnav.checks import quoted
from fgnav.io.flight.columns import BASELINE, fault_of_columns
from fgnav.io.flight.series import COLUMNS
from fgnav.io.flight.toml import AntennaTable, BarometerKeys, ImuKeys, MagnetometerKeys, Place
from fgnav.io.strict_toml import Table, as_table, read_toml

Kind = Literal["imu", "fixes", "barometer", "magnetometer", "truth"]
# Factors to the units of the flight format, by what a column's name ends in.
UNITS: dict[str, dict[str, float]] = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "date": 1.0},
    "mps2": {"m/s2": 1.0, "g": 9.80665, "mg": 9.80665e-3},  # standard gravity, exact
    "radps": {
        "rad/s": 1.0,
        "deg/s": 0.017453292519943295,
        "mrad/s": 1e-3,
        "mdeg/s": 1.7453292519943295e-5,
    },
    "deg": {"deg": 1.0, "rad": 57.29577951308232, "1e-7deg": 1e-7},
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "ft": 0.3048},  # international foot, exact
    "mps": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1 / 3.6, "kt": 1852 / 3600},
    "ut": {"uT": 1.0, "nT": 1e-3, "T": 1e6, "G": 100.0, "mG": 0.1},
}


class CsvTable(Table, frozen=True, kw_only=True):
    """``[[csv]]``: one table of samples in a text file of columns.

    ``columns``: for each column of the flight format, the file's by name, or by number from 1; a
    leading minus reverses the sign; of fixes ``north_m``, ``east_m``, ``down_m`` from the settings'
    ``origin`` stand for a place. ``units``: by what the flight's column ends in, ``mps2 = "g"``.
    ``decimal``: the character before the fraction. ``unconfirmed``: the kinds of units,
    ``clock`` or ``columns``, that ``fgnav new`` has guessed without evidence.
    """

    table: Kind
    columns: dict[str, str | int]
    file: str | None = None
    units: dict[str, str] = msgspec.field(default_factory=dict)
    delimiter: str = ","
    decimal: Literal[".", ","] = "."
    header: bool = True
    skip_lines: int = 0
    clock: Literal["own", "gps", "week", "utc"] = "own"
    start: str | None = None
    unconfirmed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check columns against those of the flight format, and units."""
        required, groups = COLUMNS[self.table]
        if self.table == "fixes" and BASELINE[0] in self.columns:
            required = ("t_s", *BASELINE)
        fault = fault_of_columns([*self.columns], required, groups)
        if fault:
            mend = "; name the file's column for it" if fault.endswith("missing") else ""
            msg = f"columns: {fault}{mend}"
            raise ValueError(msg)
        for kind, unit in self.units.items():
            if unit not in UNITS.get(kind, {}):
                rule = f"must be one of {', '.join(UNITS[kind])}" if kind in UNITS else "unknown"
                msg = f"units.{kind}: {rule}, got {quoted(unit)}; kinds are {', '.join(UNITS)}"
                raise ValueError(msg)
        if len(self.delimiter) != 1:
            msg = f"delimiter: must be one character, got {quoted(self.delimiter)}"
            raise ValueError(msg)


class RosTable(Table, frozen=True, kw_only=True):
    """``[ros]``: topics, where a bag has several of a type, and the axes of its inertial unit."""

    imu: str | None = None
    fixes: str | None = None
    barometer: str | None = None
    magnetometer: str | None = None


class Settings(Table, frozen=True, kw_only=True):
    """The whole file; tables as in flight.toml, ``start`` where no file states a date.

    ``solution``: whether a receiver's file gives its fixes rather than its raw measurements.
    """

    name: str | None = None
    start: str | None = None
    solution: bool | None = None
    origin: Place | None = None
    antenna: tuple[AntennaTable, ...] = ()
    imu: ImuKeys = ImuKeys()
    barometer: BarometerKeys | None = None
    magnetometer: MagnetometerKeys | None = None
    csv: tuple[CsvTable, ...] = ()
    ros: RosTable = msgspec.field(default_factory=RosTable)


def read_settings(path: Path | None) -> Settings:
    """Read settings; those of an empty file without a path.

    Raises
    ------
    BadInputError
        Naming file, key, rule and value.
    """
    return Settings() if path is None else as_table(path, read_toml(path), Settings)
