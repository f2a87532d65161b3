"""One flight of what several files hold: one clock, one origin, tables of samples as they are."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
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
from fgnav.io.flight.writer import FILE_NAME, check_empty, samples_name
from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.place import first_epoch_gps_s, origin_of
from fgnav.io.importers.recording import Recording, clean_rows
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
    of a unit's own is laid with its first sample on the start, and a note says so. Instruments
    whose noise is not stated are left out, and counted.

    Examples
    --------
    >>> force = {f"f{axis}_mps2": np.zeros(3) for axis in "xyz"}
    >>> unit = Recording(source=Path("unit.log"), tables={"imu": {"t_s": np.arange(3.0), **force}})
    >>> assembled = assemble([unit], Settings(name="bench"))
    >>> assembled.table.name, list(assembled.samples), list(assembled.missing)
    ('bench', ['imu.csv'], ['origin'])
    """
    recordings = [clean_rows(_without_unstated(recording, settings)) for recording in recordings]
    missing = {key: text for recording in recordings for key, text in recording.missing.items()}
    start_s = _start(recordings, settings, missing)
    recordings = [_shifted(recording, start_s, settings, missing) for recording in recordings]
    undated = [r.source.name for r in recordings if r.clock == "own" and "fixes" in r.tables]
    if len(undated) > 1:
        missing["fixes"] = (
            f"{', '.join(undated)} have clocks of their own: the first fix of each was laid on the "
            "start. Where they share a clock, state start in [[csv]] of each"
        )
    files, gnss = dict[str, Path](), dict[str, tuple[str, ...]]()
    for kind in ("observations", "navigation", "orbits"):
        paths = [path for recording in recordings for path in getattr(recording, kind)]
        gnss[kind] = _file_names(paths, files)
    antennas = _antennas(recordings, settings, gnss["observations"], missing)
    origin = origin_of(recordings, start_s)
    if origin is None:
        missing["origin"] = "no file states a place: state one within some km of the flight"
        origin = Origin(latitude_rad=0.0, longitude_rad=0.0, height_m=0.0)
    samples, records = _records(recordings, settings, [antenna.name for antenna in antennas])
    return Assembled(
        table=flight_toml.FlightTable(
            format=flight_toml.FORMAT,
            name=settings.name or recordings[0].source.stem,
            start=flight_toml.gps_date(start_s),
            rows={name: len(rows["t_s"]) for name, rows in samples.items()},
            origin=table_of(flight_toml.Place, origin),
            antenna=antennas,
            gnss=flight_toml.GnssTable(navigation=gnss["navigation"], orbits=gnss["orbits"]),
            **records,
        ),
        samples=samples,
        files=files,
        unused=tuple(loss for recording in recordings for loss in recording.unused),
        notes={key: text for recording in recordings for key, text in recording.notes.items()},
        missing=missing,
    )


def _file_names(paths: Sequence[Path], files: dict[str, Path]) -> tuple[str, ...]:
    """Give files names in the flight, each its own; return these."""
    names = []
    for k, path in enumerate(paths, start=1):
        names.append(f"{k}-{path.name}" if path.name in files else path.name)
        files[names[-1]] = path
    return tuple(names)


def _without_unstated(recording: Recording, settings: Settings) -> Recording:
    """Return a recording without instruments whose noise the settings do not state; count them."""
    unused = [k for k in _OPTIONAL if k in recording.tables and not getattr(settings, k)]
    if unused and set(recording.tables) == set(unused):
        raise BadInputError(
            f"{recording.source}: holds {' and '.join(unused)} alone; state noise in [{unused[0]}] "
            "of --settings"
        )
    text = f"[{{}}] of --settings does not state its noise ({recording.source.name})"
    counts = {(f"{k} row", text.format(k)): len(recording.tables[k]["t_s"]) for k in unused}
    tables = {kind: rows for kind, rows in recording.tables.items() if kind not in unused}
    return replace(recording, tables=tables, unused=(*recording.unused, *unused_of(counts)))


def _start(recordings: Sequence[Recording], settings: Settings, missing: dict[str, str]) -> float:
    """Return the GPS time of ``t_s = 0``, to the millisecond."""
    if settings.start is not None:
        return flight_toml.gps_seconds(Path("--settings"), settings.start)
    dated = [r.gps_start_s for r in recordings if r.clock == "gps" and r.tables]
    week_s = float(np.floor(dated[0] / WEEK_S) * WEEK_S) if dated else 0.0
    firsts = {
        kind: float(table["t_s"][0]) + (r.gps_start_s if r.clock == "gps" else week_s)
        for r in reversed(recordings)
        if r.clock != "own"
        for kind, table in r.tables.items()
    }
    if not (dated and firsts):
        times = [first_epoch_gps_s(path) for r in recordings for path in r.observations]
        if times and times[0] is not None:
            return times[0]
        missing["start"] = "no file has a date: this is the first week of GPS; state the GPS time"
    first = firsts.get("fixes", min(firsts.values(), default=0.0))
    return float(np.round(first, 3))


def _shifted(
    recording: Recording, start_s: float, settings: Settings, missing: dict[str, str]
) -> Recording:
    """Return a recording on the flight's clock; one of its own has its first fix on the start."""
    shift_s, tables = recording.gps_start_s - start_s, recording.tables
    if recording.clock == "week":
        shift_s = float(np.floor(start_s / WEEK_S) * WEEK_S - start_s)
    elif recording.clock == "own" and tables:
        first = tables.get("fixes", next(iter(tables.values())))
        shift_s = -float(first["t_s"][0])
        if "fixes" not in tables and not settings.imu.clock_offset_s:
            missing["imu.clock_offset_s"] = (
                f"{recording.source.name} has a clock of its own: its first sample was laid on the "
                "start. State what to add to its times; `fgnav check` finds it within 20 s"
            )
    tables = {kind: {**rows, "t_s": rows["t_s"] + shift_s} for kind, rows in tables.items()}
    return replace(recording, tables=tables)


def _antennas(
    recordings: Sequence[Recording],
    settings: Settings,
    observations: Sequence[str],
    missing: dict[str, str],
) -> tuple[flight_toml.AntennaTable, ...]:
    """Return the settings' antennas, else one of each observation file, or of each receiver."""
    count = max((ends[-1] + 1 for ends in _ends(recordings) if ends), default=0)
    antennas = settings.antenna
    if antennas and (
        (observations and len(observations) != len(antennas)) or count > len(antennas)
    ):
        raise BadInputError(
            f"key antenna: {len(antennas)} antennas in --settings, but {len(observations)} "
            f"observation files, and fixes and baselines of {count}"
        )
    if not antennas:
        paths = [path for recording in recordings for path in recording.observations]
        names = [path.name.split(".")[0] for path in paths]
        if len(set(names)) < len(names):
            names = [f"a{k + 1}" for k in range(len(names))]
        names += [f"gps{k + 1}" if count > 1 else "gps" for k in range(len(names), count)]
        if names:
            missing["antenna.position_b_m"] = (
                "no file states where the antenna sits: state forward, right, down, m, from the "
                "body's origin"
            )
        antennas = tuple(
            flight_toml.AntennaTable(name=name, position_b_m=(0.0, 0.0, 0.0)) for name in names
        )
    pairs = zip(antennas, observations, strict=False)
    named = [msgspec.structs.replace(antenna, observations=name) for antenna, name in pairs]
    return (*named, *antennas[len(named) :])


def _ends(recordings: Sequence[Recording]) -> list[tuple[int, ...]]:
    """Return the number of the antenna of each file's fixes, and that of its baseline's other end.

    Files with fixes have an antenna each, in their order; a baseline is from it to the next one.
    """
    ends, number = list[tuple[int, ...]](), 0
    for tables in (recording.tables for recording in recordings):
        has_baseline = "baseline" in tables
        ends.append((number, number + 1) if has_baseline else (number,) * ("fixes" in tables))
        number += "fixes" in tables
    return ends


def _records(
    recordings: Sequence[Recording], settings: Settings, antennas: Sequence[str]
) -> tuple[dict[str, Samples], dict[str, Any]]:
    """Return tables of samples by their files' names, and tables of flight.toml by their keys."""
    samples, records = dict[str, Samples](), dict[str, list[Any]]()
    for recording, ends in zip(recordings, _ends(recordings), strict=True):
        names = [antennas[k] for k in ends]
        for kind, rows in recording.tables.items():
            earlier = records.setdefault(kind, [])
            if earlier and kind not in flight_toml.SEVERAL:
                first = next(other.source.name for other in recordings if kind in other.tables)
                raise BadInputError(
                    f"{recording.source}: has {kind}, as {first} has; a flight takes those of one "
                    "instrument: import one of them, and the other as a flight of its own"
                )
            name = samples_name(kind, len(earlier))
            samples[name] = rows
            keys = _keys(kind, recording, settings, names)
            earlier.append(flight_toml.RECORDS[kind](samples=name, **keys))
    return samples, {
        kind: tuple(some) if kind in flight_toml.SEVERAL else some[0]
        for kind, some in records.items()
    }


def _keys(
    kind: str, recording: Recording, settings: Settings, antennas: Sequence[str]
) -> dict[str, Any]:
    """Return the keys of an instrument in flight.toml, beside its samples."""
    if kind == "fixes":
        return {"antenna": antennas[0]}
    if kind == "baseline":
        return {"antennas": antennas[::-1] if recording.baseline_ends_at_fixes else antennas}
    if kind == "truth":
        return {"source": recording.truth_source}
    stated = msgspec.structs.asdict(getattr(settings, kind))
    usual = recording.imu_noise if kind == "imu" else {}
    return {name: usual.get(name) if value is None else value for name, value in stated.items()}


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

    Examples
    --------
    >>> recording = importer_named("rinex")(Path("demo/flight/a1.rnx"), Settings(), Path())
    >>> write(assemble([recording], Settings()), Path("assembled"), verify=False)
    >>> sorted(path.name for path in Path("assembled").iterdir())
    ['a1.rnx', 'flight.toml']
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
