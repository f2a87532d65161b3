"""The files of a flight, written into a folder, and what its flight.toml says of them."""

import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from fgnav.checks import BadInputError
from fgnav.io.flight import networks
from fgnav.io.flight import toml as flight_toml
from fgnav.io.flight.columns import CALIBRATION, FORMATS, PLACE, samples
from fgnav.io.flight.integers import write_integers
from fgnav.io.flight.keys import table_of
from fgnav.io.flight.local_frame import place_of_n
from fgnav.io.flight.series import blocks_of
from fgnav.io.flight.toml import RECORDS, SEVERAL
from fgnav.io.rinex.writer import RinexVersion, write_navigation, write_observations
from fgnav.io.sp3 import write_precise
from fgnav.io.tables import write_table
from fgnav.types.flight import Flight, Photodetector, Truth
from fgnav.types.vehicle import FinnedVehicle

FILE_NAME = "flight.toml"
_PLAIN_NAME = re.compile(r"[A-Za-z0-9_-]{1,40}")
_TAKEN = ("base", "broadcast")


def check_empty(folder: Path) -> None:
    """Raise unless a folder is new or empty."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInputError(f"{folder}: must be a new or empty folder, it holds something")


def write_parts(
    flight: Flight, folder: Path, rinex: RinexVersion = "3.04"
) -> flight_toml.FlightTable:
    """Write a flight's files into a folder, all but flight.toml; return what that should hold."""
    table = flight_toml.FlightTable(
        format=flight_toml.FORMAT,
        name=flight.name,
        start=flight_toml.gps_date(flight.start_gps_s),
        origin=table_of(flight_toml.Place, flight.origin),
        antenna=_antennas(flight, folder, rinex),
        network=networks.write(flight.networks, folder),
        gnss=_gnss(flight, folder, rinex),
        vehicle=_vehicle(flight),
        initial=table_of(flight_toml.InitialTable, flight.initial) if flight.initial else None,
        **_records(flight, folder),
    )
    return msgspec.structs.replace(table, rows=row_counts(table, flight))


def row_counts(table: flight_toml.FlightTable, flight: Flight) -> dict[str, int]:
    """Count the rows of each table of a flight, the epochs or messages of each file of orbits.

    Of several files of orbits nobody knows how many each holds: they are not in it.
    """
    records = flight.records.values()
    counts = {k.samples: len(record.t_s) for k, record in zip(table.sampled, records, strict=True)}
    if len(table.gnss.orbits) == 1 and flight.precise is not None:
        counts[table.gnss.orbits[0]] = len(flight.precise.t_s)
    if len(table.gnss.navigation) == 1 and flight.broadcast is not None:
        counts[table.gnss.navigation[0]] = len(flight.broadcast.records)
    if table.photodetector is not None and flight.photodetector is not None:
        counts[table.photodetector.calibration] = len(flight.photodetector.calibration)
    integers = flight.truth.integers if flight.truth is not None else None
    if table.truth is not None and table.truth.integers and integers is not None:
        counts[table.truth.integers] = len(integers.cycles)
    return counts


def _antennas(
    flight: Flight, folder: Path, rinex: RinexVersion
) -> tuple[flight_toml.AntennaTable, ...]:
    """Write one RINEX file per antenna; return their tables."""
    tables, observations = [], flight.observations
    for k, antenna in enumerate(flight.antennas):
        file_name = None
        if observations is not None:
            is_plain = _PLAIN_NAME.fullmatch(antenna.name) and antenna.name.lower() not in _TAKEN
            file_name = f"{antenna.name if is_plain else f'antenna-{k + 1}'}.rnx"
            if (folder / file_name).exists():  # names that differ in case only
                file_name = f"antenna-{k + 1}.rnx"
            origin = {"start_gps_s": flight.start_gps_s, "position_e_m": flight.origin.p_e_m}
            header: dict[str, Any] = {**origin, "marker": antenna.name, "version": rinex}
            write_observations(folder / file_name, observations, k, **header)
        tables.append(table_of(flight_toml.AntennaTable, antenna, observations=file_name))
    return tuple(tables)


def _gnss(flight: Flight, folder: Path, rinex: RinexVersion) -> flight_toml.GnssTable:
    """Write orbits and the base's observations; return their table."""
    start: dict[str, Any] = {"start_gps_s": flight.start_gps_s}
    values: dict[str, Any] = {"elevation_mask_deg": float(np.degrees(flight.elevation_mask_rad))}
    if flight.broadcast is not None:
        values["navigation"] = ("broadcast.rnx",)
        write_navigation(folder / "broadcast.rnx", flight.broadcast, **start, version=rinex)
    if flight.precise is not None:
        values["orbits"] = ("precise.sp3",)
        write_precise(folder / "precise.sp3", flight.precise, **start)
    if (base := flight.base) is not None:
        values["base"] = table_of(flight_toml.BaseTable, base, observations="base.rnx")
        header = {**start, "marker": "base", "position_e_m": base.position_e_m, "version": rinex}
        write_observations(folder / "base.rnx", base.observations, 0, **header)
    noise = flight.gnss_noise
    values |= {
        key: None if field in noise.unstated else getattr(noise, field)
        for key, field in flight_toml.GNSS_NOISE.items()
    }
    return table_of(flight_toml.GnssTable, noise, **values)


def samples_name(name: str, k: int) -> str:
    """Return the name of the samples of one of several records."""
    return f"{name}-{k + 1}.csv" if k else f"{name}.csv"


def _records(flight: Flight, folder: Path) -> dict[str, Any]:
    """Write records and what belongs to them; return their tables by key."""
    keys: dict[str, Any] = {}
    for kind, table in RECORDS.items():
        records = getattr(flight, "baselines" if kind == "baseline" else kind)
        tables = []
        for k, record in enumerate(records if kind in SEVERAL else filter(None, [records])):
            name = samples_name(kind, k)
            blocks = blocks_of(record, flight.origin, flight.fixes)
            write_table(folder / name, samples(record.t_s, *blocks), FORMATS)
            more = _more(record, flight, folder)
            tables.append(table_of(table, record, samples=name, **more))
        keys[kind] = tuple(tables) if kind in SEVERAL else next(iter(tables), None)
    return keys


def _more(record: object, flight: Flight, folder: Path) -> dict[str, Any]:
    """Write what a record has beside its samples; return the keys that say so."""
    if isinstance(record, Photodetector):
        calibration = dict(zip(CALIBRATION, record.calibration.T, strict=True))
        write_table(folder / "quadrant.csv", calibration, FORMATS)
        (coordinates,) = place_of_n(flight.origin, record.landmark_n_m[None]).tolist()
        landmark = flight_toml.Place(**dict(zip(PLACE, coordinates, strict=True)))
        return {"landmark": landmark, "calibration": "quadrant.csv"}
    if isinstance(record, Truth):
        if record.integers is not None:
            write_integers(folder / "integers.csv", record.integers)
        return {"integers": None if record.integers is None else "integers.csv"}
    return {}


def _vehicle(flight: Flight) -> flight_toml.VehicleTable | None:
    vehicle = flight.vehicle
    if vehicle is None:
        return flight_toml.VehicleTable(standstill=True) if flight.standstill else None
    kind = "finned" if isinstance(vehicle, FinnedVehicle) else "wheeled"
    return table_of(flight_toml.VehicleTable, vehicle, kind=kind, standstill=flight.standstill)
