"""All integer vectors whose relaxed cost is within a bound, one after the other, nearest first.

The walk is that of ``fgnav.integers.ils.search``, depth first after LAMBDA's decorrelation, and
stops at every complete vector, so that whoever asked can lower the bound before it goes on. With
the integers above a level known and those below it real, the columns of the array are those of the
level in its covariance: how far they are from orthonormal adds to the cost of all below.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.kernels.compiled import kernel

AT_VECTOR, AT_END, AT_LIMIT = range(3)  # where a walk stops
_COMPLETE = -1  # a level: below the last

# Columns are looked at before the vector is complete where one is known to a third of its length,
# until two integers more than M has elements are known: beyond, phase residuals prune as well.
# Epochs proven of four antennas 2 m apart in space and six satellites, code 0.3 m: 17 in 30 instead
# of 10; three antennas 5 m and 3 m apart, code 0.5 m: 28 instead of 15.
_KNOWN, _LAST_LOOKS = 0.1, 2
LOOK = 5  # nodes: what a look at columns takes


class Walk(NamedTuple):
    """Constants and state of the walk: row k of a level, that of the last integer first."""

    L: FloatArray  # (n, n)
    d: FloatArray  # (n,)
    z_float: FloatArray  # (n,)
    column_gain: FloatArray  # (n, 3 r): how the columns move with a level's own gap
    covariances: FloatArray  # (n, 3 r, 3 r): theirs, with the integers below the level real
    useful: BoolArray  # (n,): whether that is small enough for a look

    z: FloatArray  # (n,)
    step: FloatArray  # (n,)
    norm: FloatArray  # (n + 1,): of the levels above
    above: FloatArray  # (n + 1, n): what those add to the conditional estimates
    columns: FloatArray  # (n + 1, 3 r): by those
    place: IntArray  # (2,): level, or `_COMPLETE`, and nodes visited


@kernel
def walk_of(
    L: FloatArray,
    d: FloatArray,
    z_float: FloatArray,
    columns: FloatArray,
    gain: FloatArray,
    covariance: FloatArray,
) -> Walk:
    """Return a walk that has not begun.

    Parameters
    ----------
    L, d : ndarray, shapes (n, n) and (n,)
        Of the decorrelated covariance.
    z_float : ndarray, shape (n,)
    columns : ndarray, shape (3 r,)
        With all integers real.
    gain : ndarray, shape (3 r, n)
        Of the columns by the decorrelated integers.
    covariance : ndarray, shape (3 r, 3 r)
        Of the columns with all integers known.
    """
    u, n = gain.shape
    walk = Walk(
        L,
        d,
        z_float,
        np.zeros((n, u)),
        np.zeros((n, u, u)),
        np.zeros(n, dtype=np.bool_),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n + 1),
        np.zeros((n + 1, n)),
        np.zeros((n + 1, u)),
        np.zeros(2, dtype=np.int64),
    )
    for c in range(u):
        walk.columns[n, c] = columns[c]
    _set_levels(walk, gain, covariance.copy())
    return walk


@kernel
def _set_levels(walk: Walk, gain: FloatArray, covariance: FloatArray) -> None:
    """Find what each level tells of the columns before the integers below it are known."""
    u, n = gain.shape
    for k in range(n):
        for v in range(0, u, 3):
            if n - k <= u + _LAST_LOOKS and trace(covariance, v) < _KNOWN:
                walk.useful[k] = True
        for c in range(u):
            for j in range(k + 1):
                walk.column_gain[k, c] += gain[c, j] * walk.L[k, j]
        for c in range(u):
            for e in range(u):
                walk.covariances[k, c, e] = covariance[c, e]
                covariance[c, e] += walk.column_gain[k, c] * walk.d[k] * walk.column_gain[k, e]


@kernel
def begin(walk: Walk) -> None:
    """Go back to the start; nodes visited count on."""
    k = len(walk.d) - 1
    walk.place[0] = k
    walk.z[k] = np.floor(walk.z_float[k] + 0.5)
    walk.step[k] = 1.0 if walk.z_float[k] >= walk.z[k] else -1.0


@kernel
def next_vector(walk: Walk, bound: float, limit: int) -> tuple[int, float]:
    """Go on to the next complete vector within the bound.

    Parameters
    ----------
    walk : Walk
        ``z`` is that vector then, and ``columns[0]`` are its columns.
    bound : float
        Of the squared norm.
    limit : int
        Nodes visited at which to give up.

    Returns
    -------
    int
        ``AT_VECTOR``, ``AT_END`` (there is none left) or ``AT_LIMIT``.
    float
        The vector's squared norm.
    """
    n, u = walk.column_gain.shape
    k = walk.place[0]
    if k == _COMPLETE:
        k = 0
        _advance(walk, k)
    while walk.place[1] < limit:
        walk.place[1] += 1
        gap = walk.z_float[k] + walk.above[k + 1, k] - walk.z[k]
        norm = walk.norm[k + 1] + gap * gap / walk.d[k]
        if norm < bound:
            for c in range(u):
                walk.columns[k, c] = walk.columns[k + 1, c] + walk.column_gain[k, c] * gap
            if k == 0:
                walk.place[0] = _COMPLETE
                return AT_VECTOR, norm
            smallest = norm
            if walk.useful[k]:
                walk.place[1] += LOOK
                smallest += least_distance(walk.columns[k], walk.covariances[k])
            if smallest < bound:
                walk.norm[k] = norm
                for j in range(k):
                    walk.above[k, j] = walk.above[k + 1, j] - gap * walk.L[k, j]
                k -= 1
                centre = walk.z_float[k] + walk.above[k + 1, k]
                walk.z[k] = np.floor(centre + 0.5)
                walk.step[k] = 1.0 if centre >= walk.z[k] else -1.0
                continue
        elif k == n - 1:
            return AT_END, norm
        else:
            k += 1
        _advance(walk, k)
    return AT_LIMIT, 0.0


@kernel
def _advance(walk: Walk, k: int) -> None:
    """Take a level's next integer: outward from the conditional estimate, to both sides in turn."""
    walk.z[k] += walk.step[k]
    walk.step[k] = -walk.step[k] - (1.0 if walk.step[k] > 0 else -1.0)


@kernel
def least_distance(columns: FloatArray, covariance: FloatArray) -> float:
    """Return a lower bound of the distance to orthonormal columns, from their products alone.

    Columns ``x = m - d`` with ``d`` within t of the covariance's ellipsoid, t the root of the
    distance, have ``1 - |x|^2 = 2 x . d + |d|^2`` and ``-x . x' = x . d' + x' . d + d . d'``, where
    the linear terms are at most t times their own standard deviation and the quadratic ones at most
    t^2 times the sum of variances. Where x is longer than 1, m lies beyond a plane across it.
    """
    smallest = 0.0
    for u in range(0, len(columns), 3):
        x = columns[u : u + 3]
        for v in range(0, u + 3, 3):
            y = columns[v : v + 3]
            product = x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
            linear = _variance(covariance, u, v, x, y)
            if u == v and product > 1.0:
                gap = product - np.sqrt(product)
                root = gap / np.sqrt(linear)
            else:
                gap = 1.0 - product if u == v else abs(product)
                half = np.sqrt(linear) if u == v else 0.5 * np.sqrt(linear)
                square = np.sqrt(trace(covariance, u) * trace(covariance, v))
                root = gap / (half + np.sqrt(half * half + square * gap))
            smallest = max(smallest, root)
    return smallest * smallest


@kernel
def _variance(covariance: FloatArray, u: int, v: int, x: FloatArray, y: FloatArray) -> float:
    """Return that of ``x . d`` for one column, u = v, and of ``x . d' + y . d`` for two."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            if u == v:
                total += x[i] * covariance[u + i, u + j] * x[j]
            else:
                total += x[i] * covariance[v + i, v + j] * x[j]
                total += y[i] * covariance[u + i, u + j] * y[j]
                total += 2.0 * x[i] * covariance[v + i, u + j] * y[j]
    return total


@kernel
def trace(covariance: FloatArray, u: int) -> float:
    """Return the sum of variances of the column that begins with element u."""
    total: float = covariance[u, u] + covariance[u + 1, u + 1] + covariance[u + 2, u + 2]
    return total
