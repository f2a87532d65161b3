"""One flight of what several files hold: one clock, one origin, written by the one writer."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from fgnav.checks import BadInputError, FloatArray, Loss
from fgnav.geometry.earth import Origin
from fgnav.io.atomic_write import atomic_folder
from fgnav.io.flight import series, usual_noise, writer
from fgnav.io.flight import toml as flight_toml
from fgnav.io.flight.folder import load_flight
from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.place import first_epoch_gps_s, origin_of
from fgnav.io.importers.recording import Recording, cleaned
from fgnav.io.importers.settings import Settings
from fgnav.types.flight import Antenna, Flight, TruthSource

SETTINGS_NAME = "import.toml"
_OWNERS = {"fixes": "receiver", "imu": "inertial unit"}
_OPTIONAL = ("barometer", "magnetometer")  # whose noise no log states


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Assembled:
    """A flight to be written."""

    flight: Flight  # without observations: RINEX files are copied as they are
    observations: tuple[Path, ...]  # one an antenna, or none
    navigation: tuple[Path, ...]
    orbits: tuple[Path, ...]
    # notes, missing: what the user should know, and what he must state, by the key of flight.toml
    notes: dict[str, str]
    missing: dict[str, str]


def assemble(recordings: Sequence[Recording], settings: Settings) -> Assembled:
    """Put what files hold on one clock and into one frame.

    ``t_s = 0`` is the settings' ``start``, else the first fix, else the first observation. A clock
    of a unit's own is laid with its first sample on the start, and a note says so.

    Raises
    ------
    BadInputError
        If two files have the same table, or a table has no usable row, or nothing is left
        without instruments whose noise is not stated: those are left out, and counted.
    """
    recordings = [cleaned(_stated(one, settings)) for one in recordings]
    missing = {key: text for one in recordings for key, text in one.missing.items()}
    losses = [loss for one in recordings for loss in one.losses]
    start_s = _start(recordings, settings, missing)
    tables: dict[str, dict[str, FloatArray]] = {}
    sources: dict[str, str] = {}
    truth_source = next((one.truth_source for one in recordings if "truth" in one.tables), None)
    for one in recordings:
        shift_s = _shift(one, start_s, settings, missing)
        for kind, rows in one.tables.items():
            if kind in tables:
                raise BadInputError(
                    f"{one.source}: has {kind}, as {sources[kind]} has; a flight takes those of "
                    f"one {_OWNERS.get(kind, 'instrument')}: import one of them, and the other as "
                    "a flight of its own"
                )
            sources[kind] = one.source.name
            tables[kind] = {**rows, "t_s": rows["t_s"] + shift_s}
    observations = tuple(path for one in recordings for path in one.observations)
    antennas = _antennas(settings, observations, "fixes" in tables, missing)
    noise = {key: value for one in recordings for key, value in one.imu_noise.items()}
    navigation = tuple(path for one in recordings for path in one.navigation)
    orbits = tuple(path for one in recordings for path in one.orbits)
    origin = origin_of(tables, observations, (navigation, orbits), start_s)
    if origin is None:
        missing["origin"] = "no file states a place: state one within some km of the flight"
        origin = Origin(latitude_rad=0.0, longitude_rad=0.0, height_m=0.0)
    flight = Flight(
        name=settings.name or recordings[0].source.stem,
        start_gps_s=start_s,
        origin=origin,
        antennas=antennas,
        losses=tuple(losses),
        gnss_noise=usual_noise.gnss_noise(dict.fromkeys(("code_m", "phase_m", "doppler_mps"))),
        **_parts(tables, settings, noise, origin, antennas, truth_source),
    )
    return Assembled(
        flight=flight,
        observations=observations,
        navigation=navigation,
        orbits=orbits,
        notes={key: text for one in recordings for key, text in one.notes.items()},
        missing=missing,
    )


def _stated(one: Recording, settings: Settings) -> Recording:
    """Return a recording without instruments whose noise the settings do not state; count them."""
    unused = [kind for kind in _OPTIONAL if kind in one.tables and not getattr(settings, kind)]
    if unused and set(one.tables) == set(unused):
        raise BadInputError(
            f"{one.source}: holds {' and '.join(unused)} alone; state noise in [{unused[0]}] of "
            "--settings"
        )
    losses = [
        Loss(
            what=f"{kind} row",
            reason=f"[{kind}] of --settings does not state its noise ({one.source.name})",
            count=len(one.tables[kind]["t_s"]),
        )
        for kind in unused
    ]
    tables = {kind: rows for kind, rows in one.tables.items() if kind not in unused}
    return replace(one, tables=tables, losses=(*one.losses, *losses))


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


def _shift(one: Recording, start_s: float, settings: Settings, missing: dict[str, str]) -> float:
    """Return what to add to a file's times; a clock of its own has its first fix on the start."""
    tables = one.tables
    if one.clock == "gps" or not tables:
        return one.gps_start_s - start_s
    if one.clock == "week":
        return float(np.floor(start_s / WEEK_S) * WEEK_S - start_s)
    if "fixes" not in tables and not settings.imu.clock_offset_s:
        missing["imu.clock_offset_s"] = (
            f"{one.source.name} has a clock of its own: its first sample was laid on the start. "
            "State what to add to its times; `fgnav check` finds it within 20 s"
        )
    return -float(tables["fixes" if "fixes" in tables else next(iter(tables))]["t_s"][0])


def _antennas(
    settings: Settings, observations: Sequence[Path], fixes: bool, missing: dict[str, str]
) -> tuple[Antenna, ...]:
    """Return the settings' antennas, else one of each observation file, or of the fixes."""
    if settings.antenna:
        if observations and len(observations) != len(settings.antenna):
            raise BadInputError(
                f"key antenna: {len(settings.antenna)} antennas in --settings, but "
                f"{len(observations)} observation files"
            )
        stated = settings.antenna
        return tuple(Antenna(name=a.name, position_b_m=np.array(a.position_b_m)) for a in stated)
    names = [path.name.split(".")[0] for path in observations] or (["gps"] if fixes else [])
    if len(set(names)) < len(names):
        names = [f"a{k + 1}" for k in range(len(names))]
    if names:
        missing["antenna.position_b_m"] = (
            "no file states where the antenna sits: state forward, right, down, m, from the "
            "body's origin"
        )
    return tuple(Antenna(name=name, position_b_m=np.zeros(3)) for name in names)


def _parts(
    tables: Mapping[str, dict[str, FloatArray]],
    settings: Settings,
    noise: Mapping[str, float],
    origin: Origin,
    antennas: tuple[Antenna, ...],
    truth_source: TruthSource | None,
) -> dict[str, Any]:
    """Return the parts of a flight by name."""
    parts: dict[str, Any] = {}
    if "imu" in tables:
        usual = {key: value for key, value in noise.items() if getattr(settings.imu, key) is None}
        unit = msgspec.structs.replace(settings.imu, **usual)
        parts["imu"] = series.imu(tables["imu"], unit)
    if "fixes" in tables:
        name, where = antennas[0].name, "the imported fixes"
        parts["fixes"] = (series.fixes(tables["fixes"], origin, name, where=where),)
    if "barometer" in tables and settings.barometer is not None:
        parts["barometer"] = series.barometer(tables["barometer"], settings.barometer)
    if "magnetometer" in tables and settings.magnetometer is not None:
        parts["magnetometer"] = series.magnetometer(tables["magnetometer"], settings.magnetometer)
    if "truth" in tables:
        parts["truth"] = series.truth(
            tables["truth"], origin, source=truth_source, where="the imported reference"
        )
    return parts


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

    Raises
    ------
    BadInputError
        If the folder holds something, or what was written is no flight.
    """
    writer.check_empty(folder)
    with atomic_folder(folder) as new:
        table = writer.write_parts(assembled.flight, new)
        names = [
            _copied(files, new)
            for files in (assembled.observations, assembled.navigation, assembled.orbits)
        ]
        antennas = tuple(
            msgspec.structs.replace(one, observations=names[0][k] if names[0] else None)
            for k, one in enumerate(table.antenna)
        )
        gnss = msgspec.structs.replace(table.gnss, navigation=names[1], orbits=names[2])
        table = msgspec.structs.replace(table, antenna=antennas, gnss=gnss)
        flight_toml.write_flight_toml(new / writer.FILE_NAME, table, comments or {})
        if settings is not None:
            flight_toml.write_flight_toml(new / SETTINGS_NAME, settings)
        if verify:
            try:
                load_flight(new)
            except BadInputError as error:
                text = str(error)
                files = (*assembled.observations, *assembled.navigation, *assembled.orbits)
                for name, path in zip(sum(names, ()), files, strict=True):
                    text = text.replace(str(new / name), str(path))
                raise BadInputError(text.replace(str(new), str(folder))) from error


def _copied(files: Sequence[Path], folder: Path) -> tuple[str, ...]:
    """Copy files into a folder; return their names there."""
    names: list[str] = []
    for path in files:
        name = path.name
        if (folder / name).exists():
            name = f"{len(names) + 1}-{path.name}"
        shutil.copyfile(path, folder / name)
        names.append(name)
    return tuple(names)
