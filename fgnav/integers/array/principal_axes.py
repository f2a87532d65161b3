"""Eigenvalues and eigenvectors of symmetric 3 x 3 matrices, by Jacobi's rotations.

A call of LAPACK for three rows costs five times what they need, and a second to compile.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.kernels.compiled import kernel

_SWEEPS = 12  # convergence is quadratic: 5 to 7 do
_DIAGONAL = 1e-32  # of the squares of all elements


@kernel
def principal_axes(S: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return eigenvalues, (3,), the least first, and eigenvectors, (3, 3), one a column.

    Parameters
    ----------
    S : ndarray, shape (3, 3)
        Symmetric.
    """
    A, V, values = S.copy(), np.zeros((3, 3)), np.zeros(3)
    for i in range(3):
        V[i, i] = 1.0
    for _ in range(_SWEEPS):
        if not _across(A):
            break
        for p in range(2):
            for q in range(p + 1, 3):
                _rotate(A, V, p, q)
    for i in range(3):
        values[i] = A[i, i]
    for j in (0, 1, 0):
        if values[j] > values[j + 1]:
            values[j], values[j + 1] = values[j + 1], values[j]
            for k in range(3):
                V[k, j], V[k, j + 1] = V[k, j + 1], V[k, j]
    return values, V


@kernel
def _across(A: FloatArray) -> bool:
    """Return True if an element off the diagonal is not zero."""
    across, along = 0.0, 0.0
    for i in range(3):
        along += A[i, i] * A[i, i]
        for j in range(i):
            across += A[i, j] * A[i, j]
    return across > _DIAGONAL * along


@kernel
def _rotate(A: FloatArray, V: FloatArray, p: int, q: int) -> None:
    """Turn axes p and q until A has nothing between them."""
    if A[p, q] == 0.0:
        return
    slope = (A[q, q] - A[p, p]) / (2.0 * A[p, q])
    tangent = 1.0 / (abs(slope) + np.sqrt(slope * slope + 1.0))
    if slope < 0.0:
        tangent = -tangent
    cosine = 1.0 / np.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    for k in range(3):
        A[k, p], A[k, q] = cosine * A[k, p] - sine * A[k, q], sine * A[k, p] + cosine * A[k, q]
    for k in range(3):
        A[p, k], A[q, k] = cosine * A[p, k] - sine * A[q, k], sine * A[p, k] + cosine * A[q, k]
        V[k, p], V[k, q] = cosine * V[k, p] - sine * V[k, q], sine * V[k, p] + cosine * V[k, q]
