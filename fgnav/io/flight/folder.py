"""A flight as a folder: ``flight.toml`` and the files it names, read and written."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray, Unused, unused_of
from fgnav.geometry.earth import Origin
from fgnav.io.antennas import merge
from fgnav.io.atomic_write import atomic_folder
from fgnav.io.flight import networks
from fgnav.io.flight import toml as flight_toml
from fgnav.io.flight import writer as flight_writer
from fgnav.io.flight.keys import values_of
from fgnav.io.flight.series import Surroundings, read_record
from fgnav.io.flight.toml import FlightTable, GnssTable, VehicleTable
from fgnav.io.rinex.reader import read_rinex
from fgnav.io.rinex.writer import RinexVersion
from fgnav.io.sp3 import read_precise
from fgnav.io.toml_writer import write_toml
from fgnav.types.flight import Antenna, Base, Flight, GnssNoise, InitialAttitude
from fgnav.types.instruments import filled
from fgnav.types.observations import Observations
from fgnav.types.orbits import BroadcastOrbits
from fgnav.types.vehicle import FinnedVehicle, WheeledVehicle

# What is a day apart was not recorded on one flight.
_LONGEST_S = 86_400.0
# Samples that gaps may lack at a series' own rate, beyond as many as were recorded: 0.3 GB of
# rotations when they are filled.
_MOST_MISSING = 1_000_000


def load_flight(path: Path | str) -> Flight:
    """Read a flight.

    Parameters
    ----------
    path : Path or str
        The folder, or the ``flight.toml`` in it.

    Returns
    -------
    Flight
        ``unused`` counts what stands in the files and is not used.

    Raises
    ------
    BadInputError
        One line that names file, line or key, rule and value.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> len(flight.antennas), flight.imu.w_b_radps is None
    (8, True)
    """
    toml = _toml(Path(path))
    table = flight_toml.read_flight_toml(toml)
    start_gps_s = flight_toml.gps_seconds(toml, table.start)
    try:
        flight = _flight(toml.parent, table, start_gps_s)
        _check_times(flight)
        return replace(flight, unused=(*flight.unused, *_row_losses(toml, table, flight)))
    except BadInputError as error:
        if str(error).startswith(str(toml.parent)):
            raise
        raise BadInputError(f"{toml}: {error}") from error


def files_of(path: Path | str) -> tuple[Path, ...]:
    """Return the files that a flight is made of, its ``flight.toml`` first."""
    toml = _toml(Path(path))
    table = flight_toml.read_flight_toml(toml)
    names = [*(a.observations for a in table.antenna), *table.gnss.navigation, *table.gnss.orbits]
    names += [table.gnss.base.observations] if table.gnss.base else []
    names += [key.samples for key in table.sampled]
    names += [table.photodetector.calibration] if table.photodetector else []
    names += [table.truth.integers] if table.truth else []
    brought = networks.manifests(toml.parent, table.network)
    return (
        toml,
        *(toml.parent / name for name in names if name),
        *(file for manifest in brought for file in networks.files(manifest)),
    )


def save_flight(flight: Flight, folder: Path | str, *, rinex: RinexVersion = "3.04") -> None:
    """Write a flight into a new folder; it appears whole or not at all.

    Parameters
    ----------
    flight : Flight
    folder : Path or str
        Must not exist, or be empty.
    rinex : {"3.04", "4.00"}
        Version of observation and navigation files.

    Raises
    ------
    BadInputError
        If the folder holds something, or a value does not fit into its file's columns.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> fgnav.save_flight(flight, "copied", rinex="4.00")
    >>> fgnav.load_flight("copied").name
    'demo'
    """
    flight_writer.check_empty(Path(folder))
    with atomic_folder(Path(folder)) as new:
        table = flight_writer.write_parts(flight, new, rinex)
        write_toml(new / flight_writer.FILE_NAME, table)


def _toml(path: Path) -> Path:
    """Return the ``flight.toml`` of a folder, or the one named."""
    toml = path if path.suffix == ".toml" else path / flight_writer.FILE_NAME
    if not toml.is_file():
        raise BadInputError(
            f"{toml}: no such file; a flight is a folder with a {flight_writer.FILE_NAME}"
        )
    return toml


def _row_losses(toml: Path, table: FlightTable, flight: Flight) -> tuple[Unused, ...]:
    """Compare tables with the number of rows that their writer has noted; count what is missing."""
    read = flight_writer.row_counts(table, flight)
    orbits = (table.gnss.orbits, table.gnss.navigation)
    shared = {name for names in orbits if len(names) > 1 for name in names}
    counts = Counter[tuple[str, str]]()
    for name, rows in table.rows.items():
        if name in shared:
            continue
        missing = rows - read.get(name, 0)
        if missing < 0:
            raise BadInputError(
                f"{toml}: key rows.{name}: {rows} rows were written, the file holds {read[name]}; "
                "state the number that is right"
            )
        reason = "the file may be cut: rows in flight.toml has more"
        if name not in read:
            reason = "rows in flight.toml has it, no table names it"
        counts[f"{name[:80]} row", reason] += missing
    return unused_of(counts)


def _flight(folder: Path, table: FlightTable, start_gps_s: float) -> Flight:
    origin = Origin(**values_of(table.origin, Origin))
    at = Surroundings(folder, origin, tuple(antenna.name for antenna in table.antenna))
    fixes = tuple(read_record("fixes", keys, at) for keys in table.fixes)
    single = {
        kind: read_record(kind, keys, at)
        for kind in ("imu", "photodetector", "barometer", "magnetometer", "truth")
        if (keys := getattr(table, kind)) is not None
    }
    at = replace(at, fixes=fixes)
    gnss, initial = table.gnss, table.initial
    orbits = [folder / name for name in gnss.orbits]
    precise = read_precise(orbits, start_gps_s) if orbits else None
    broadcast, observations, base = _rinex(folder, table, start_gps_s)
    files = (observations, base.observations if base else None, broadcast, precise)
    return Flight(
        name=table.name,
        start_gps_s=start_gps_s,
        origin=origin,
        antennas=tuple(Antenna(**values_of(keys, Antenna)) for keys in table.antenna),
        observations=observations,
        broadcast=broadcast,
        precise=precise,
        elevation_mask_rad=np.radians(gnss.elevation_mask_deg),
        gnss_noise=_gnss_noise(gnss),
        base=base,
        fixes=fixes,
        baselines=tuple(read_record("baseline", keys, at) for keys in table.baseline),
        **single,
        vehicle=_vehicle(table.vehicle) if table.vehicle else None,
        standstill=table.vehicle is not None and table.vehicle.standstill,
        initial=InitialAttitude(**values_of(initial, InitialAttitude)) if initial else None,
        networks=networks.manifests(folder, table.network),
        unused=tuple(loss for file in files if file is not None for loss in file.unused),
    )


def _vehicle(table: VehicleTable) -> WheeledVehicle | FinnedVehicle | None:
    if table.kind is None:
        if not table.standstill:
            raise BadInputError(
                'key vehicle.kind: is missing; add "wheeled" or "finned", or state '
                "standstill = true alone"
            )
        return None
    record = WheeledVehicle if table.kind == "wheeled" else FinnedVehicle
    return record(**values_of(table, record))


def _rinex(
    folder: Path, table: FlightTable, start_gps_s: float
) -> tuple[BroadcastOrbits | None, Observations | None, Base | None]:
    """Return messages, observations of antennas, and of the base."""
    given = [antenna.observations for antenna in table.antenna if antenna.observations]
    lacking = [antenna.name for antenna in table.antenna if not antenna.observations]
    if given and lacking:
        raise BadInputError(
            f"antenna {lacking[0]}: observations must be given for all antennas or for none"
        )
    base = table.gnss.base
    if base and not given:
        raise BadInputError("key gnss.base: needs antennas with observations, there are none")
    paths = [folder / file for file in (*given, *([base.observations] if base else []))]
    messages = [folder / name for name in table.gnss.navigation]
    broadcast, receivers = read_rinex(messages, paths, start_gps_s, table.gnss.signals)
    if not given:
        return broadcast, None, None
    names = [antenna.name for antenna in table.antenna]
    observations, station = merge(receivers[: len(given)], names), None
    if base is not None:
        position_e_m = np.array(base.position_e_m)
        station = Base(position_e_m=position_e_m, observations=receivers[-1])
    return broadcast, observations, station


def _gnss_noise(gnss: GnssTable) -> GnssNoise:
    stated = {field: getattr(gnss, key) for key, field in flight_toml.GNSS_NOISE.items()}
    usual = {field: getattr(GnssNoise(), field) for field in stated}
    return GnssNoise(**filled(stated, usual), **values_of(gnss, GnssNoise))


def _check_times(flight: Flight) -> None:
    """Raise where a series has a gap, or lies apart from the GNSS record, as no flight's does."""
    series = {name: record.t_s for name, record in flight.records.items()}
    if flight.observations is not None:
        series["observations"] = flight.observations.t_s
    for name, t_s in series.items():
        _check_gaps(name, t_s)
    gnss = next((name for name in series if name.startswith("fixes")), "")
    gnss = "observations" if flight.observations is not None else gnss
    if not gnss:
        return
    first_s, last_s = series[gnss][[0, -1]]
    for name, t_s in series.items():
        separation_s = max(float(first_s - t_s[-1]), float(t_s[0] - last_s))
        if separation_s > _LONGEST_S:
            span = f"{first_s:.9g} to {last_s:.9g} s"
            raise BadInputError(
                f"{name}: times from {t_s[0]:.9g} to {t_s[-1]:.9g} s lie {separation_s:.9g} s "
                f"apart from those of {gnss}, {span}; look at start, and at the week number"
            )


def _check_gaps(name: str, t_s: FloatArray) -> None:
    step_s = np.diff(t_s)
    if not len(step_s):
        return
    usual_s = float(np.median(step_s))
    missing = (t_s[-1] - t_s[0]) / usual_s - len(step_s)
    k = int(np.argmax(step_s))
    if step_s[k] > _LONGEST_S or missing > max(len(t_s), _MOST_MISSING):
        raise BadInputError(
            f"{name}: row {k + 2} of the samples has {t_s[k + 1]:.9g} s after {t_s[k]:.9g} s, a "
            f"gap of {missing:.3g} samples of {usual_s:.3g} s in all; mend the time stamp, or "
            "split the flight there"
        )
