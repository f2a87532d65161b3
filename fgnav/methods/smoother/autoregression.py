"""Samples that are missing, told from both sides by how the others follow one another."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import lstsq

from fgnav.checks import BoolArray, FloatArray

_RIDGE = 0.01  # of the samples' rms: noise in them, which would damp the swing that is told


def interpolated(
    samples: FloatArray, known: BoolArray, first: int, last: int, order: int
) -> FloatArray | None:
    """Return samples from ``first`` to ``last``, those that are not known as the others say.

    Column by column: an autoregression is fitted to known samples, and unknown ones are those with
    the least squares of its errors [1]_, whether it is run up to them or on from them.

    Parameters
    ----------
    samples : ndarray, shape (m, c)
        At equal steps.
    known : ndarray of bool, shape (m,)
    first, last : int
        Unknown samples next to these are found with them, others are passed over.
    order : int
        Of the autoregression.

    Returns
    -------
    ndarray, shape (last - first + 1, c)
        None where the known samples are too few.

    References
    ----------
    .. [1] Janssen, Veldhuis, Vries: Adaptive interpolation of discrete-time signals that can be
       modeled as autoregressive processes, IEEE Trans. ASSP 34, 1986, eqs. 7 to 10.
    """
    m, unknown = len(known), np.flatnonzero(~known)
    before, after = np.flatnonzero(known[:first]), np.flatnonzero(known[last:])
    if m <= order or not len(before) or not len(after):
        return None  # it takes known samples on both sides
    wanted = unknown[(unknown > before[-1]) & (unknown < last + after[0])]
    others = np.isin(np.arange(m), np.setdiff1d(unknown, wanted))
    of_others = sliding_window_view(others, order + 1).any(axis=1)
    fits = sliding_window_view(known, order + 1).all(axis=1)
    rows = np.flatnonzero(~fits & ~of_others)
    if fits.sum() < 2 * order or len(rows) < len(wanted):
        return None
    found, place = samples.copy(), rows[:, None] + np.arange(order + 1)
    for c, mean in enumerate(samples[known].mean(axis=0)):
        column = np.where(known, samples[:, c] - mean, 0.0)
        told = sliding_window_view(column, order + 1)[fits]
        X, y = told[:, :-1], told[:, -1]
        noise = len(y) * _RIDGE**2 * (column[known] ** 2).mean() + np.finfo(float).tiny
        error = np.append(-np.linalg.solve(X.T @ X + noise * np.eye(order), X.T @ y), 1.0)
        E = np.zeros((len(rows), m))
        E[np.arange(len(rows))[:, None], place] = error
        found[wanted, c] = mean + lstsq(E[:, wanted], -E @ column, lapack_driver="gelsy")[0]
    return found[first : last + 1]
