"""The inverse covariance of an epoch's double differences, applied without forming either.

Double differences are undifferenced links whose satellites and receivers have clocks of their own.
Weighing them by the inverse of their full covariance is the same as fitting those clocks and
weighing what is left of each link alone [1]_: a matrix of the size of the antennas takes the place
of one of the size of the links, whichever of them are missing.

References
----------
.. [1] S. Schaffrin, E. Grafarend, "Generating classes of equivalent linear models by nuisance
   parameter elimination", Manuscripta Geodaetica 11, 1986.
"""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.kernels.compiled import kernel


@kernel
def weighed(
    links: IntArray, code_variance: FloatArray, phase_variance: FloatArray, X: FloatArray
) -> FloatArray:
    """Return ``C^-1 X``, (2, q, c), for the covariance of code and for that of phase.

    Parameters
    ----------
    links : ndarray of int64, shape (q, 3)
        Baseline, channel and reference channel; baselines in rising order.
    code_variance, phase_variance : ndarray, shape (m,)
        Of the undifferenced links of each channel: C is what ``link_covariance`` makes of them.
    X : ndarray, shape (q, c)
    """
    q, width = X.shape
    m = len(code_variance)
    out = np.zeros((2, q, width))
    place = np.zeros((links[-1, 0] + 1 if q > 0 else 0, m), dtype=np.int64)
    reference = np.zeros(m, dtype=np.int64)
    for i in range(q):
        place[links[i, 0], links[i, 1]] = i + 1  # 0: no link
        reference[links[i, 1]] = links[i, 2] + 1
    for r in range(m):
        grouped = False
        for j in range(m):
            grouped |= reference[j] == r + 1
        if grouped:
            present = _there(r, reference, place)
            for kind in range(2):
                variance = code_variance if kind == 0 else phase_variance
                _weigh_group(r, present, place, variance, X, out[kind])
    return out


@kernel
def _weigh_group(
    r: int,
    present: FloatArray,
    place: IntArray,
    variance: FloatArray,
    X: FloatArray,
    out: FloatArray,
) -> None:
    """Weigh the links of the group whose reference is channel r."""
    b, m = place.shape
    width = X.shape[1]
    residual = np.zeros((b + 1, m, width))  # 0 at the reference, and at the reference antenna
    for i in range(b):
        for j in range(m):
            if present[i + 1, j] != 0.0 and j != r:
                for v in range(width):
                    residual[i + 1, j, v] = X[place[i, j] - 1, v]
    _take_satellites_clocks(residual, present)
    _take_receivers_clocks(residual, present, variance)
    _take_satellites_clocks(residual, present)
    for i in range(b):
        for j in range(m):
            if present[i + 1, j] != 0.0 and j != r:
                for v in range(width):
                    out[place[i, j] - 1, v] = residual[i + 1, j, v] / variance[j]


@kernel
def _take_satellites_clocks(residual: FloatArray, present: FloatArray) -> None:
    """Take off the means over antennas."""
    a, m, width = residual.shape
    for j in range(m):
        antennas = _antennas(present, j)
        for v in range(width):
            total = 0.0
            for i in range(a):
                total += residual[i, j, v]
            for i in range(a):
                residual[i, j, v] -= present[i, j] * total / antennas


@kernel
def _take_receivers_clocks(residual: FloatArray, present: FloatArray, variance: FloatArray) -> None:
    """Take off what receivers' clocks explain of links that are free of satellites' clocks."""
    a, m, width = residual.shape
    K, clock = np.zeros((a, a)), np.zeros((a, width))
    for j in range(m):
        antennas = _antennas(present, j)
        for i in range(a):
            weight = present[i, j] / variance[j]
            K[i, i] += weight
            for c in range(a):
                K[i, c] -= weight * present[c, j] / antennas
            for v in range(width):
                clock[i, v] += weight * residual[i, j, v]
    for i in range(a):
        if i == 0 or K[i, i] == 0.0:  # one clock is the other's; no link of the group, no clock
            K[i, i] += 1.0 + K[i, i]
    of_receivers = solved(K, clock)
    for i in range(a):
        for j in range(m):
            for v in range(width):
                residual[i, j, v] -= present[i, j] * of_receivers[i, v]


@kernel
def _antennas(present: FloatArray, j: int) -> float:
    """Return how many have a channel, 1 where none has."""
    total = 0.0
    for i in range(len(present)):
        total += present[i, j]
    return max(total, 1.0)


@kernel
def _there(r: int, reference: IntArray, place: IntArray) -> FloatArray:
    """Return 1 for the links of a group, those of its reference and of the reference antenna too.

    Shape (b + 1, m), the reference antenna first.
    """
    b, m = place.shape
    present = np.zeros((b + 1, m))
    for i in range(b):
        for j in range(m):
            if reference[j] == r + 1 and place[i, j] > 0:
                present[0, j] = present[0, r] = present[i + 1, j] = present[i + 1, r] = 1.0
    return present


@kernel
def solved(S: FloatArray, B: FloatArray) -> FloatArray:
    """Return ``S^-1 B``, S symmetric and positive definite; zeros of S between groups are free."""
    q, width = B.shape
    U, X = S.copy(), B.copy()
    for j in range(q):
        for i in range(j + 1, q):
            factor = U[j, i] / U[j, j]
            if factor != 0.0:
                for c in range(i, q):
                    U[i, c] -= factor * U[j, c]
                for c in range(width):
                    X[i, c] -= factor * X[j, c]
    for j in range(q - 1, -1, -1):
        for i in range(j + 1, q):
            for c in range(width):
                X[j, c] -= U[j, i] * X[i, c]
        for c in range(width):
            X[j, c] /= U[j, j]
    return X
