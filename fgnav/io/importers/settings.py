"""Settings of foreign files, as the user states them: a small TOML, ``fgnav import --settings``."""

import math
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from fgnav.checks import quoted
from fgnav.io.flight.columns import BASELINE, fault_of_columns
from fgnav.io.flight.series import COLUMNS
from fgnav.io.flight.toml import AntennaTable, BarometerKeys, ImuKeys, MagnetometerKeys, Place
from fgnav.io.strict_toml import Table, as_table, read_toml

Kind = Literal["imu", "fixes", "barometer", "magnetometer", "truth"]
_LETTER = r"(?:^|[^a-z])"  # before
_END = r"(?:[^a-z].*)?$"
_TIME = r"(?:[^a-z]|time|stamp)"


class Unit(NamedTuple):
    """A unit of a file's columns."""

    factor: float  # to that of the flight format
    names: str = r"(?!)"  # pattern in a column's lower-case name that tells it


# Units by what a column's name ends in; of two whose pattern fits a name, the first.
UNITS: dict[str, dict[str, Unit]] = {
    "s": {
        "ns": Unit(1e-9, _TIME + r"n(?:s|secs?|ano\w*)" + _END),
        "us": Unit(1e-6, _TIME + r"(?:[uµμ]s(?:ecs?)?|micro\w*)" + _END),
        "ms": Unit(1e-3, _TIME + r"(?:m(?:s|secs?)|milli\w*)" + _END),
        "s": Unit(1.0, _LETTER + r"s(?:ecs?|econds?)?" + _END),
        "date": Unit(1.0),
    },
    "mps2": {
        "m/s2": Unit(1.0, r"(?<![a-z])m[^a-z0-9]*(?:s|ps2)"),
        "mg": Unit(9.80665e-3, _LETTER + r"(?:mg|milli_?g)" + _END),
        "g": Unit(9.80665, _LETTER + r"g(?:s|ee)?\W*$"),  # standard gravity, exact
    },
    "radps": {
        "mrad/s": Unit(1e-3, r"mrad|milli_?rad"),
        "rad/s": Unit(1.0, r"rad"),
        "mdeg/s": Unit(math.pi / 180e3, r"mdps|mdeg|milli_?deg"),
        "deg/s": Unit(math.pi / 180, r"dps|deg|[°º]"),
    },
    "deg": {
        "1e-7deg": Unit(1e-7, r"1?0?\^?e-?7"),
        "rad": Unit(180 / math.pi, r"rad"),
        "deg": Unit(1.0, r"deg|[°º]"),
    },
    "m": {
        "mm": Unit(1e-3, _LETTER + r"mm\W*$"),
        "cm": Unit(1e-2, _LETTER + r"cm\W*$"),
        "km": Unit(1e3, _LETTER + r"km\W*$"),
        "ft": Unit(0.3048, _LETTER + r"(?:ft|feet)\W*$"),  # international foot, exact
        "m": Unit(1.0, _LETTER + r"m(?:et(?:er|re)s?)?\W*$"),
    },
    "mps": {
        "mm/s": Unit(1e-3, r"mm[/_p ]*s"),
        "cm/s": Unit(1e-2, r"cm[/_p ]*s"),
        "km/h": Unit(1 / 3.6, r"km[/_p ]*h"),
        "kt": Unit(1852 / 3600, r"kts?\W*$|knots?"),
        "m/s": Unit(1.0, r"m[/_p ]*s"),
    },
    "ut": {"uT": Unit(1.0), "nT": Unit(1e-3), "T": Unit(1e6), "G": Unit(100.0), "mG": Unit(0.1)},
}


class CsvTable(Table, frozen=True, kw_only=True):
    """``[[csv]]``: one table of samples in a text file of columns.

    ``columns``: for each column of the flight format, the file's by name, or by number from 1; a
    leading minus reverses the sign; of fixes ``north_m``, ``east_m``, ``down_m`` from the settings'
    ``origin`` stand for a place. ``units``: by what the flight's column ends in, ``mps2 = "g"``.
    ``decimal``: the character before the fraction. ``unconfirmed``: the kinds of units, ``clock``
    or ``columns``, that ``fgnav new`` has guessed without evidence, and ``height`` above the sea.
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
    r"""Read settings; those of an empty file without a path.

    Examples
    --------
    >>> _ = Path("drone.toml").write_text('name = "drone"\nimu = { clock_offset_s = 0.1 }\n')
    >>> read_settings(Path("drone.toml")).imu.clock_offset_s
    0.1
    """
    return Settings() if path is None else as_table(path, read_toml(path), Settings)
