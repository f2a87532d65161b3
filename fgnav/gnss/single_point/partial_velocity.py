"""Epochs with too few satellites for a position: the directions of velocity that Doppler tells.

Two satellites tell velocity along one direction, three along two, once the epoch's clock drift is
eliminated.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.earth import C_MPS
from fgnav.gnss.orbits.satellites import angles, signal_paths
from fgnav.gnss.single_differences import motion_so_far
from fgnav.gnss.single_point.adjustment import growing
from fgnav.gnss.single_point.model import code_channels, code_ranges
from fgnav.types.flight import Flight

_OPEN = 1e-4  # s2/m2: known to 100 m/s, a direction might as well be open
_ROUNDING = 1e-9  # of the largest eigenvalue
_FALSE_ALARM = 1e-4


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class PartialVelocity:
    """Velocities known in some directions."""

    t_s: FloatArray  # (k,): nominal epochs
    v_n_mps: FloatArray  # (k, 3): one of the vectors that agree with what is known
    # ``root @ (true - v_n_mps)`` is white with unit variance; rows of zeros for what is open.
    root: FloatArray  # (k, 3, 3)
    refused: int  # epochs left out because their measurements contradict each other


def partial_velocities(
    flight: Flight, solved_s: FloatArray, *, causal: bool = False
) -> PartialVelocity:
    """Estimate the first antenna's velocity by Dopplers at epochs without a position.

    Parameters
    ----------
    solved_s : ndarray, shape (k,)
        Epochs with a position.
    causal : bool
        Whether channels are those first seen.
    """
    observations = flight.observations
    none = PartialVelocity(
        t_s=np.empty(0), v_n_mps=np.empty((0, 3)), root=np.empty((0, 3, 3)), refused=0
    )
    if observations is None or len(solved_s) == len(observations.t_s):
        return none
    p_e_m, _ = motion_so_far(flight, observations.t_s)
    has_position = np.asarray(np.isfinite(p_e_m).all(axis=1))
    epochs = np.flatnonzero(has_position & ~np.isin(observations.t_s, solved_s))
    channels = code_channels(observations, 0, causal=causal)
    if not (len(epochs) and channels.satellites):
        return none
    ranges = code_ranges(flight, observations, channels, 0, epochs)
    paths = signal_paths(ranges.states, p_e_m[epochs], np.zeros((len(epochs), 3)))
    elevation_rad = angles(p_e_m[epochs], paths.e_e)[0]
    y = ranges.rate_mps - paths.range_rate_mps
    use = np.isfinite(ranges.range_m) & np.isfinite(y)
    use &= elevation_rad >= flight.elevation_mask_rad
    sigma_mps = growing(flight.gnss_noise, flight.gnss_noise.doppler_mps, elevation_rad)
    A = -(paths.e_e @ flight.origin.R_ne.T) * (1 - paths.range_rate_mps / C_MPS)[:, :, None]
    v_n_mps, root, sound = _without_drift(A, y, sigma_mps, use)
    valid = sound & root.any(axis=(1, 2))
    return PartialVelocity(
        t_s=observations.t_s[epochs][valid],
        v_n_mps=v_n_mps[valid],
        root=root[valid],
        refused=int((~sound).sum()),
    )


def _without_drift(
    A: FloatArray, y: FloatArray, sigma: FloatArray, use: BoolArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return values, roots, (k, 3, 3), and whether the measurements, (k, m), agree."""
    weight = np.where(use, 1 / np.where(use, sigma, 1.0) ** 2, 0.0)
    A, y = np.where(use[:, :, None], A, 0.0), np.where(use, y, 0.0)
    total = weight.sum(axis=1, keepdims=True).clip(1e-300)
    A = np.where(use[:, :, None], A - (weight / total)[:, None] @ A, 0.0)
    y = np.where(use, y - (weight * y).sum(axis=1, keepdims=True) / total, 0.0)
    weighted = np.swapaxes(A * weight[:, :, None], 1, 2)
    values, axes = np.linalg.eigh(weighted @ A)
    kept = values > np.maximum(_OPEN, _ROUNDING * values[:, -1:])
    root = np.where(kept, np.sqrt(values.clip(0)), 0.0)[:, :, None] * axes.swapaxes(1, 2)
    inverse = np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)
    right = np.einsum("kim,km->ki", weighted, y)
    value = np.einsum("kij,kj,klj,kl->ki", axes, inverse, axes, right)
    explained = np.einsum("kij,kj->ki", root, value)
    squares = (weight * y**2).sum(axis=1) - (explained**2).sum(axis=1)
    freedom = use.sum(axis=1) - 1 - kept.sum(axis=1)
    from scipy.special import chdtri  # noqa: PLC0415  # lazy: keeps the command line quick

    return value, root, (freedom <= 0) | (squares <= chdtri(freedom.clip(1), _FALSE_ALARM))
