"""A small flight with everything a folder can hold."""

import numpy as np

from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import from_euler
from fgnav.types.flight import (
    Antenna,
    Base,
    Baseline,
    Fixes,
    Flight,
    GnssNoise,
    LinkIntegers,
    Photodetector,
    Truth,
)
from fgnav.types.observations import Observations
from fgnav.types.orbits import EPHEMERIS_DTYPE, BroadcastOrbits, PreciseOrbits
from fgnav.types.surroundings import Barometer, Magnetometer
from tests.imu import imu_of

START_GPS_S = 1_277_078_400.0  # 2020-06-25, second 345600 of GPS week 2111
ORIGIN = Origin(latitude_rad=np.radians(78.0), longitude_rad=np.radians(-3.9), height_m=700.0)
CHANNELS = (
    ("C11", "2I"),
    ("E07", "1X"),
    ("E07", "5X"),
    ("G05", "1C"),
    ("G05", "2W"),
    ("J02", "1C"),
)


def observations(rng: np.random.Generator, antennas: int = 3, epochs: int = 5) -> Observations:
    """Return values on the grid of RINEX's digits, with gaps, flags and clock errors."""
    shape = (epochs, antennas, len(CHANNELS))
    code_m = rng.uniform(2e7, 2.6e7, shape).round(3)
    phase_cycles = rng.uniform(-1e8, 1.4e8, shape).round(3)
    for value in (code_m, phase_cycles):
        value[rng.random(shape) < 0.1] = np.nan
    t_s = 0.1 * np.arange(epochs)
    return Observations(
        t_s=t_s,
        tag_s=t_s[:, None] + rng.uniform(-1e-3, 1e-3, (epochs, antennas)).round(7),
        satellites=tuple(satellite for satellite, _ in CHANNELS),
        signals=tuple(signal for _, signal in CHANNELS),
        code_m=code_m,
        phase_cycles=phase_cycles,
        doppler_hz=rng.uniform(-4000, 4000, shape).round(3),
        cn0_dbhz=rng.uniform(20, 55, shape).round(2),
        lock_flags=rng.integers(0, 4, shape) * (rng.random(shape) < 0.2),
    )


def broadcast() -> BroadcastOrbits:
    """Return one message of each constellation, with times as they are sent."""
    records = np.zeros(4, EPHEMERIS_DTYPE)
    records["satellite"] = ["C11", "E07", "G05", "J02"]
    records["toe_s"] = records["toc_s"] = [14.0, 600.0, 7200.0, -3600.0]
    records["transmission_s"] = [20.0, 600.0, 30.0, -3600.0]
    records["toe_sow_s"] = [345_600.0, 346_200.0, 352_800.0, 342_000.0]
    for k, name in enumerate(EPHEMERIS_DTYPE.names[5:23]):
        records[name] = [(k + j + 1) / 1024 for j in range(4)]
    records["semi_major_axis_m"] = [27_906_100.0, 29_600_000.0, 26_560_000.0, 42_164_000.0]
    records["eccentricity"] = 0.125
    records["group_delay_s"] = [[1e-9, 2e-9], [3e-9, 4e-9], [5e-9, 0], [6e-9, 0]]
    records["issue"], records["health"] = [1, 30, 55, 7], [0, 0, 0, 1]
    records["accuracy_m"], records["data_source"] = [2.4, 3.12, 3.4, 2.4], [0, 517, 0, 0]
    return BroadcastOrbits(records=records, klobuchar=np.arange(8) * 1e-8)


def _baselines(t_s: np.ndarray, rng: np.random.Generator) -> tuple[Baseline, ...]:
    """Return one of each kind: with its covariance, of angles and their sigmas, and usual ones."""
    vectors = rng.normal(0, 1, (3, len(t_s), 3))
    vectors[2, :, 2] = 0.0
    vectors[1:] /= np.linalg.norm(vectors[1:], axis=2, keepdims=True)
    root, sigma = rng.normal(0, 0.02, (len(t_s), 3, 3)), rng.uniform(0.001, 0.01, len(t_s))
    full, even = root @ root.swapaxes(1, 2), sigma[:, None, None] ** 2 * np.eye(3)
    kinds = zip(
        (("a1", "base"), ("base", "a1"), ("base", "näs/1")),
        vectors,
        (full, even, even),
        ("vector", "direction", "heading"),
        strict=True,
    )
    return tuple(
        Baseline(t_s=t_s, antennas=names, vector_n_m=v, covariance_m2=P, measured=measured)
        for names, v, P, measured in kinds
    )


def whole_flight(rng: np.random.Generator) -> Flight:
    """Return a flight with every optional part."""
    k = 7
    t_s = 0.25 * np.arange(k)
    p_n_m = rng.normal(0, 2000, (k, 3))
    currents = rng.uniform(0.1, 1.0, (k, 4))
    base = observations(rng, antennas=1)
    antennas = tuple(
        Antenna(name=name, position_b_m=rng.normal(0, 1, 3)) for name in ("a1", "base", "näs/1")
    )
    return Flight(
        name='All of it, "quoted"\n',
        start_gps_s=START_GPS_S,
        origin=ORIGIN,
        antennas=antennas,
        observations=observations(rng),
        broadcast=broadcast(),
        precise=PreciseOrbits(
            t_s=300.0 * np.arange(3),
            satellites=("E07", "G05"),
            p_e_m=rng.normal(0, 2e7, (3, 2, 3)).round(3),
            clock_s=rng.normal(0, 1e-4, (3, 2)).round(12),
        ),
        elevation_mask_rad=np.radians(12.5),
        gnss_noise=GnssNoise(
            code_m=0.7, phase_m=0.002, doppler_mps=0.1, elevation_weights="uniform"
        ),
        base=Base(position_e_m=np.array([4e6, 1e6, 4.8e6]), observations=base),
        imu=imu_of(
            t_s,
            rng.normal(0, 10, (k, 3)),
            rng.normal(0, 1, (k, 3)),
            gyroscope=(1e-4, 1e-3, 1e-5),
            position_b_m=np.array([0.1, -0.2, 0.3]),
        ),
        fixes=tuple(
            Fixes(
                t_s=t_s,
                antenna=name,
                p_n_m=p_n_m,
                v_n_mps=rng.normal(0, 100, (k, 3)),
                position_sigma_m=rng.uniform(1, 5, (k, 3)),
                velocity_sigma_mps=rng.uniform(0.1, 0.2, (k, 3)),
            )
            for name in ("a1", "näs/1")
        ),
        baselines=_baselines(t_s, rng),
        photodetector=Photodetector(
            t_s=t_s,
            currents=currents,
            position_b_m=np.array([1.0, 0.0, 0.0]),
            landmark_n_m=np.array([5000.0, 3000.0, 10.0]),
            detector_radius_m=5e-3,
            focal_length_m=2e-2,
            calibration=np.array([[0.0, 0.0], [1.0, 0.3], [2.0, 0.7]]),
        ),
        barometer=Barometer(
            t_s=t_s,
            height_m=np.linspace(700, 720, k) + 1 / 3,
            position_b_m=np.array([0.5, 0.0, -0.1]),
            noise_m=0.4,
            offset_m=25.0,
            wander_m=1.5,
            wander_time_s=120.0,
        ),
        magnetometer=Magnetometer(
            t_s=t_s,
            field_b_ut=np.outer(np.linspace(1, 2, k), [20.0, -3.0, 40.0]) / 3,
            field_n_ut=np.array([25.8, -0.2, 36.6]),
            noise_ut=0.25,
            hard_iron_ut=3.0,
        ),
        truth=Truth(
            t_s=t_s,
            p_n_m=p_n_m,
            v_n_mps=rng.normal(0, 100, (k, 3)),
            R_nb=from_euler(*rng.uniform(-1.4, 1.4, (3, k))),
            source="filter",
            position_sigma_m=rng.uniform(0.1, 2.0, (k, 3)),
            velocity_sigma_mps=rng.uniform(0.1, 2.0, (k, 3)),
            euler_sigma_rad=rng.uniform(0.001, 0.1, (k, 3)),
            integers=LinkIntegers(
                antennas=("a1", "näs/1", "a1"),
                satellites=("G05", "E07", "G05"),
                signals=("1C", "5X", "1C"),
                from_s=np.array([0.0, 0.1, 1 / 3]),
                cycles=np.array([-(10**9), 7, 10**15]),
            ),
        ),
    )
