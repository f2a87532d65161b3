"""Synthetic double differences whose attitude and integers are known."""

import numpy as np

from fgnav.types.differences import DoubleDifferences
from fgnav.types.integers import Integers
from tests.integers.arrays import L1_M, PAPER_ANTENNAS_B_M


def sky(channels, rng):
    """Unit vectors spread over the sky above 15 degrees."""
    z = rng.uniform(np.sin(np.radians(15)), 1, channels)
    azimuth = rng.uniform(0, 2 * np.pi, channels)
    level = np.sqrt(1 - z**2)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), -z], axis=1)


def synthetic(
    R_nb,
    e_n,
    rng,
    *,
    antennas_b_m=PAPER_ANTENNAS_B_M,
    group=None,
    phase_m=0.003,
    code_m=0.3,
    sine=False,
    missing=0.0,
    noise=1.0,
):
    """Double differences and their true integers at attitudes R_nb of satellites e_n.

    Of errors there is a share ``noise`` of what is stated.
    """
    n, m, a = len(R_nb), np.shape(e_n)[-2], len(antennas_b_m)
    group = np.zeros(m, dtype=int) if group is None else np.asarray(group)
    e_n = np.broadcast_to(e_n, (n, m, 3))
    scale = 1 / -e_n[..., 2] if sine else np.ones((n, m))
    ranges_m = -np.einsum("nmi,nij,aj->nam", e_n, R_nb, antennas_b_m - antennas_b_m[0])
    integers = rng.integers(-1000, 1000, (a, m)) * np.ones((n, 1, 1), dtype=int)
    error = noise * scale[:, None] * rng.standard_normal((2, n, a, m))
    phase = ranges_m + integers * L1_M + phase_m * error[0]
    code = ranges_m + code_m * error[1]
    first = np.array([np.flatnonzero(group == g)[0] for g in range(group.max() + 1)])
    gone = rng.random((n, a, m)) < missing
    gone[:, 0] = False
    gone[:, :, first] = False

    def differenced(x):
        x = x[:, 1:] - x[:, :1]
        return x - x[:, :, first[group]]

    differences = DoubleDifferences(
        t_s=0.1 * np.arange(n),
        baselines_b_m=antennas_b_m[1:] - antennas_b_m[0],
        satellites=tuple(f"G{j + 1:02d}" for j in range(m)),
        signals=("1C",) * m,
        wavelength_m=np.full(m, L1_M),
        group=group,
        reference=np.broadcast_to(first, (n, len(first))),
        e_n=e_n,
        elevation_rad=np.arcsin(-e_n[..., 2]),
        code_m=np.where(gone[:, 1:], np.nan, differenced(code)),
        phase_m=np.where(gone[:, 1:], np.nan, differenced(phase)),
        code_variance_m2=(code_m * scale) ** 2,
        phase_variance_m2=(phase_m * scale) ** 2,
        arc=np.zeros((n, a - 1, m), dtype=int),
    )
    true = Integers(
        resolver="truth",
        cycles=np.where(differences.resolvable, differenced(integers), 0),
        fixed=differences.resolvable,
        ratio=np.full((n, a - 1), np.nan),
    )
    return differences, true
