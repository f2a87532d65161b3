"""One flight of what several files hold: one clock, one origin, written by the one writer."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from fgnav.checks import BadInputError, Loss
from fgnav.geometry.earth import Origin
from fgnav.io.atomic_write import atomic_folder
from fgnav.io.flight import series, usual_noise, writer
from fgnav.io.flight import toml as flight_toml
from fgnav.io.flight.baselines import baseline, local_axes
from fgnav.io.flight.folder import load_flight
from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.place import first_epoch_gps_s, origin_of
from fgnav.io.importers.recording import Recording, cleaned
from fgnav.io.importers.settings import Settings
from fgnav.types.flight import Antenna, Flight

SETTINGS_NAME = "import.toml"
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
    start_s = _start(recordings, settings, missing)
    shifted = [_shifted(one, start_s, settings, missing) for one in recordings]
    undated = [
        one.source.name for one in recordings if one.clock == "own" and "fixes" in one.tables
    ]
    if len(undated) > 1:
        missing["fixes"] = (
            f"{', '.join(undated)} have clocks of their own: the first fix of each was laid on the "
            "start. Where they share a clock, state start in [[csv]] of each"
        )
    observations, navigation, orbits = (
        tuple(path for one in recordings for path in getattr(one, name))
        for name in ("observations", "navigation", "orbits")
    )
    antennas = _antennas(settings, observations, shifted, missing)
    tables = {kind: rows for one in reversed(shifted) for kind, rows in one.tables.items()}
    origin = origin_of(tables, observations, (navigation, orbits), start_s)
    if origin is None:
        missing["origin"] = "no file states a place: state one within some km of the flight"
        origin = Origin(latitude_rad=0.0, longitude_rad=0.0, height_m=0.0)
    flight = Flight(
        name=settings.name or recordings[0].source.stem,
        start_gps_s=start_s,
        origin=origin,
        antennas=antennas,
        losses=tuple(loss for one in recordings for loss in one.losses),
        gnss_noise=usual_noise.gnss_noise(dict.fromkeys(("code_m", "phase_m", "doppler_mps"))),
        **_receivers(shifted, origin, antennas),
        **_instruments(shifted, settings, origin),
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
) -> tuple[Antenna, ...]:
    """Return the settings' antennas, else one of each observation file, or of each receiver."""
    count = max((last for _, last in _places(recordings)), default=-1) + 1
    if settings.antenna:
        if (observations and len(observations) != len(settings.antenna)) or count > len(
            settings.antenna
        ):
            raise BadInputError(
                f"key antenna: {len(settings.antenna)} antennas in --settings, but "
                f"{len(observations)} observation files, and fixes and baselines of {count}"
            )
        stated = settings.antenna
        return tuple(Antenna(name=a.name, position_b_m=np.array(a.position_b_m)) for a in stated)
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
    return tuple(Antenna(name=name, position_b_m=np.zeros(3)) for name in names)


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


def _receivers(
    recordings: Sequence[Recording], origin: Origin, antennas: Sequence[Antenna]
) -> dict[str, Any]:
    """Return fixes and baselines."""
    fixes, baselines = [], []
    for one, (first, second) in zip(recordings, _places(recordings), strict=True):
        if "fixes" in one.tables:
            fixes.append(
                series.fixes(one.tables["fixes"], origin, antennas[first].name, where=one.source)
            )
        if "baseline" in one.tables:
            ends = antennas[first].name, antennas[second].name
            ends = ends[::-1] if one.baseline_ends_at_fixes else ends
            rows = one.tables["baseline"]
            R_nl = local_axes(origin, fixes, rows["t_s"])
            baselines.append(baseline(rows, ends, R_nl, where=one.source))
    return {"fixes": tuple(fixes), "baselines": tuple(baselines)}


def _instruments(
    recordings: Sequence[Recording], settings: Settings, origin: Origin
) -> dict[str, Any]:
    """Return the parts of a flight that it has one of, by name."""
    parts: dict[str, Any] = {}
    sources: dict[str, Path] = {}
    for one in recordings:
        for kind, rows in one.tables.items():
            if kind in sources:
                raise BadInputError(
                    f"{one.source}: has {kind}, as {sources[kind].name} has; a flight takes those "
                    "of one instrument: import one of them, and the other as a flight of its own"
                )
            if kind in ("fixes", "baseline"):
                continue
            sources[kind] = one.source
            if kind == "imu":
                unit = settings.imu
                usual = {k: v for k, v in one.imu_noise.items() if getattr(unit, k) is None}
                parts[kind] = series.imu(rows, msgspec.structs.replace(unit, **usual))
            elif kind == "barometer" and settings.barometer is not None:
                parts[kind] = series.barometer(rows, settings.barometer)
            elif kind == "magnetometer" and settings.magnetometer is not None:
                parts[kind] = series.magnetometer(rows, settings.magnetometer)
            elif kind == "truth":
                source = one.truth_source
                parts[kind] = series.truth(rows, origin, source=source, where=one.source)
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
