"""Epochs of code and phase eliminated one by one, compiled: the loops of ``arc_adjustment``.

Measurements of weight 0 are not there.
"""

import numpy as np
from numba import njit

from fgnav.checks import BoolArray, FloatArray, IntArray


@njit(cache=True)
def eliminate(A: FloatArray, weight: FloatArray, cofactor: FloatArray) -> FloatArray:
    """Fill the covariances of the epochs' unknowns, arcs known; return squared dilutions, (n,).

    Infinite, and a cofactor of zeros, where measurements are too few or all in a plane.

    Parameters
    ----------
    A : ndarray, shape (n, m, p)
        Position first.
    weight : ndarray, shape (n, m)
    cofactor : ndarray, shape (n, p, p)
        To be filled.
    """
    n, m, p = A.shape
    dilution, N, unit = np.full(n, np.inf), np.empty((p, p)), np.empty((p, p))
    flat = np.empty((p, p))
    for k in range(n):
        N[:], unit[:], used, asked = 0.0, 0.0, 0, 0
        for j in range(m):
            if weight[k, j] > 0.0:
                used += 1
                for a in range(p):
                    for b in range(a + 1):
                        square = A[k, j, a] * A[k, j, b]
                        unit[a, b] += square
                        N[a, b] += weight[k, j] * square
        for a in range(p):
            if N[a, a] == 0.0:  # nothing speaks of it
                N[a, a] = unit[a, a] = 1.0
            else:
                asked += 1
        if used and used >= asked and _inverse(unit, flat) and _inverse(N, cofactor[k]):
            dilution[k] = flat[0, 0] + flat[1, 1] + flat[2, 2]
        else:
            cofactor[k] = 0.0
    return dilution


@njit(cache=True)
def reduce(
    A: FloatArray,
    y: FloatArray,
    weight: FloatArray,
    cofactor: FloatArray,
    solved: BoolArray,
    arc: IntArray,
    N: FloatArray,
    pull: FloatArray,
) -> None:
    """Add what epochs say of the arcs' constants, their own unknowns eliminated, to equations.

    Parameters
    ----------
    A, y, weight, cofactor, solved
    arc : ndarray of int, shape (n, m)
        ``len(N)`` or more: none.
    N, pull : ndarray, shape (a, a), (a,)
        Their matrix, lower triangle, and right-hand side.
    """
    n, m, p = A.shape
    gain, left, x = np.empty((m, p)), np.empty(m), np.empty(p)
    for k in range(n):
        if not solved[k]:
            continue
        _gain(A[k], weight[k], cofactor[k], gain)
        _solve(A[k], y[k], weight[k], gain, x, left)
        for i in range(m):
            w, one = weight[k, i], arc[k, i]
            if w == 0.0 or one >= len(N):
                continue
            pull[one] += w * left[i]
            N[one, one] += w
            for j in range(m):
                other = arc[k, j]
                if other <= one and weight[k, j] > 0.0:
                    shared = 0.0
                    for a in range(p):
                        shared += A[k, i, a] * gain[j, a]
                    N[one, other] -= w * shared


@njit(cache=True)
def fit(
    A: FloatArray, left_m: FloatArray, weight: FloatArray, cofactor: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the epochs' unknowns, (n, p), and residuals, (n, m), the arcs' constants taken off."""
    n, m, p = A.shape
    x, residual_m, gain = np.empty((n, p)), np.empty((n, m)), np.empty((m, p))
    for k in range(n):
        _gain(A[k], weight[k], cofactor[k], gain)
        _solve(A[k], left_m[k], weight[k], gain, x[k], residual_m[k])
    return x, residual_m


@njit(cache=True)
def shares(A: FloatArray, weight: FloatArray, cofactor: FloatArray) -> FloatArray:
    """Return the share of its own error that each measurement's residual shows, (n, m)."""
    n, m, p = A.shape
    out, gain = np.ones((n, m)), np.empty((m, p))
    for k in range(n):
        _gain(A[k], weight[k], cofactor[k], gain)
        for j in range(m):
            for a in range(p):
                out[k, j] -= A[k, j, a] * gain[j, a]
    return out


@njit(cache=True)
def spread(
    A: FloatArray,
    weight: FloatArray,
    cofactor: FloatArray,
    rows: IntArray,
    arc: IntArray,
    covariance_m2: FloatArray,
) -> FloatArray:
    """Return what the constants of arcs bring to positions of some epochs, (k, 3, 3).

    Parameters
    ----------
    A, weight, cofactor, rows
    arc : ndarray of int, shape (n, m)
    covariance_m2 : ndarray, shape (a + 1, a + 1)
        The last, zeros, stands for no arc.
    """
    m, p = A.shape[1:]
    out, gain, half = np.zeros((len(rows), 3, 3)), np.empty((m, p)), np.empty((m, 3))
    for r in range(len(rows)):
        k = rows[r]
        _gain(A[k], weight[k], cofactor[k], gain)
        half[:] = 0.0
        for i in range(m):
            for j in range(m):
                between = covariance_m2[arc[k, i], arc[k, j]]
                for a in range(3):
                    half[i, a] += between * gain[j, a]
        for i in range(m):
            for a in range(3):
                for b in range(3):
                    out[r, a, b] += gain[i, a] * half[i, b]
    return out


@njit(cache=True)
def _gain(A: FloatArray, weight: FloatArray, cofactor: FloatArray, out: FloatArray) -> None:
    """Fill how the unknowns of an epoch follow its measurements, (m, p)."""
    m, p = A.shape
    for j in range(m):
        for a in range(p):
            total = 0.0
            for b in range(p):
                total += cofactor[a, b] * A[j, b]
            out[j, a] = weight[j] * total


@njit(cache=True)
def _solve(
    A: FloatArray,
    y: FloatArray,
    weight: FloatArray,
    gain: FloatArray,
    x: FloatArray,
    left: FloatArray,
) -> None:
    """Fill the unknowns of an epoch, (p,), and residuals, (m,); 0 of what is not there."""
    m, p = A.shape
    x[:], left[:] = 0.0, 0.0
    for j in range(m):
        for a in range(p):
            x[a] += gain[j, a] * y[j]
    for j in range(m):
        if weight[j] > 0.0:
            left[j] = y[j]
            for a in range(p):
                left[j] -= A[j, a] * x[a]


@njit(cache=True)
def _inverse(N: FloatArray, out: FloatArray) -> bool:
    """Fill the inverse of a matrix by Cholesky, of which the lower triangle is read and lost.

    Returns whether it has one.
    """
    p = len(N)
    for j in range(p):
        N[j, j] *= 1 + 1e-13  # a flat geometry gets a huge cofactor
    for j in range(p):
        for k in range(j):
            for i in range(j, p):
                N[i, j] -= N[i, k] * N[j, k]
        if not N[j, j] > 0.0:
            return False
        scale = np.sqrt(N[j, j])
        for i in range(j, p):
            N[i, j] /= scale
    for j in range(p):
        _column(N, j, out)
    for i in range(p):
        for j in range(i):
            out[j, i] = out[i, j]
    return True


@njit(cache=True)
def _column(L: FloatArray, j: int, out: FloatArray) -> None:
    """Fill column j, from the diagonal down, of the inverse of L L'."""
    p = len(L)
    for i in range(j, p):
        total = 1.0 if i == j else 0.0
        for k in range(j, i):
            total -= L[i, k] * out[k, j]
        out[i, j] = total / L[i, i]
    for i in range(p - 1, j - 1, -1):
        for k in range(i + 1, p):
            out[i, j] -= L[k, i] * out[k, j]
        out[i, j] /= L[i, i]
