"""Epochs with too few satellites for a position: what two or three of them say all the same.

Two satellites tell position, or velocity, along one direction, three along two, once each epoch's
clock is eliminated. Phases whose arcs reach back to full epochs say so to millimetres: the
constants of the arcs are known from there.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.earth import C_MPS
from fgnav.flight import Flight
from fgnav.gnss.arc_solution import ArcAdjustment
from fgnav.gnss.code_adjustment import growing
from fgnav.gnss.code_model import code_channels, code_ranges
from fgnav.gnss.satellites import angles, signal_paths
from fgnav.gnss.single_differences import reference_motion

_OPEN = 1e-4  # 1/m2 or s2/m2: known to 100 m or m/s, a direction might as well be open
_ROUNDING = 1e-9  # of the largest eigenvalue
_FALSE_ALARM = 1e-4


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Partial:
    """Vectors known in some directions.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
        Nominal epochs.
    value : ndarray, shape (k, 3)
        One of the vectors that agree with what is known.
    root : ndarray, shape (k, 3, 3)
        ``root @ (true - value)`` is white with unit variance; rows of zeros for what is open.
    refused : int
        Epochs left out because their measurements contradict each other.
    """

    t_s: FloatArray
    value: FloatArray
    root: FloatArray
    refused: int = 0

    def __getitem__(self, rows: IntArray | BoolArray) -> "Partial":
        """Return what is known at some of the times."""
        return Partial(
            t_s=self.t_s[rows],
            value=self.value[rows],
            root=self.root[rows],
            refused=self.refused,
        )

    def with_noise(self, covariance: FloatArray) -> "Partial":
        """Return the same with noise added, its covariance (k, 3, 3) or (3, 3)."""
        spread = np.eye(3) + self.root @ covariance @ self.root.swapaxes(1, 2)
        root = np.linalg.solve(np.linalg.cholesky(spread), self.root)
        return Partial(t_s=self.t_s, value=self.value, root=root, refused=self.refused)


@dataclass(frozen=True, eq=False, slots=True)
class _Reduced:
    value: FloatArray  # (k, 3)
    root: FloatArray  # (k, 3, 3)
    gain: FloatArray  # (k, 3, m): value = gain @ y
    sound: BoolArray  # (k,): the measurements do not contradict each other


def _reduced(A: FloatArray, y: FloatArray, weight: FloatArray) -> _Reduced:
    """Eliminate the clocks of each epoch; keep the directions that are left.

    Parameters
    ----------
    A : ndarray, shape (k, m, 3 + c)
        A measurement has one clock.
    y, weight : ndarray, shape (k, m)
    """
    weighted = np.swapaxes(A * weight[:, :, None], 1, 2)  # (k, p, m)
    N = weighted @ A
    own = np.einsum("kcc->kc", N[:, 3:, 3:])
    share = N[:, :3, 3:] * np.where(own > 0, 1 / np.where(own > 0, own, 1.0), 0.0)[:, None]
    N_v, G = N[:, :3, :3] - share @ N[:, 3:, :3], weighted[:, :3] - share @ weighted[:, 3:]
    values, axes = np.linalg.eigh(N_v)
    kept = values > np.maximum(_OPEN, _ROUNDING * values[:, -1:])
    root = np.where(kept, np.sqrt(values.clip(0)), 0.0)[:, :, None] * axes.swapaxes(1, 2)
    inverse = np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)
    gain = (axes * inverse[:, None]) @ axes.swapaxes(1, 2) @ G
    value = np.einsum("kim,km->ki", gain, y)
    left = np.einsum("kpm,km->kp", weighted[:, 3:], y)
    clocks = np.where(own > 0, left**2 / np.where(own > 0, own, 1.0), 0.0).sum(axis=1)
    explained = np.einsum("kij,kj->ki", root, value)
    squares = (weight * y**2).sum(axis=1) - clocks - (explained**2).sum(axis=1)
    freedom = (weight > 0).sum(axis=1) - (own > 0).sum(axis=1) - kept.sum(axis=1)
    sound = (freedom <= 0) | (squares <= chdtri(freedom.clip(1), _FALSE_ALARM))
    return _Reduced(value, root, gain, sound)


def few_positions(adjustment: ArcAdjustment) -> Partial:
    """Return what is known of the reference antenna's place at epochs without a position.

    Of phases those of arcs that also make positions, in the longest stretch that phase connects:
    an error of their constants shifts those positions alike and is told with them. Only what it
    shifts differently counts as noise here.

    Parameters
    ----------
    adjustment : ArcAdjustment
    """
    own, single = adjustment.epochs, adjustment.equations.single
    there = own.weight > 0
    row = np.flatnonzero(~adjustment.solved & there.any(axis=1))
    if not (len(row) and adjustment.solved.any()):
        return Partial(t_s=np.empty(0), value=np.empty((0, 3)), root=np.empty((0, 3, 3)))
    main, connected = _connected(adjustment)
    weight = own.weight[row].copy()
    weight[:, own.phases] *= connected[own.arc[row][:, own.phases]]
    weight[:, : own.phases.start] /= adjustment.code_thinning
    y = own.y[row] - adjustment.constant_m[own.arc[row]]
    reduced = _reduced(own.A[row], y, weight)
    late_n_m = adjustment.equations.late_n_m[row]
    partial = Partial(
        t_s=single.t_s[row],
        value=adjustment.equations.start_n_m[row] + reduced.value - late_n_m,
        root=reduced.root,
        refused=int((~reduced.sound).sum()),
    )
    noise_m2 = _by_constants(adjustment, row, reduced.gain, main)
    known = reduced.sound & reduced.root.any(axis=(1, 2))
    return partial.with_noise(noise_m2)[known]


def _connected(adjustment: ArcAdjustment) -> tuple[IntArray, BoolArray]:
    """Return the epochs of the longest stretch, and for each arc whether it is among its arcs."""
    own, solved = adjustment.epochs, adjustment.solved
    longest = np.bincount(adjustment.piece[solved]).argmax()
    main = np.flatnonzero(solved & (adjustment.piece == longest))
    arc, weight = own.arc[main][:, own.phases], own.weight[main][:, own.phases]
    connected = np.zeros(len(adjustment.constant_m), dtype=np.bool_)
    connected[arc[weight > 0]] = True
    return main, connected


def _by_constants(
    adjustment: ArcAdjustment, row: IntArray, gain: FloatArray, main: IntArray
) -> FloatArray:
    """Return how constants of arcs shift some epochs against the full epoch next to each.

    A covariance, m2, (k, 3, 3).
    """
    own, Q = adjustment.epochs, adjustment.covariance_m2
    after = np.searchsorted(main, row).clip(1, len(main) - 1) if len(main) > 1 else 0 * row
    before = (after - 1).clip(0)
    near = np.where(row - main[before] < main[after] - row, main[before], main[after])
    of_near = np.einsum(
        "kip,kmp,km->kim", adjustment.cofactor[near][:, :3], own.A[near], own.weight[near]
    )
    shift = np.zeros((len(row), 3, len(Q)))
    for part, arc in ((gain, own.arc[row]), (-of_near, own.arc[near])):
        k = np.arange(len(row))[:, None]
        np.add.at(shift.swapaxes(1, 2), (k, arc), part.swapaxes(1, 2))
    return np.asarray(shift @ Q @ shift.swapaxes(1, 2))


def few_velocities(flight: Flight, solved_s: FloatArray) -> Partial:
    """Return what Dopplers say of the reference antenna's velocity at epochs without a position.

    Parameters
    ----------
    flight : Flight
    solved_s : ndarray, shape (k,)
        Epochs with a position.
    """
    observations = flight.observations
    none = Partial(t_s=np.empty(0), value=np.empty((0, 3)), root=np.empty((0, 3, 3)))
    if observations is None:
        return none
    p_e_m, _ = reference_motion(flight, observations.t_s)
    place = np.asarray(np.isfinite(p_e_m).all(axis=1))
    row = np.flatnonzero(place & ~np.isin(observations.t_s, solved_s))
    channels = code_channels(observations, 0)
    if not (len(row) and channels.satellites):
        return none
    ranges = code_ranges(flight, observations, channels, 0, row)
    paths = signal_paths(ranges.states, p_e_m[row], np.zeros((len(row), 3)))
    elevation_rad = angles(p_e_m[row], paths.e_e)[0]
    y = ranges.rate_mps - paths.range_rate_mps
    use = np.isfinite(ranges.range_m) & np.isfinite(y)
    use &= elevation_rad >= flight.elevation_mask_rad
    lag = 1 - paths.range_rate_mps / C_MPS
    e_n = paths.e_e @ flight.origin.R_ne.T
    A = np.concatenate([-e_n * lag[:, :, None], np.ones((*y.shape, 1))], axis=2)
    sigma_mps = growing(flight, flight.gnss_noise.doppler_mps, elevation_rad)
    reduced = _reduced(
        np.where(use[:, :, None], A, 0.0),
        np.where(use, y, 0.0),
        np.where(use, 1 / np.where(use, sigma_mps, 1.0) ** 2, 0.0),
    )
    known = reduced.sound & reduced.root.any(axis=(1, 2))
    return Partial(
        t_s=observations.t_s[row],
        value=reduced.value,
        root=reduced.root,
        refused=int((~reduced.sound).sum()),
    )[known]
