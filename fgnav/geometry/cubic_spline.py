"""The cubic spline through samples: scipy.interpolate has it, and takes 0.15 s to load."""

import numpy as np
from scipy.linalg import solve_banded  # loaded by numba in any case

from fgnav.checks import FloatArray


def cubic_spline(t: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    """Return the spline through samples, two derivatives continuous, at other places, (m, ...).

    The first two intervals share one cubic, and the last two ("not a knot"); three samples have a
    parabola, two a straight line. Beyond the samples the outer cubics go on.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Increasing, two or more.
    values : ndarray, shape (n, ...)
    at : ndarray, shape (m,)
    """
    y = values.reshape(len(t), -1)
    if len(t) > 3:
        slope = _slopes(t, y)
    else:
        slope = np.asarray(np.gradient(y, t, axis=0, edge_order=2 if len(t) == 3 else 1))
    k = np.searchsorted(t, at, side="right").clip(1, len(t) - 1) - 1
    x, span = (at - t[k])[:, None], (t[k + 1] - t[k])[:, None]
    chord = (y[k + 1] - y[k]) / span
    bend = (slope[k] + slope[k + 1] - 2 * chord) / span
    square = (chord - slope[k]) / span - bend
    interpolated = y[k] + slope[k] * x + square * x**2 + bend / span * (x**2 * x)
    return np.asarray(interpolated.reshape(len(at), *values.shape[1:]))


def _slopes(t: FloatArray, y: FloatArray) -> FloatArray:
    """Return the first derivatives at four samples or more, (n, c) [1]_.

    References
    ----------
    .. [1] de Boor: A Practical Guide to Splines, 1978, chapter IV.
    """
    h, two = np.diff(t), t[2:] - t[:-2]
    chord = np.diff(y, axis=0) / h[:, None]
    above = np.concatenate([[0, two[0]], h[:-1]])
    diagonal = np.concatenate([h[1:2], 2 * (h[:-1] + h[1:]), h[-2:-1]])
    below = np.concatenate([h[1:], [two[-1], 0]])
    first = ((h[0] + 2 * two[0]) * h[1] * chord[0] + h[0] ** 2 * chord[1]) / two[0]
    inner = 3 * (h[1:, None] * chord[:-1] + h[:-1, None] * chord[1:])
    last = (h[-1] ** 2 * chord[-2] + (2 * two[-1] + h[-1]) * h[-2] * chord[-1]) / two[-1]
    bands, right = np.stack([above, diagonal, below]), np.vstack([first, inner, last])
    return np.asarray(solve_banded((1, 1), bands, right))
