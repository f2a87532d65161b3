"""Whether a stream's memory is flat: an hour of epochs made as they are needed, in a process.

A body that hovers while all its angles swing; ten epochs a second with three vectors known in the
body, a position and a velocity of the antenna, ten samples of the accelerometer. Nothing of it is
kept here. ``SMOOTHER_MEMORY_S`` in the environment states other marks, "60,360", in seconds.
"""

import multiprocessing
import os
import resource
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from time import process_time

import numpy as np

from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import from_euler
from fgnav.methods.stream import Measured, Measurements, Stream, StreamConfig
from fgnav.process.hyperparameters import RatePrior
from fgnav.types.flight import Imu
from tests.benchmarks._rows import Row, row

NAMES = ("smoother_memory_hour",)
RATE_HZ, SAMPLE_S = 10, 0.01
MARKS_S = tuple(int(s) for s in os.environ.get("SMOOTHER_MEMORY_S", "600,3600").split(","))
ORIGIN = Origin(latitude_rad=0.7, longitude_rad=-0.07, height_m=700.0)
# Of angles that swing by 20 degrees at 1 rad/s.
PRIOR = RatePrior(length_s=2.0, variance_rad2ps2=np.full(3, 0.3**2), evidence=float("nan"))
SET_UP = StreamConfig(origin=ORIGIN, antenna_b_m=np.zeros(3), rate_prior=PRIOR)
FORCE_SIGMA_MPS2, VECTOR_SIGMA, POSITION_SIGMA_M, VELOCITY_SIGMA_MPS = 0.01, 0.01, 0.5, 0.05


def run() -> list[Row]:
    """Return the row."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        run_through = pool.submit(streamed).result()
    first, last = run_through.peaks_mb
    note = (
        f"peak resident memory of a process by {MARKS_S[1] / 60:g} minutes of a stream, lag 2 s; "
        f"peer: by {MARKS_S[0] / 60:g} minutes; {run_through.seconds_per_second:.0f} x real time, "
        "epochs made up included"
    )
    return [row("smoother_memory_hour", last, first, "MB", note, less=True)]


@dataclass(frozen=True)
class Streamed:
    """Peaks of memory at the marks, MB; and flight seconds per second of one core."""

    peaks_mb: tuple[float, ...]
    seconds_per_second: float


def streamed() -> Streamed:
    """Feed a stream for as long as the last mark says."""
    rng, started_s, peaks_mb = np.random.default_rng(1), process_time(), []
    stream = Stream(SET_UP, lag_s=2.0)
    for k in range(1, MARKS_S[-1] * RATE_HZ + 1):
        stream.update(measurements(k / RATE_HZ, rng))
        if k % RATE_HZ == 0 and k // RATE_HZ in MARKS_S:
            peaks_mb.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    return Streamed(tuple(peaks_mb), MARKS_S[-1] / (process_time() - started_s))


def measurements(t_s: float, rng: np.random.Generator) -> Measurements:
    """Return what came in up to an epoch."""
    R_nb, zero = attitudes(np.array([t_s])), np.zeros(3)
    samples_s = np.arange(round((t_s - 0.2) / SAMPLE_S), round((t_s + 0.1) / SAMPLE_S)) * SAMPLE_S
    felt = -np.einsum("nji,j->ni", attitudes(samples_s), ORIGIN.gravity_n_mps2(zero[None])[0])
    imu = Imu(
        t_s=samples_s,
        f_b_mps2=felt + FORCE_SIGMA_MPS2 * rng.standard_normal(felt.shape),
        position_b_m=zero,
        accelerometer_noise_mps2_per_sqrt_hz=FORCE_SIGMA_MPS2 * SAMPLE_S**0.5,
        accelerometer_bias_mps2=0.03,
        accelerometer_bias_walk_mps2_per_sqrt_s=1e-4,
    )
    v_n = np.eye(3)
    v_b = v_n @ R_nb[0] + VECTOR_SIGMA * rng.standard_normal((3, 3))
    pairs = (
        RotationQuadratic.of_vector_pairs(n[None], b[None], VECTOR_SIGMA**2 * np.eye(3)[None])
        for n, b in zip(v_n, v_b, strict=True)
    )
    first, second, third = pairs
    return Measurements(
        t_s=t_s,
        imu=imu,
        array=first + second + third,
        position=measured(POSITION_SIGMA_M, rng),
        velocity=measured(VELOCITY_SIGMA_MPS, rng),
    )


def measured(sigma: float, rng: np.random.Generator) -> Measured:
    """Return zero, with noise."""
    return Measured(value=sigma * rng.standard_normal(3), covariance=sigma**2 * np.eye(3))


def attitudes(t_s: np.ndarray) -> np.ndarray:
    """Return how the body swings, (n, 3, 3)."""
    angle_rad = np.radians(20.0) * np.sin(t_s)
    return from_euler(angle_rad, angle_rad, angle_rad)
