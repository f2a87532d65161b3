"""Whitened rows without clocks.

Of the channels of one clock, whitened, the clock is a column along a unit vector u. Householder's
reflection turns it into the first axis [1]_: with w = u + (1, 0, ..., 0) all rows but the first of

    I - w w' / (1 + u_1)

are an orthonormal basis of what the clock leaves open.

References
----------
.. [1] Golub, Van Loan: Matrix Computations, 4th edition, 2013, section 5.1.
"""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.kernels.compiled import kernel


def by_clock(*groups: IntArray) -> tuple[IntArray, IntArray]:
    """Return channels in the order of their clocks, (c,), and these, counted from 0, (c,).

    Parameters
    ----------
    *groups : ndarray of int
        Carriers of channels that share no clock with the others: of phases, of codes.
    """
    kind = np.repeat(np.arange(len(groups)), [len(one) for one in groups])
    group = np.concatenate(groups)
    order = np.lexsort((group, kind))
    changes = (np.diff(group[order]) != 0) | (np.diff(kind[order]) != 0)
    return order, np.append(np.zeros(min(len(order), 1), np.int64), np.cumsum(changes))


@kernel
def whitened_rows(
    clock: IntArray,
    columns: tuple[IntArray, IntArray],
    sizes: tuple[int, int],
    age_s: float,
    sigma: FloatArray,
    measured: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return G, H and z of ``PhaseRows``, of c channels of an epoch, without clocks.

    Parameters
    ----------
    clock : ndarray of int, shape (c,)
        Of each channel, clock after clock, counted from 0.
    columns : tuple of ndarray of int, shape (c,)
        Ambiguity of each channel in A = (ambiguities, errors of satellites, their rates), -1 of
        codes; and satellite, -1 where its errors are taken off.
    sizes : tuple of int
        Ambiguities and satellites.
    age_s : float
        Since A's block began.
    sigma : ndarray, shape (c,)
        Metres.
    measured : ndarray, shape (c, 4)
        Direction away from the satellite, then metres.
    """
    ambiguity, satellite = columns
    ambiguities, satellites = sizes
    A = np.zeros((len(clock), ambiguities + 2 * satellites))
    for i in range(len(clock)):
        if ambiguity[i] >= 0:
            A[i, ambiguity[i]] = 1.0
        if satellite[i] >= 0:
            A[i, ambiguities + satellite[i]] = 1.0
            A[i, ambiguities + satellites + satellite[i]] = age_s
    place = without_clocks(clock, sigma, measured)
    return place[:, :3].copy(), without_clocks(clock, sigma, A), place[:, 3].copy()


@kernel
def without_clocks(clock: IntArray, sigma: FloatArray, rows: FloatArray) -> FloatArray:
    """Return whitened combinations, (c - g, d), of c rows in which no clock of g is left.

    Parameters
    ----------
    clock : ndarray of int, shape (c,)
        Increasing; rows contain those as they are.
    sigma : ndarray, shape (c,)
    rows : ndarray, shape (c, d)
    """
    n, d = rows.shape
    out, common, count, first = np.empty((n, d)), np.empty(d), 0, 0
    while first < n:
        end, squared = first, 0.0
        while end < n and clock[end] == clock[first]:
            squared += 1 / sigma[end] ** 2
            end += 1
        norm = np.sqrt(squared)
        most = 1 + 1 / (sigma[first] * norm)
        for j in range(d):
            common[j] = rows[first, j] / sigma[first] * most
        for i in range(first + 1, end):
            scale = 1 / (sigma[i] ** 2 * norm)
            for j in range(d):
                common[j] += scale * rows[i, j]
        for i in range(first + 1, end):
            share = 1 / (sigma[i] * norm * most)
            for j in range(d):
                out[count, j] = rows[i, j] / sigma[i] - share * common[j]
            count += 1
        first = end
    return out[:count]
