"""One flight of what several files hold: one clock, one origin, tables of samples as they are."""

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from fgnav.checks import BadInputError, Unused, unused_of
from fgnav.geometry.earth import Origin
from fgnav.io.atomic_write import atomic_folder
from fgnav.io.flight import toml as flight_toml
from fgnav.io.flight.columns import FORMATS, Samples
from fgnav.io.flight.folder import load_flight
from fgnav.io.flight.keys import table_of
from fgnav.io.flight.writer import FILE_NAME, check_empty, numbered
from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.place import first_epoch_gps_s, origin_of
from fgnav.io.importers.recording import Recording, cleaned
from fgnav.io.importers.settings import Settings
from fgnav.io.tables import write_table
from fgnav.io.toml_writer import write_toml

SETTINGS_NAME = "import.toml"
_OPTIONAL = ("barometer", "magnetometer")  # whose noise no log states


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Assembled:
    """A flight to be written."""

    table: flight_toml.FlightTable
    samples: dict[str, Samples]  # by the names of their files
    files: dict[str, Path]  # RINEX and SP3, which are copied as they are, by their names in it
    unused: tuple[Unused, ...]
    # what the user should know, and what he must state, by the key of flight.toml
    notes: dict[str, str]
    missing: dict[str, str]


def assemble(recordings: Sequence[Recording], settings: Settings) -> Assembled:
    """Put what files hold on one clock and into one frame.

    ``t_s = 0`` is the settings' ``start``, else the first fix, else the first observation. A clock
    of a unit's own is laid with its first sample on the start, and a note says so.
    """
    recordings = [cleaned(_stated(one, settings)) for one in recordings]
    missing = {key: text for one in recordings for key, text in one.missing.items()}
    start_s = _start(recordings, settings, missing)
    recordings = [_shifted(one, start_s, settings, missing) for one in recordings]
    undated = [
        one.source.name for one in recordings if one.clock == "own" and "fixes" in one.tables
    ]
    if len(undated) > 1:
        missing["fixes"] = (
            f"{', '.join(undated)} have clocks of their own: the first fix of each was laid on the "
            "start. Where they share a clock, state start in [[csv]] of each"
        )
    files = dict[str, Path]()
    observations, navigation, orbits = (
        _named([path for one in recordings for path in getattr(one, kind)], files)
        for kind in ("observations", "navigation", "orbits")
    )
    antennas = _antennas(settings, [files[name] for name in observations], recordings, missing)
    if observations:
        pairs = zip(antennas, observations, strict=True)
        antennas = tuple(msgspec.structs.replace(a, observations=name) for a, name in pairs)
    tables = {kind: rows for one in reversed(recordings) for kind, rows in one.tables.items()}
    paths = [[files[name] for name in names] for names in (observations, navigation, orbits)]
    origin = origin_of(tables, paths[0], (paths[1], paths[2]), start_s)
    if origin is None:
        missing["origin"] = "no file states a place: state one within some km of the flight"
        origin = Origin(latitude_rad=0.0, longitude_rad=0.0, height_m=0.0)
    samples, records = _records(recordings, settings, [one.name for one in antennas])
    return Assembled(
        table=flight_toml.FlightTable(
            format=flight_toml.FORMAT,
            name=settings.name or recordings[0].source.stem,
            start=flight_toml.gps_date(start_s),
            rows={name: len(rows["t_s"]) for name, rows in samples.items()},
            origin=table_of(flight_toml.Place, origin),
            antenna=antennas,
            gnss=flight_toml.GnssTable(navigation=navigation, orbits=orbits),
            **records,
        ),
        samples=samples,
        files=files,
        unused=tuple(loss for one in recordings for loss in one.unused),
        notes={key: text for one in recordings for key, text in one.notes.items()},
        missing=missing,
    )


def _named(paths: Sequence[Path], files: dict[str, Path]) -> tuple[str, ...]:
    """Give files names in the flight, each its own; return these."""
    names = []
    for k, path in enumerate(paths, start=1):
        names.append(f"{k}-{path.name}" if path.name in files else path.name)
        files[names[-1]] = path
    return tuple(names)


def _stated(one: Recording, settings: Settings) -> Recording:
    """Return a recording without instruments whose noise the settings do not state; count them."""
    unused = [kind for kind in _OPTIONAL if kind in one.tables and not getattr(settings, kind)]
    if unused and set(one.tables) == set(unused):
        raise BadInputError(
            f"{one.source}: holds {' and '.join(unused)} alone; state noise in [{unused[0]}] of "
            "--settings"
        )
    text = f"[{{}}] of --settings does not state its noise ({one.source.name})"
    counts = {(f"{k} row", text.format(k)): len(one.tables[k]["t_s"]) for k in unused}
    tables = {kind: rows for kind, rows in one.tables.items() if kind not in unused}
    return replace(one, tables=tables, unused=(*one.unused, *unused_of(counts)))


def _start(recordings: Sequence[Recording], settings: Settings, missing: dict[str, str]) -> float:
    """Return the GPS time of ``t_s = 0``, to the millisecond."""
    if settings.start is not None:
        return flight_toml.gps_seconds(Path("--settings"), settings.start)
    dated = [one.gps_start_s for one in recordings if one.clock == "gps" and one.tables]
    week_s = float(np.floor(dated[0] / WEEK_S) * WEEK_S) if dated else 0.0
    firsts = {
        kind: float(table["t_s"][0]) + (one.gps_start_s if one.clock == "gps" else week_s)
        for one in reversed(recordings)
        if one.clock != "own"
        for kind, table in one.tables.items()
    }
    if not (dated and firsts):
        times = [first_epoch_gps_s(path) for one in recordings for path in one.observations]
        if times and times[0] is not None:
            return times[0]
        missing["start"] = "no file has a date: this is the first week of GPS; state the GPS time"
    first = firsts.get("fixes", min(firsts.values(), default=0.0))
    return float(np.round(first, 3))


def _shifted(
    one: Recording, start_s: float, settings: Settings, missing: dict[str, str]
) -> Recording:
    """Return a recording on the flight's clock; one of its own has its first fix on the start."""
    shift_s = one.gps_start_s - start_s
    if one.clock == "week":
        shift_s = float(np.floor(start_s / WEEK_S) * WEEK_S - start_s)
    elif one.clock == "own" and one.tables:
        if "fixes" not in one.tables and not settings.imu.clock_offset_s:
            missing["imu.clock_offset_s"] = (
                f"{one.source.name} has a clock of its own: its first sample was laid on the "
                "start. State what to add to its times; `fgnav check` finds it within 20 s"
            )
        first = one.tables.get("fixes", next(iter(one.tables.values())))
        shift_s = -float(first["t_s"][0])
    tables = {kind: {**rows, "t_s": rows["t_s"] + shift_s} for kind, rows in one.tables.items()}
    return replace(one, tables=tables)


def _antennas(
    settings: Settings,
    observations: Sequence[Path],
    recordings: Sequence[Recording],
    missing: dict[str, str],
) -> tuple[flight_toml.AntennaTable, ...]:
    """Return the settings' antennas, else one of each observation file, or of each receiver."""
    count = max((last for _, last in _places(recordings)), default=-1) + 1
    stated = settings.antenna
    if stated:
        if (observations and len(observations) != len(stated)) or count > len(stated):
            raise BadInputError(
                f"key antenna: {len(stated)} antennas in --settings, but {len(observations)} "
                f"observation files, and fixes and baselines of {count}"
            )
        return stated
    names = [path.name.split(".")[0] for path in observations]
    if len(set(names)) < len(names):
        names = [f"a{k + 1}" for k in range(len(names))]
    others = [f"gps{k + 1}" for k in range(len(names), count)] if count > 1 else ["gps"] * count
    names += others[: max(count - len(names), 0)]
    if names:
        missing["antenna.position_b_m"] = (
            "no file states where the antenna sits: state forward, right, down, m, from the "
            "body's origin"
        )
    return tuple(
        flight_toml.AntennaTable(name=name, position_b_m=(0.0, 0.0, 0.0)) for name in names
    )


def _places(recordings: Sequence[Recording]) -> list[tuple[int, int]]:
    """Return the number of the antenna of each file's fixes, and that of its baseline's other end.

    Files with fixes have an antenna each, in their order; a baseline is from it to the next one.
    """
    places, number = [], 0
    for one in recordings:
        if {"fixes", "baseline"} & set(one.tables):
            places.append((number, number + ("baseline" in one.tables)))
        else:
            places.append((-1, -1))
        number += "fixes" in one.tables
    return places


def _records(
    recordings: Sequence[Recording], settings: Settings, antennas: Sequence[str]
) -> tuple[dict[str, Samples], dict[str, Any]]:
    """Return tables of samples by their files' names, and tables of flight.toml by their keys."""
    samples, records = dict[str, Samples](), dict[str, list[Any]]()
    for one, places in zip(recordings, _places(recordings), strict=True):
        ends = [antennas[k] for k in places if k >= 0]
        for kind, rows in one.tables.items():
            earlier = records.setdefault(kind, [])
            if earlier and kind not in flight_toml.SEVERAL:
                first = next(other.source.name for other in recordings if kind in other.tables)
                raise BadInputError(
                    f"{one.source}: has {kind}, as {first} has; a flight takes those of one "
                    "instrument: import one of them, and the other as a flight of its own"
                )
            name = numbered(kind, len(earlier))
            samples[name] = rows
            earlier.append(_keys(kind, one, settings, ends)(samples=name))
    keys = {
        kind: tuple(some) if kind in flight_toml.SEVERAL else some[0]
        for kind, some in records.items()
    }
    return samples, keys


def _keys(
    kind: str, one: Recording, settings: Settings, ends: Sequence[str]
) -> Callable[..., msgspec.Struct]:
    """Return the table of flight.toml of an instrument, which its file's name completes."""
    if kind == "fixes":
        return partial(flight_toml.FixesTable, antenna=ends[0])
    if kind == "baseline":
        antennas = (ends[1], ends[0]) if one.baseline_ends_at_fixes else (ends[0], ends[1])
        return partial(flight_toml.BaselineTable, antennas=antennas)
    if kind == "truth":
        return partial(flight_toml.TruthTable, source=one.truth_source)
    stated = msgspec.structs.asdict(getattr(settings, kind))
    usual = one.imu_noise if kind == "imu" else {}
    values = {name: usual.get(name) if x is None else x for name, x in stated.items()}
    table: Callable[..., msgspec.Struct] = flight_toml.RECORDS[kind]
    return partial(table, **values)


def write(
    assembled: Assembled,
    folder: Path,
    *,
    verify: bool,
    comments: Mapping[str, str] | None = None,
    settings: Settings | None = None,
) -> None:
    """Write the flight's folder; it appears whole or not at all.

    Parameters
    ----------
    folder : Path
        Must not exist, or be empty.
    verify : bool
        Whether to read the flight again: copied files may be damaged.
    comments : mapping of str to str
        For flight.toml, by key.
    settings : Settings or None
        Written beside it, so that the import can be done again with what was amended.
    """
    check_empty(folder)
    with atomic_folder(folder) as new:
        for name, rows in assembled.samples.items():
            write_table(new / name, rows, FORMATS)
        for name, path in assembled.files.items():
            shutil.copyfile(path, new / name)
        write_toml(new / FILE_NAME, assembled.table, comments or {})
        if settings is not None:
            write_toml(new / SETTINGS_NAME, settings)
        if verify:
            try:
                load_flight(new)
            except BadInputError as error:
                text = str(error)
                for name, path in assembled.files.items():
                    text = text.replace(str(new / name), str(path))
                raise BadInputError(text.replace(str(new), str(folder))) from error
