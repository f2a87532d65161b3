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


class ClockFree(NamedTuple):
    """What is left of values y of links: P is their weight less what clocks explain."""

    weighted: FloatArray  # (n, a, m, v): P y
    normal: FloatArray  # (n, v, v): y' P y
    certain: FloatArray  # (n, a, m): the diagonal of P


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
    for g in range(int(group.max(initial=-1)) + 1):
        on = np.flatnonzero(group == g)
        K = -(weight[:, :, on] @ share[:, :, on].swapaxes(1, 2))
        i = np.arange(K.shape[1])
        K[:, i, i] += weight[:, :, on].sum(axis=2)
        alone = K[:, i, i] <= 0.0
        K[:, 0], K[:, :, 0] = 0.0, 0.0
        K[:, i, i] += (i == 0) | alone
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
    return ClockFree(weighted, normal, certain)


def _centred(values: FloatArray, seen: BoolArray, share: FloatArray) -> FloatArray:
    """Take the means over antennas off: what a clock of each satellite explains."""
    means = (share[..., None] * values).sum(axis=1, keepdims=True)
    return np.asarray(seen[..., None] * (values - means))
