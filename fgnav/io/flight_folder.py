"""A flight as a folder: ``flight.toml`` and the files it names, read and written."""

from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray, Loss
from fgnav.earth import Origin
from fgnav.flight import Antenna, Base, Fixes, Flight, GnssNoise, Imu, Seeker, Truth
from fgnav.io import flight_toml, flight_writer
from fgnav.io.antennas import chosen, merge, named_alike
from fgnav.io.columns import (
    CALIBRATION,
    CURRENTS,
    EULER,
    FIELD,
    FORCE,
    HEIGHT,
    PLACE,
    POSITION_SIGMA,
    RATE,
    VELOCITY,
    VELOCITY_SIGMA,
)
from fgnav.io.flight_integers import read_integers
from fgnav.io.flight_toml import (
    BarometerTable,
    FixesTable,
    FlightTable,
    GnssTable,
    ImuTable,
    MagnetometerTable,
    SeekerTable,
    TruthTable,
)
from fgnav.io.local_frame import attitude_to_n, columns_to_vectors, place_to_n, velocity_to_n
from fgnav.io.rinex import read_rinex
from fgnav.io.rinex_writer import RinexVersion
from fgnav.io.sp3 import read_precise
from fgnav.io.tables import read_table
from fgnav.observations import Observations
from fgnav.orbits import BroadcastOrbits
from fgnav.surroundings import Barometer, Magnetometer

# What a receiver's own solution is good for where the file does not say: a single-frequency code
# solution under open sky.
DEFAULT_POSITION_SIGMA_M = (3.0, 3.0, 5.0)
DEFAULT_VELOCITY_SIGMA_MPS = (0.1, 0.1, 0.1)


def load_flight(path: Path | str) -> Flight:
    """Read a flight.

    Parameters
    ----------
    path : Path or str
        The folder, or the ``flight.toml`` in it.

    Returns
    -------
    Flight
        ``losses`` counts what stands in the files and is not used.

    Raises
    ------
    BadInputError
        One line that names file, line or key, rule and value.
    """
    path = Path(path)
    toml = path if path.suffix == ".toml" else path / flight_writer.FILE_NAME
    if not toml.is_file():
        raise BadInputError(
            f"{toml}: no such file; a flight is a folder with a {flight_writer.FILE_NAME}"
        )
    table = flight_toml.read_flight_toml(toml)
    start_gps_s = flight_toml.gps_seconds(toml, table.start)
    try:
        return _flight(toml.parent, table, start_gps_s)
    except BadInputError as error:
        if str(error).startswith(str(toml.parent)):
            raise
        raise BadInputError(f"{toml}: {error}") from error


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
    """
    flight_writer.write_folder(flight, Path(folder), rinex)


def _flight(folder: Path, table: FlightTable, start_gps_s: float) -> Flight:
    origin = Origin(
        latitude_rad=np.radians(table.origin.latitude_deg),
        longitude_rad=np.radians(table.origin.longitude_deg),
        height_m=table.origin.height_m,
    )
    gnss = table.gnss
    orbits = [folder / name for name in gnss.orbits]
    precise = read_precise(orbits, start_gps_s) if orbits else None
    broadcast, observations, base = _rinex(folder, table, start_gps_s)
    losses: list[Loss] = []
    for part in (observations, base.observations if base else None, broadcast, precise):
        losses += part.losses if part is not None else ()
    return Flight(
        name=table.name,
        start_gps_s=start_gps_s,
        origin=origin,
        antennas=tuple(
            Antenna(name=a.name, position_b_m=np.array(a.position_b_m)) for a in table.antenna
        ),
        observations=observations,
        broadcast=broadcast,
        precise=precise,
        elevation_mask_rad=np.radians(gnss.elevation_mask_deg),
        gnss_noise=_gnss_noise(gnss),
        base=base,
        imu=_imu(folder, table.imu) if table.imu else None,
        fixes=_fixes(folder, origin, table.fixes) if table.fixes else None,
        seeker=_seeker(folder, origin, table.seeker) if table.seeker else None,
        barometer=_barometer(folder, table.barometer) if table.barometer else None,
        magnetometer=_magnetometer(folder, table.magnetometer) if table.magnetometer else None,
        truth=_truth(folder, origin, table.truth, [a.name for a in table.antenna])
        if table.truth
        else None,
        losses=tuple(losses),
    )


def _rinex(
    folder: Path, table: FlightTable, start_gps_s: float
) -> tuple[BroadcastOrbits | None, Observations | None, Base | None]:
    """Return messages, observations of antennas, and of the base with its signals named alike."""
    names = [antenna.name for antenna in table.antenna]
    files = [antenna.observations for antenna in table.antenna if antenna.observations]
    if files and len(files) < len(names):
        lacking = next(antenna.name for antenna in table.antenna if not antenna.observations)
        raise BadInputError(
            f"antenna {lacking}: observations must be given for all antennas or for none"
        )
    base = table.gnss.base
    paths = [folder / name for name in (*files, *([base.observations] if base else []))]
    if base and not files:
        raise BadInputError("key gnss.base: needs antennas with observations, there are none")
    messages = [folder / name for name in table.gnss.navigation]
    broadcast, receivers = read_rinex(messages, paths, start_gps_s)
    if not files:
        return broadcast, None, None
    observations = merge(receivers[: len(files)], names)
    if table.gnss.signals:
        observations = chosen(observations, table.gnss.signals)
    if base is None:
        return broadcast, observations, None
    position_e_m = np.array(base.position_e_m)
    return (
        broadcast,
        observations,
        Base(position_e_m=position_e_m, observations=named_alike(receivers[-1], observations)),
    )


def _gnss_noise(gnss: GnssTable) -> GnssNoise:
    return GnssNoise(
        code_m=gnss.code_noise_m,
        phase_m=gnss.phase_noise_m,
        doppler_mps=gnss.doppler_noise_mps,
        elevation_weights=gnss.elevation_weights,
    )


def _imu(folder: Path, table: ImuTable) -> Imu:
    samples = read_table(folder / table.samples, ("t_s", *FORCE), (RATE,))
    return Imu(
        t_s=samples["t_s"],
        f_b_mps2=columns_to_vectors(samples, FORCE),
        w_b_radps=columns_to_vectors(samples, RATE) if RATE[0] in samples else None,
        position_b_m=np.array(table.position_b_m),
        accelerometer_noise_mps2_per_sqrt_hz=table.accelerometer_noise_mps2_per_sqrt_hz,
        accelerometer_bias_mps2=table.accelerometer_bias_mps2,
        accelerometer_bias_walk_mps2_per_sqrt_s=table.accelerometer_bias_walk_mps2_per_sqrt_s,
        gyroscope_noise_radps_per_sqrt_hz=table.gyroscope_noise_radps_per_sqrt_hz,
        gyroscope_bias_radps=table.gyroscope_bias_radps,
        gyroscope_bias_walk_radps_per_sqrt_s=table.gyroscope_bias_walk_radps_per_sqrt_s,
    )


def _fixes(folder: Path, origin: Origin, table: FixesTable) -> Fixes:
    """Read fixes; standard deviations stay as they are, since the axes differ by 0.02 deg."""
    optional = (VELOCITY, POSITION_SIGMA, VELOCITY_SIGMA)
    samples = read_table(folder / table.samples, ("t_s", *PLACE), optional)
    p_n_m = place_to_n(origin, columns_to_vectors(samples, PLACE))
    if VELOCITY_SIGMA[0] in samples and VELOCITY[0] not in samples:
        raise BadInputError(
            f"{folder / table.samples}: line 1: {VELOCITY_SIGMA[0]} needs {', '.join(VELOCITY)}"
        )
    v_n_mps = velocity_sigma_mps = None
    if VELOCITY[0] in samples:
        v_n_mps = velocity_to_n(origin, p_n_m, columns_to_vectors(samples, VELOCITY))
        velocity_sigma_mps = _sigma(samples, VELOCITY_SIGMA, DEFAULT_VELOCITY_SIGMA_MPS)
    return Fixes(
        t_s=samples["t_s"],
        antenna=table.antenna,
        p_n_m=p_n_m,
        v_n_mps=v_n_mps,
        position_sigma_m=_sigma(samples, POSITION_SIGMA, DEFAULT_POSITION_SIGMA_M),
        velocity_sigma_mps=velocity_sigma_mps,
    )


def _sigma(
    samples: dict[str, FloatArray], names: tuple[str, ...], default: tuple[float, ...]
) -> FloatArray:
    if names[0] in samples:
        return columns_to_vectors(samples, names)
    return np.tile(np.array(default), (len(samples["t_s"]), 1))


def _seeker(folder: Path, origin: Origin, table: SeekerTable) -> Seeker:
    samples = read_table(folder / table.samples, ("t_s", *CURRENTS))
    calibration = read_table(folder / table.calibration, CALIBRATION, increasing=CALIBRATION[0])
    landmark = table.landmark
    place = np.array([[landmark.latitude_deg, landmark.longitude_deg, landmark.height_m]])
    return Seeker(
        t_s=samples["t_s"],
        currents=columns_to_vectors(samples, CURRENTS),
        position_b_m=np.array(table.position_b_m),
        landmark_n_m=place_to_n(origin, place)[0],
        detector_radius_m=table.detector_radius_m,
        focal_length_m=table.focal_length_m,
        calibration=columns_to_vectors(calibration, CALIBRATION),
    )


def _barometer(folder: Path, table: BarometerTable) -> Barometer:
    samples = read_table(folder / table.samples, ("t_s", *HEIGHT))
    return Barometer(
        t_s=samples["t_s"],
        height_m=samples[HEIGHT[0]],
        position_b_m=np.array(table.position_b_m),
        noise_m=table.noise_m,
        offset_m=table.offset_m,
        wander_m=table.wander_m,
        wander_time_s=table.wander_time_s,
    )


def _magnetometer(folder: Path, table: MagnetometerTable) -> Magnetometer:
    samples = read_table(folder / table.samples, ("t_s", *FIELD))
    return Magnetometer(
        t_s=samples["t_s"],
        field_b_ut=columns_to_vectors(samples, FIELD),
        field_n_ut=np.array(table.field_n_ut),
        noise_ut=table.noise_ut,
        hard_iron_ut=table.hard_iron_ut,
    )


def _truth(folder: Path, origin: Origin, table: TruthTable, names: list[str]) -> Truth:
    integers = read_integers(folder / table.integers) if table.integers else None
    for name in sorted(set(integers.antennas) - set(names) if integers is not None else ()):
        raise BadInputError(
            f"{folder / str(table.integers)}: true integers antenna: {name!r} is not one of {names}"
        )
    samples = read_table(folder / table.samples, ("t_s", *PLACE, *VELOCITY, *EULER))
    p_n_m = place_to_n(origin, columns_to_vectors(samples, PLACE))
    return Truth(
        t_s=samples["t_s"],
        p_n_m=p_n_m,
        v_n_mps=velocity_to_n(origin, p_n_m, columns_to_vectors(samples, VELOCITY)),
        R_nb=attitude_to_n(origin, p_n_m, columns_to_vectors(samples, EULER)),
        integers=integers,
    )
