"""Double differences of a made-up array: true attitude, real noise, arbitrary integers."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry import rotations
from fgnav.geometry.earth import Origin
from fgnav.integers.ils.array_model import epoch_links, link_arrays, spans
from fgnav.integers.ils.float_solution import float_solution as solved_epoch
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Antenna, Flight, Truth

L1_M = 0.190293672798
E5_M = 0.254828048791

# The paper's eight antennas (section 5.1), the first as reference.
PAPER_ANTENNAS_B_M = np.array(
    [
        [0, 0, 0],
        [0, 0.1, 0],
        [0, -0.1, 0],
        [1, 0, 0],
        [-1, 0, 0],
        [-0.8, 0.1, 0.1],
        [-0.8, -0.1, 0.1],
        [-0.8, 0, -0.1],
    ]
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Made:
    """Double differences, and what made them."""

    differences: DoubleDifferences
    R_nb: FloatArray
    cycles: IntArray
    flight: Flight


def sky(rng: np.random.Generator, n: int, m: int) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors, (n, m, 3), even over the sky above 10 degrees, and elevations."""
    elevation = np.arcsin(rng.uniform(np.sin(np.radians(10.0)), 1.0, (n, m)))
    azimuth = rng.uniform(0.0, 2 * np.pi, (n, m))
    level = np.cos(elevation)
    e_n = [level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation)]
    return np.stack(e_n, axis=-1), elevation


def make(
    rng: np.random.Generator,
    *,
    epochs: int = 1,
    antennas_b_m: FloatArray = PAPER_ANTENNAS_B_M,
    satellites: tuple[int, ...] = (6,),
    code_m: float = 0.3,
    phase_m: float = 0.003,
    sine: bool = False,
    missing: BoolArray | None = None,
) -> Made:
    """Return double differences of random attitudes and skies, a group per entry of ``satellites``.

    ``missing`` marks undifferenced links, (epochs, antennas, channels); a group's reference is its
    first channel. ``sine`` lets the noise grow as 1 / sin(elevation).
    """
    n, a, m, g = epochs, len(antennas_b_m), sum(satellites), len(satellites)
    group = np.repeat(np.arange(g), satellites)
    reference = np.searchsorted(group, np.arange(g))
    e_n, elevation = sky(rng, n, m)
    R_nb = rotations.exp(rng.normal(size=(n, 3)) * np.pi / 2)
    range_m = -np.einsum("nij,aj,nmi->nam", R_nb, antennas_b_m, e_n)
    wavelength = np.where(group % 2 == 0, L1_M, E5_M)
    sigma = 1.0 / np.sin(elevation) if sine else np.ones_like(elevation)
    there = np.where(np.zeros((n, a, m), bool) if missing is None else missing, np.nan, 1.0)
    whole = rng.integers(-(10**8), 10**8, (n, a, m))

    def differenced(link: FloatArray) -> FloatArray:
        single = link[:, 1:] - link[:, :1]
        return single - single[:, :, reference[group]]

    def noisy(sigma_m: float) -> FloatArray:
        return range_m + sigma_m * sigma[:, None, :] * rng.normal(size=(n, a, m))

    cycles = differenced(whole)
    differences = DoubleDifferences(
        t_s=np.arange(float(n)),
        baselines_b_m=antennas_b_m[1:] - antennas_b_m[0],
        satellites=tuple(f"G{j + 1:02d}" for j in range(m)),
        signals=tuple("1C" for _ in range(m)),
        wavelength_m=wavelength,
        group=group,
        reference=np.tile(reference, (n, 1)),
        e_n=e_n,
        elevation_rad=elevation,
        code_m=differenced(noisy(code_m) * there),
        phase_m=differenced(noisy(phase_m) * there) + wavelength * cycles,
        code_variance_m2=(code_m * sigma) ** 2,
        phase_variance_m2=(phase_m * sigma) ** 2,
        arc=np.zeros((n, a - 1, m)),
    )
    truth = Truth(t_s=differences.t_s, p_n_m=np.zeros((n, 3)), v_n_mps=np.zeros((n, 3)), R_nb=R_nb)
    names = [Antenna(name=f"a{i + 1}", position_b_m=p) for i, p in enumerate(antennas_b_m)]
    origin = Origin(latitude_rad=0.7, longitude_rad=0.0, height_m=0.0)
    flight = Flight(name="made", start_gps_s=0.0, origin=origin, antennas=tuple(names), truth=truth)
    return Made(differences=differences, R_nb=R_nb, cycles=cycles, flight=flight)


def simulated(
    differences: DoubleDifferences, epochs: IntArray, rng: np.random.Generator
) -> DoubleDifferences:
    """Return observations as the stated noise would make them, all integers zero.

    Parameters
    ----------
    differences : DoubleDifferences
        Whose satellites, links and variances are used.
    epochs : ndarray of int, shape (k,)
        Each gives one set, at a random attitude.
    rng : numpy.random.Generator
    """
    d = differences.resampled(epochs)
    n, b, m = d.phase_m.shape
    R_nb = rotations.nearest(rng.normal(size=(n, 3, 3)))
    of_reference = d.reference[:, d.group].clip(0)[:, None, :]

    def observed(measured: FloatArray, variance: FloatArray) -> FloatArray:
        links = np.sqrt(variance)[:, None, :] * rng.normal(size=(n, b + 1, m))
        single = links[:, 1:] - links[:, :1]
        noise = single - np.take_along_axis(single, of_reference, axis=2)
        return np.asarray(np.where(np.isfinite(measured), d.array_m(R_nb) + noise, np.nan))

    return replace(
        d,
        code_m=observed(d.code_m, d.code_variance_m2),
        phase_m=observed(d.phase_m, d.phase_variance_m2),
    )


def float_solution(differences: DoubleDifferences, k: int) -> tuple[FloatArray, FloatArray]:
    """Return the float cycles of an epoch's links, (q,), and their covariance, (q, q)."""
    epochs = link_arrays(differences)
    arrays = spans(differences.baselines_b_m, epochs.resolvable.any(axis=2))
    everywhere = np.ones(len(differences.baselines_b_m), dtype=np.bool_)
    links = epoch_links(epochs.resolvable[k], epochs.of_reference[k], everywhere)
    found = solved_epoch(epochs, arrays, k, arrays.pattern[k], links, 0.0)
    return found.cycles, found.covariance


def link_covariance(
    differences: DoubleDifferences, k: int, links: BoolArray, variance_m2: FloatArray
) -> FloatArray:
    """Return the covariance, m2, of chosen double differences, (b, m), of one epoch.

    From the variances of undifferenced links, (n, m), reference channels excluded; in the order of
    ``np.nonzero(links)``.
    """
    baseline, channel = np.nonzero(links)
    variance, group = variance_m2[k], differences.group[channel]
    of_reference = differences.reference[k, group]
    same_channel = channel[:, None] == channel
    satellites = (group[:, None] == group) * variance[of_reference][:, None]
    satellites = satellites + same_channel * variance[channel]
    return np.asarray((1.0 + (baseline[:, None] == baseline)) * satellites)
