"""docs/flight_format.md has every key and column that the reader knows, with its default."""

import json
import re
from pathlib import Path

import msgspec
import pytest

from fgnav.io.flight import toml as flight_toml
from fgnav.io.flight.columns import CALIBRATION
from fgnav.io.flight.series import COLUMNS

PAGE = (Path(__file__).parents[2] / "docs" / "flight_format.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^##+ (.*?)\n(.*?)(?=^##|\Z)", PAGE, re.MULTILINE | re.DOTALL))
TABLES = {
    "`[origin]`": flight_toml.Place,
    "`[[antenna]]`": flight_toml.AntennaTable,
    "`[gnss]`": flight_toml.GnssTable,
    "`base` of `[gnss]`": flight_toml.BaseTable,
    "`[imu]`": flight_toml.ImuTable,
    "`[[fixes]]`": flight_toml.FixesTable,
    "`[[baseline]]`": flight_toml.BaselineTable,
    "`[photodetector]`": flight_toml.PhotodetectorTable,
    "`[barometer]`": flight_toml.BarometerTable,
    "`[magnetometer]`": flight_toml.MagnetometerTable,
    "`[vehicle]`": flight_toml.VehicleTable,
    "`[initial]`": flight_toml.InitialTable,
    "`[[network]]`": flight_toml.NetworkTable,
    "`[truth]`": flight_toml.TruthTable,
}


def rows(section):
    """Return the cells of a table's rows, head and rule aside."""
    lines = [line for line in SECTIONS[section].splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def default(field):
    """Return a key's default as the page writes it."""
    if field.required:
        return "required"
    value = field.default
    if field.default_factory is not msgspec.NODEFAULT:
        value = field.default_factory()
    if value is None:
        return "–"
    value = list(value) if isinstance(value, tuple) else value
    return f"`{json.dumps(value)}`"


@pytest.mark.parametrize("section", TABLES)
def test_every_key_is_there_with_its_default(section):
    written = {cells[0].strip("`"): cells[2] for cells in rows(section)}
    known = {one.name: default(one) for one in msgspec.structs.fields(TABLES[section])}
    assert written == known


def test_the_top_level_is_the_flights_keys_and_the_sections_its_tables():
    known = {one.name: one for one in msgspec.structs.fields(flight_toml.FlightTable)}
    written = {cells[0].strip("`"): cells[2] for cells in rows("Top level")}
    assert written == {name: default(known[name]) for name in written}
    sections = {name.strip("`[]") for name in TABLES} - {"base` of `[gnss"}
    assert set(written) | sections == set(known)


def columns_of(kind):
    """Return what the page says of columns, by their names."""
    section = next(one for one in SECTIONS if re.fullmatch(rf"Columns of `\[+{kind}\]+`", one))
    return {tuple(re.findall(r"`(\w+)`", cells[0])): cells[2] for cells in rows(section)}


def test_every_column_of_a_baseline_is_there():
    required, groups = COLUMNS["baseline"]
    written = [name for names in columns_of("baseline") for name in names]
    assert sorted(written) == sorted([*required, *(name for group in groups for name in group)])


@pytest.mark.parametrize("kind", [kind for kind in COLUMNS if kind != "baseline"])
def test_every_column_is_there_required_or_by_groups(kind):
    required, groups = COLUMNS[kind]
    written = columns_of(kind)
    must = [
        name for names, text in written.items() if text.startswith("required") for name in names
    ]
    optional = [names for names, text in written.items() if text.startswith("all or none")]
    assert tuple(must) == required
    assert optional == list(groups)
    assert len(written) == len(optional) + sum(x.startswith("required") for x in written.values())


def test_units_are_those_of_the_names():
    for section in TABLES:
        for name, unit, *_ in rows(section):
            for end, want in (("_deg`", "deg"), ("_m`", "m"), ("_s`", "s"), ("_ut`", "µT")):
                if name.endswith(end) and "per_sqrt" not in name:
                    assert unit == want, name


def test_the_photodetectors_calibration_is_named_by_its_columns():
    assert all(f"`{name}`" in SECTIONS["`[photodetector]`"] for name in CALIBRATION)
