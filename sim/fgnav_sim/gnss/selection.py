"""A few satellites chosen of all in view, as small receivers and the source paper's network do."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray

_EVERY_S = 900.0  # a satellite moves by some 7 degrees meanwhile
_SINGULAR = 1e-12  # what is added to normal matrices, whose eigenvalues are near one otherwise


def chosen(
    wanted: int,
    above: BoolArray,
    elevation_rad: FloatArray,
    azimuth_rad: FloatArray,
    t_s: FloatArray,
) -> BoolArray:
    """Return where satellites are both above the mask and among those chosen, (n, s).

    The choice is made anew every 15 min, so that integers last: of the satellites that stay above
    the mask until the next choice (of all above it now, if those are too few), the one without
    which the geometric dilution of precision is least is left out, until ``wanted`` remain.

    Parameters
    ----------
    wanted : int
        How many; all where fewer are in view.
    above : ndarray of bool, shape (n, s)
    elevation_rad, azimuth_rad : ndarray, shape (n, s)
    t_s : ndarray, shape (n,)
    """
    begin = np.flatnonzero(np.diff(period(t_s), prepend=-1.0))
    flat = np.cos(elevation_rad[begin])
    e = [flat * np.cos(azimuth_rad[begin]), flat * np.sin(azimuth_rad[begin])]
    towards = np.stack([*e, np.sin(elevation_rad[begin])], axis=-1)
    kept = best_geometry(towards, lasting(above, begin, wanted), wanted)
    lengths = np.diff(begin, append=len(t_s))
    return np.asarray(above & np.repeat(kept, lengths, axis=0))


def period(t_s: FloatArray) -> FloatArray:
    """Return the number of the 15 min for which one choice of satellites holds, (n,)."""
    return np.asarray(np.floor(t_s / _EVERY_S))


def lasting(above: BoolArray, begin: IntArray, wanted: int | IntArray) -> BoolArray:
    """Return the candidates of each span of epochs, (k, s): those that stay, if they are enough.

    Parameters
    ----------
    above : ndarray of bool, shape (n, s)
        Which satellites are above the mask.
    begin : ndarray of int, shape (k,)
        First epoch of each span; it reaches up to the next one.
    wanted : int or ndarray of int, shape (k,)
    """
    stay = np.logical_and.reduceat(above, begin, axis=0)
    is_sufficient = stay.sum(axis=1) >= wanted
    return np.asarray(np.where(is_sufficient[:, None], stay, above[begin]))


def best_geometry(towards: FloatArray, candidates: BoolArray, wanted: int | IntArray) -> BoolArray:
    """Select the satellites that remain when the least useful are left out one by one, (k, s).

    Without row ``r`` the normal matrix ``G`` of the geometry loses ``r r^T``, so the trace of its
    inverse, the square of the geometric dilution of precision, grows by ``|G^-1 r|^2 / (1 - r^T
    G^-1 r)`` (Sherman and Morrison): the row that makes it grow least goes.

    Parameters
    ----------
    towards : ndarray, shape (k, s, 3)
        Unit vectors to satellites, in any axes.
    candidates : ndarray of bool, shape (k, s)
    wanted : int or ndarray of int, shape (k,)
        How many remain; all where there are fewer.
    """
    kept = candidates.copy()
    rows = np.concatenate([towards, np.ones((*kept.shape, 1))], axis=2)
    surplus = kept.sum(axis=1) - wanted
    for step in range(int(surplus.max(initial=0))):
        busy = np.flatnonzero(surplus > step)
        A = np.where(kept[busy, :, None], rows[busy], 0.0)
        inverse = np.linalg.inv(A.swapaxes(1, 2) @ A + _SINGULAR * np.eye(4))
        pulled = A @ inverse
        left = 1.0 - np.einsum("ksi,ksi->ks", pulled, A)
        grows = np.einsum("ksi,ksi->ks", pulled, pulled) / np.maximum(left, _SINGULAR)
        kept[busy, np.where(kept[busy], grows, np.inf).argmin(axis=1)] = False
    return kept
