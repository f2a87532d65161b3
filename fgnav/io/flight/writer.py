"""The files of a flight, written into a folder, and what its flight.toml says of them."""

import re
from pathlib import Path

import msgspec
import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.earth import Origin
from fgnav.io.flight import columns, networks
from fgnav.io.flight import toml as flight_toml
from fgnav.io.flight.baselines import baseline_blocks, local_axes
from fgnav.io.flight.integers import write_integers
from fgnav.io.flight.keys import table_of
from fgnav.io.flight.local_frame import attitude_of_n, place_of_n, velocity_of_n
from fgnav.io.rinex.writer import RinexVersion, write_navigation, write_observations
from fgnav.io.sp3.writer import write_precise
from fgnav.io.tables import write_table
from fgnav.types.flight import (
    Baseline,
    Fixes,
    Flight,
    Imu,
    Seeker,
    Truth,
)
from fgnav.types.surroundings import Barometer, Magnetometer
from fgnav.types.vehicle import FinnedVehicle

FILE_NAME = "flight.toml"
_PLAIN_NAME = re.compile(r"[A-Za-z0-9_-]{1,40}")
_TAKEN = ("base", "broadcast")


def check_empty(folder: Path) -> None:
    """Raise unless a folder is new or empty.

    Raises
    ------
    BadInputError
        If it holds something, or is a file.
    """
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
        imu=_imu(flight.imu, folder) if flight.imu else None,
        fixes=tuple(
            _fixes(one, flight.origin, folder, numbered("fixes", k))
            for k, one in enumerate(flight.fixes)
        ),
        baseline=tuple(
            _baseline(one, flight, folder, numbered("baseline", k))
            for k, one in enumerate(flight.baselines)
        ),
        seeker=_seeker(flight.seeker, flight.origin, folder) if flight.seeker else None,
        barometer=_barometer(flight.barometer, folder) if flight.barometer else None,
        magnetometer=_magnetometer(flight.magnetometer, folder) if flight.magnetometer else None,
        vehicle=_vehicle(flight),
        initial=table_of(flight_toml.InitialTable, flight.initial) if flight.initial else None,
        truth=_truth(flight.truth, flight.origin, folder) if flight.truth else None,
    )
    return msgspec.structs.replace(table, rows=row_counts(table, flight))


def row_counts(table: flight_toml.FlightTable, flight: Flight) -> dict[str, int]:
    """Return how many rows of a flight each table holds, epochs or messages each file of orbits.

    Of several files of orbits nobody knows how many each holds: they are not in it.
    """
    records = flight.records.values()
    counts = {k.samples: len(one.t_s) for k, one in zip(table.sampled, records, strict=True)}
    if len(table.gnss.orbits) == 1 and flight.precise is not None:
        counts[table.gnss.orbits[0]] = len(flight.precise.t_s)
    if len(table.gnss.navigation) == 1 and flight.broadcast is not None:
        counts[table.gnss.navigation[0]] = len(flight.broadcast.records)
    if table.seeker is not None and flight.seeker is not None:
        counts[table.seeker.calibration] = len(flight.seeker.calibration)
    integers = flight.truth.integers if flight.truth is not None else None
    if table.truth is not None and table.truth.integers and integers is not None:
        counts[table.truth.integers] = len(integers.cycles)
    return counts


def _antennas(
    flight: Flight, folder: Path, rinex: RinexVersion
) -> tuple[flight_toml.AntennaTable, ...]:
    """Write one RINEX file per antenna; return their tables."""
    tables = []
    for k, antenna in enumerate(flight.antennas):
        file_name = None
        if flight.observations is not None:
            plain = _PLAIN_NAME.fullmatch(antenna.name) and antenna.name.lower() not in _TAKEN
            file_name = f"{antenna.name if plain else f'antenna-{k + 1}'}.rnx"
            if (folder / file_name).exists():  # names that differ in case only
                file_name = f"antenna-{k + 1}.rnx"
            write_observations(
                folder / file_name,
                flight.observations,
                k,
                start_gps_s=flight.start_gps_s,
                marker=antenna.name,
                position_e_m=flight.origin.p_e_m,
                version=rinex,
            )
        tables.append(table_of(flight_toml.AntennaTable, antenna, observations=file_name))
    return tuple(tables)


def _gnss(flight: Flight, folder: Path, rinex: RinexVersion) -> flight_toml.GnssTable:
    """Write orbits and the base's observations; return their table."""
    start_gps_s = flight.start_gps_s
    if flight.broadcast is not None:
        write_navigation(
            folder / "broadcast.rnx", flight.broadcast, start_gps_s=start_gps_s, version=rinex
        )
    if flight.precise is not None:
        write_precise(folder / "precise.sp3", flight.precise, start_gps_s=start_gps_s)
    base = None
    if flight.base is not None:
        base = table_of(flight_toml.BaseTable, flight.base, observations="base.rnx")
        write_observations(
            folder / "base.rnx",
            flight.base.observations,
            0,
            start_gps_s=start_gps_s,
            marker="base",
            position_e_m=flight.base.position_e_m,
            version=rinex,
        )
    noise = flight.gnss_noise
    return table_of(
        flight_toml.GnssTable,
        noise,
        navigation=("broadcast.rnx",) if flight.broadcast is not None else (),
        orbits=("precise.sp3",) if flight.precise is not None else (),
        elevation_mask_deg=float(np.degrees(flight.elevation_mask_rad)),
        code_noise_m=None if "code_m" in noise.unstated else noise.code_m,
        phase_noise_m=None if "phase_m" in noise.unstated else noise.phase_m,
        doppler_noise_mps=None if "doppler_mps" in noise.unstated else noise.doppler_mps,
        base=base,
    )


def _write(path: Path, t_s: FloatArray, *blocks: tuple[tuple[str, ...], FloatArray | None]) -> None:
    """Write a table of times and blocks of columns; blocks that are None are left out."""
    table = {"t_s": t_s}
    for names, block in blocks:
        if block is not None:
            table |= {name: block[:, k] for k, name in enumerate(names)}
    write_table(path, table, columns.FORMATS)


def _imu(imu: Imu, folder: Path) -> flight_toml.ImuTable:
    _write(
        folder / "imu.csv",
        imu.t_s,
        (columns.FORCE, imu.f_b_mps2),
        (columns.RATE, imu.w_b_radps),
    )
    return table_of(flight_toml.ImuTable, imu, samples="imu.csv")


def numbered(name: str, k: int) -> str:
    """Return the name of the samples of one of several records."""
    return f"{name}-{k + 1}.csv" if k else f"{name}.csv"


def _fixes(fixes: Fixes, origin: Origin, folder: Path, samples: str) -> flight_toml.FixesTable:
    velocity = None
    if fixes.v_n_mps is not None:
        velocity = velocity_of_n(origin, fixes.p_n_m, fixes.v_n_mps)
    _write(
        folder / samples,
        fixes.t_s,
        (columns.PLACE, place_of_n(origin, fixes.p_n_m)),
        (columns.VELOCITY, velocity),
        (
            columns.POSITION_SIGMA,
            None if "position" in fixes.unstated else fixes.position_sigma_m,
        ),
        (
            columns.VELOCITY_SIGMA,
            None if "velocity" in fixes.unstated else fixes.velocity_sigma_mps,
        ),
    )
    return flight_toml.FixesTable(samples=samples, antenna=fixes.antenna)


def _baseline(
    of: Baseline, flight: Flight, folder: Path, samples: str
) -> flight_toml.BaselineTable:
    R_nl = local_axes(flight.origin, flight.fixes, of.t_s)
    _write(folder / samples, of.t_s, *baseline_blocks(of, R_nl))
    return flight_toml.BaselineTable(samples=samples, antennas=of.antennas)


def _seeker(seeker: Seeker, origin: Origin, folder: Path) -> flight_toml.SeekerTable:
    _write(folder / "seeker.csv", seeker.t_s, (columns.CURRENTS, seeker.currents))
    calibration = dict(zip(columns.CALIBRATION, seeker.calibration.T, strict=True))
    write_table(folder / "quadrant.csv", calibration, columns.FORMATS)
    (place,) = place_of_n(origin, seeker.landmark_n_m[None]).tolist()
    landmark = flight_toml.Place(**dict(zip(columns.PLACE, place, strict=True)))
    return table_of(
        flight_toml.SeekerTable,
        seeker,
        samples="seeker.csv",
        landmark=landmark,
        calibration="quadrant.csv",
    )


def _barometer(barometer: Barometer, folder: Path) -> flight_toml.BarometerTable:
    heights_m = barometer.height_m[:, None]
    _write(folder / "barometer.csv", barometer.t_s, (columns.HEIGHT, heights_m))
    return table_of(flight_toml.BarometerTable, barometer, samples="barometer.csv")


def _magnetometer(sensor: Magnetometer, folder: Path) -> flight_toml.MagnetometerTable:
    _write(folder / "magnetometer.csv", sensor.t_s, (columns.FIELD, sensor.field_b_ut))
    return table_of(flight_toml.MagnetometerTable, sensor, samples="magnetometer.csv")


def _vehicle(flight: Flight) -> flight_toml.VehicleTable | None:
    vehicle = flight.vehicle
    if vehicle is None:
        return flight_toml.VehicleTable(standstill=True) if flight.standstill else None
    kind = "finned" if isinstance(vehicle, FinnedVehicle) else "wheeled"
    return table_of(flight_toml.VehicleTable, vehicle, kind=kind, standstill=flight.standstill)


def _truth(truth: Truth, origin: Origin, folder: Path) -> flight_toml.TruthTable:
    _write(
        folder / "truth.csv",
        truth.t_s,
        (columns.PLACE, place_of_n(origin, truth.p_n_m)),
        (columns.VELOCITY, velocity_of_n(origin, truth.p_n_m, truth.v_n_mps)),
        (columns.EULER, attitude_of_n(origin, truth.p_n_m, truth.R_nb)),
        (columns.POSITION_SIGMA, truth.position_sigma_m),
        (columns.VELOCITY_SIGMA, truth.velocity_sigma_mps),
        (
            columns.EULER_SIGMA,
            None if truth.euler_sigma_rad is None else np.degrees(truth.euler_sigma_rad),
        ),
    )
    if truth.integers is not None:
        write_integers(folder / "integers.csv", truth.integers)
    return flight_toml.TruthTable(
        samples="truth.csv",
        integers=None if truth.integers is None else "integers.csv",
        source=truth.source,
    )
