"""The files of a flight, written into a folder, and what its flight.toml says of them."""

import re
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.earth import Origin
from fgnav.io.flight import columns, networks
from fgnav.io.flight import toml as flight_toml
from fgnav.io.flight.integers import write_integers
from fgnav.io.flight.local_frame import attitude_of_n, place_of_n, velocity_of_n
from fgnav.io.flight.usual_noise import IMU
from fgnav.io.rinex.writer import RinexVersion, write_navigation, write_observations
from fgnav.io.sp3.writer import write_precise
from fgnav.io.strict_toml import Vector
from fgnav.io.tables import write_table
from fgnav.types.flight import Flight

FILE_NAME = "flight.toml"
_PLAIN_NAME = re.compile(r"[A-Za-z0-9_-]{1,40}")
_TAKEN = ("base", "broadcast")
_T = TypeVar("_T", bound=msgspec.Struct)


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
    return flight_toml.FlightTable(
        rows=_rows(flight),
        format=flight_toml.FORMAT,
        name=flight.name,
        start=flight_toml.gps_date(flight.start_gps_s),
        origin=_place_of_origin(flight.origin),
        antenna=_antennas(flight, folder, rinex),
        network=networks.write(flight.networks, folder),
        gnss=_gnss(flight, folder, rinex),
        imu=_imu(flight, folder),
        fixes=_fixes(flight, folder),
        seeker=_seeker(flight, folder),
        barometer=_barometer(flight, folder),
        magnetometer=_magnetometer(flight, folder),
        vehicle=_vehicle(flight),
        initial=_initial(flight),
        truth=_truth(flight, folder),
    )


def _rows(flight: Flight) -> dict[str, int]:
    """Return how many rows each table holds, epochs or messages each file of orbits."""
    series = {
        "imu.csv": flight.imu,
        "fixes.csv": flight.fixes,
        "seeker.csv": flight.seeker,
        "barometer.csv": flight.barometer,
        "magnetometer.csv": flight.magnetometer,
        "truth.csv": flight.truth,
    }
    rows = {name: len(one.t_s) for name, one in series.items() if one is not None}
    if flight.precise is not None:
        rows["precise.sp3"] = len(flight.precise.t_s)
    if flight.broadcast is not None:
        rows["broadcast.rnx"] = len(flight.broadcast.records)
    if flight.seeker is not None:
        rows["quadrant.csv"] = len(flight.seeker.calibration)
    if flight.truth is not None and flight.truth.integers is not None:
        rows["integers.csv"] = len(flight.truth.integers.cycles)
    return rows


def _place(row: FloatArray) -> flight_toml.Place:
    latitude_deg, longitude_deg, height_m = row.tolist()
    return flight_toml.Place(
        latitude_deg=latitude_deg, longitude_deg=longitude_deg, height_m=height_m
    )


def _place_of_origin(origin: Origin) -> flight_toml.Place:
    return _place(
        np.array(
            [np.degrees(origin.latitude_rad), np.degrees(origin.longitude_rad), origin.height_m]
        )
    )


def _vector(value: FloatArray) -> Vector:
    x, y, z = value.tolist()
    return x, y, z


def _keys(table: type[_T], record: object, **others: Any) -> _T:  # noqa: ANN401  # values of keys
    """Return a table with others' values, and those that a record has by the same names."""
    names = (name for name in table.__struct_fields__ if name not in others)
    own = {name: getattr(record, name) for name in names if hasattr(record, name)}
    arrays = {n: _vector(value) for n, value in own.items() if isinstance(value, np.ndarray)}
    return table(**(own | arrays | others))


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
        tables.append(_keys(flight_toml.AntennaTable, antenna, observations=file_name))
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
        base = _keys(flight_toml.BaseTable, flight.base, observations="base.rnx")
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
    return _keys(
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


def _imu(flight: Flight, folder: Path) -> flight_toml.ImuTable | None:
    imu = flight.imu
    if imu is None:
        return None
    _write(
        folder / "imu.csv",
        imu.t_s,
        (columns.FORCE, imu.f_b_mps2),
        (columns.RATE, imu.w_b_radps),
    )
    noise: dict[str, Any] = {n: None if n in imu.unstated else getattr(imu, n) for n in IMU}
    return _keys(flight_toml.ImuTable, imu, samples="imu.csv", **noise)


def _fixes(flight: Flight, folder: Path) -> flight_toml.FixesTable | None:
    fixes = flight.fixes
    if fixes is None:
        return None
    velocity = None
    if fixes.v_n_mps is not None:
        velocity = velocity_of_n(flight.origin, fixes.p_n_m, fixes.v_n_mps)
    _write(
        folder / "fixes.csv",
        fixes.t_s,
        (columns.PLACE, place_of_n(flight.origin, fixes.p_n_m)),
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
    return flight_toml.FixesTable(samples="fixes.csv", antenna=fixes.antenna)


def _seeker(flight: Flight, folder: Path) -> flight_toml.SeekerTable | None:
    seeker = flight.seeker
    if seeker is None:
        return None
    _write(folder / "seeker.csv", seeker.t_s, (columns.CURRENTS, seeker.currents))
    calibration = dict(zip(columns.CALIBRATION, seeker.calibration.T, strict=True))
    write_table(folder / "quadrant.csv", calibration, columns.FORMATS)
    landmark = _place(place_of_n(flight.origin, seeker.landmark_n_m[None])[0])
    return _keys(
        flight_toml.SeekerTable,
        seeker,
        samples="seeker.csv",
        landmark=landmark,
        calibration="quadrant.csv",
    )


def _barometer(flight: Flight, folder: Path) -> flight_toml.BarometerTable | None:
    barometer = flight.barometer
    if barometer is None:
        return None
    heights_m = barometer.height_m[:, None]
    _write(folder / "barometer.csv", barometer.t_s, (columns.HEIGHT, heights_m))
    return _keys(flight_toml.BarometerTable, barometer, samples="barometer.csv")


def _magnetometer(flight: Flight, folder: Path) -> flight_toml.MagnetometerTable | None:
    sensor = flight.magnetometer
    if sensor is None:
        return None
    _write(folder / "magnetometer.csv", sensor.t_s, (columns.FIELD, sensor.field_b_ut))
    return _keys(flight_toml.MagnetometerTable, sensor, samples="magnetometer.csv")


def _vehicle(flight: Flight) -> flight_toml.VehicleTable | None:
    vehicle = flight.vehicle
    if vehicle is None:
        return None
    leaning_deg = float(np.degrees(vehicle.axes_sigma_rad))
    return _keys(flight_toml.VehicleTable, vehicle, kind="wheeled", axes_sigma_deg=leaning_deg)


def _initial(flight: Flight) -> flight_toml.InitialTable | None:
    if flight.initial is None:
        return None
    return flight_toml.InitialTable(
        **{
            f"{name.removesuffix('_rad')}_deg": float(np.degrees(value))
            for name, value in asdict(flight.initial).items()
            if value is not None
        }
    )


def _truth(flight: Flight, folder: Path) -> flight_toml.TruthTable | None:
    truth = flight.truth
    if truth is None:
        return None
    _write(
        folder / "truth.csv",
        truth.t_s,
        (columns.PLACE, place_of_n(flight.origin, truth.p_n_m)),
        (columns.VELOCITY, velocity_of_n(flight.origin, truth.p_n_m, truth.v_n_mps)),
        (columns.EULER, attitude_of_n(flight.origin, truth.p_n_m, truth.R_nb)),
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
