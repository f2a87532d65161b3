"""The covariance of a keyframe from that of the one after it, see ``elimination``."""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.kernels.compiled import kernel_with


@kernel_with(fastmath={"reassoc", "contract"})
def descended(R: FloatArray, S: FloatArray, above: FloatArray, rows: IntArray) -> FloatArray:
    """Return the joint covariance of frontal variables and of others that are known.

    Parameters
    ----------
    R : ndarray, shape (f, f)
        Upper triangular.
    S : ndarray, shape (f, s)
    above : ndarray, shape (p, p)
        Covariance of what is known.
    rows : ndarray of int, shape (e,)
        Where the separators, and after them what else is to be carried, stand in it.

    Returns
    -------
    ndarray, shape (f + e, f + e)
    """
    f, e = R.shape[0], len(rows)
    inverse = _inverse(R)
    gain = _product(inverse, S)
    P, beside = np.empty((f + e, f + e)), np.empty((e, e))
    for i in range(e):
        for j in range(e):
            beside[i, j] = P[f + i, f + j] = above[rows[i], rows[j]]
    cross = _product(gain, beside)
    for i in range(f):
        for j in range(e):
            P[i, f + j] = P[f + j, i] = -cross[i, j]
        for j in range(i, f):
            total = 0.0
            for k in range(f):
                total += inverse[i, k] * inverse[j, k]
            for k in range(S.shape[1]):
                total += cross[i, k] * gain[j, k]
            P[i, j] = P[j, i] = total
    return P


@kernel_with(fastmath={"reassoc", "contract"})
def _inverse(R: FloatArray) -> FloatArray:
    """Return the inverse of an upper triangular matrix."""
    f = R.shape[0]
    inverse = np.zeros((f, f))
    for i in range(f - 1, -1, -1):
        pivot = 1.0 / R[i, i]
        inverse[i, i] = pivot
        for k in range(i + 1, f):
            factor = R[i, k] * pivot
            for j in range(f):
                inverse[i, j] -= factor * inverse[k, j]
    return inverse


@kernel_with(fastmath={"reassoc", "contract"})
def _product(A: FloatArray, B: FloatArray) -> FloatArray:
    """Return A times the first rows of B."""
    m, n, p = A.shape[0], A.shape[1], B.shape[1]
    out = np.zeros((m, p))
    for i in range(m):
        for k in range(n):
            factor = A[i, k]
            for j in range(p):
                out[i, j] += factor * B[k, j]
    return out
