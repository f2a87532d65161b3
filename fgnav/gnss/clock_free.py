"""Links of an array with the clocks of satellites and receivers eliminated.

Double differences weighed by the inverse of their full covariance equal undifferenced links, each
weighed alone, once a clock of each satellite and one of each receiver and group of signals is
fitted to them [1]_: for any reference, any weights and any missing links, no covariance inverted.

References
----------
.. [1] S. Schaffrin, E. Grafarend, "Generating classes of equivalent linear models by nuisance
   parameter elimination", Manuscripta Geodaetica 11, 1986.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.types.differences import DoubleDifferences

_AT_ONCE = 200  # epochs: 10 MB


class ClockFree(NamedTuple):
    """Values y of links with the clocks eliminated: P is their weight less what clocks explain."""

    weighted: FloatArray  # (n, a, m, v): P y
    normal: FloatArray  # (n, v, v): y' P y
    certain: FloatArray  # (n, a, m): the diagonal of P
    log_determinant: FloatArray  # (n,): of the covariance of as many double differences


def clock_free(
    group: IntArray, seen: BoolArray, variance_m2: FloatArray, values: FloatArray
) -> ClockFree:
    """Eliminate all clocks.

    Parameters
    ----------
    group : ndarray of int, shape (m,)
        Of each channel.
    seen : ndarray of bool, shape (n, a, m)
        Links of antennas, the reference first: its clock is the datum, and it has all channels.
    variance_m2 : ndarray, shape (n, m)
    values : ndarray, shape (n, a, m, v)
        Columns of observations and of their derivatives; of links not seen whatever is finite.
    """
    antennas, weight = seen.sum(axis=1, keepdims=True).clip(1), seen / variance_m2[:, None]
    share = seen / antennas
    left, certain = _centred(values, seen, share), weight * (1.0 - 1.0 / antennas)
    log_determinant = (
        (antennas[:, 0] - 1) * np.log(variance_m2) * seen.any(axis=1) + np.log(antennas[:, 0])
    ).sum(axis=1)
    for g in range(int(group.max(initial=-1)) + 1):
        on = np.flatnonzero(group == g)
        K = -(weight[:, :, on] @ share[:, :, on].swapaxes(1, 2))
        i = np.arange(K.shape[1])
        K[:, i, i] += weight[:, :, on].sum(axis=2)
        alone = K[:, i, i] <= 0.0
        K[:, 0], K[:, :, 0] = 0.0, 0.0
        K[:, i, i] += (i == 0) | alone
        log_determinant += np.linalg.slogdet(K)[1]
        inverse = np.linalg.inv(K)
        inverse[:, 0] = 0.0
        clock = inverse @ (weight[:, :, on, None] * left[:, :, on]).sum(axis=2)
        left[:, :, on] = _centred(
            left[:, :, on] - clock[:, :, None], seen[:, :, on], share[:, :, on]
        )
        of_share = inverse @ share[:, :, on]
        both = (share[:, :, on] * of_share).sum(axis=1, keepdims=True)
        explained = inverse[:, i, i][:, :, None] - 2.0 * of_share + both
        certain[:, :, on] -= weight[:, :, on] ** 2 * explained
    weighted = weight[..., None] * left
    n, _, _, v = values.shape
    normal = values.reshape(n, -1, v).swapaxes(1, 2) @ weighted.reshape(n, -1, v)
    return ClockFree(weighted, normal, certain, log_determinant)


def range_information(
    differences: DoubleDifferences, ranges_m: FloatArray, coordinates: FloatArray
) -> FloatArray:
    """Return the normal equations, (n, 3 c + 1, 3 c + 1), of matrices M, (3, c), row by row.

    Baselines in ``n`` are M times their coordinates; what is measured stands in the last column.

    Parameters
    ----------
    differences : DoubleDifferences
    ranges_m : ndarray, shape (n, b, m)
        Without integers; NaN where a link takes no part.
    coordinates : ndarray, shape (b, c)
    """
    n, b, m = ranges_m.shape
    columns = 3 * coordinates.shape[1]
    out = np.empty((n, columns + 1, columns + 1))
    for first in range(0, n, _AT_ONCE):
        block = slice(first, first + _AT_ONCE)
        finite = np.isfinite(ranges_m[block])
        values = np.zeros((len(finite), b + 1, m, columns + 1))
        design = np.einsum("nji,bc->nbjic", -differences.e_n[block], coordinates)
        values[:, 1:, :, :-1] = design.reshape(*finite.shape, columns)
        values[:, 1:, :, -1] = np.where(finite, ranges_m[block], 0.0)
        links = np.concatenate([finite.any(axis=1, keepdims=True), finite], axis=1)
        variance_m2 = differences.phase_variance_m2[block]
        out[block] = clock_free(differences.group, links, variance_m2, values).normal
    return out


def _centred(values: FloatArray, seen: BoolArray, share: FloatArray) -> FloatArray:
    """Take the means over antennas off: what a clock of each satellite explains."""
    means = (share[..., None] * values).sum(axis=1, keepdims=True)
    return np.asarray(seen[..., None] * (values - means))
