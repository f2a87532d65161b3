"""From the last keyframe of an eliminated chain back: steps, covariances; names as in ``kernel``.

References
----------
Takahashi, Fagan & Chin, Formation of a sparse bus impedance matrix, 1973: covariances of a banded
system from its Cholesky factor, in the order of substitution.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.kernels.compiled import inlined, kernel

NOTHING = 1e-13  # of a diagonal: less than that is rounding


@kernel
def newest(forward: FloatArray, covariance: FloatArray, step: FloatArray) -> float:
    """Fill covariance and step of the newest state and the constants, (D + b,) wide.

    Returns the least cost of all that is known, NaN if a direction is open.
    """
    n = len(step)
    U, L, end = forward.copy(), np.zeros((n, n)), np.empty((n, 1))
    if not triangular(U, n):
        return np.nan
    for i in range(n):
        end[i, 0] = U[i, n]
        for j in range(i, n):
            L[j, i] = U[i, j]
    backward_solve(L, end)
    for i in range(n):
        step[i] = end[i, 0]
    inverse_of_square(L, covariance)
    for i in range(n):
        for j in range(i):
            covariance[j, i] = covariance[i, j]
    return float(U[n, n])


@kernel
def substitute(gain: FloatArray, end: FloatArray, steps: FloatArray) -> None:
    """Fill the steps, (n, D), of all states, given those of the last one and the constants."""
    D, width = steps.shape[1], len(end)
    after = end.copy()
    for i in range(D):
        steps[len(steps) - 1, i] = end[i]
    for k in range(len(steps) - 2, -1, -1):
        step, G = steps[k], gain[k]
        for i in range(D):
            total = G[i, width]
            for j in range(width):
                total -= G[i, j] * after[j]
            step[i] = total
        for i in range(D):
            after[i] = step[i]


@kernel
def marginals(
    gain: FloatArray,
    root: FloatArray,
    end: FloatArray,
    covariance: FloatArray,
    cross: FloatArray,
    constant_cross: FloatArray,
) -> None:
    """Fill the covariances of n states, of each with the next and of each with the constants.

    Parameters
    ----------
    gain, root : ndarray, shape (n - 1 or more, D, ...)
        As ``eliminate`` leaves them; ``root`` may be the memory of ``covariance``.
    end : ndarray, shape (D + b, D + b)
        Covariance of the last state and the constants; becomes that of the first.
    covariance, cross, constant_cross : ndarray, shapes (n, D, D), (n - 1, D, D), (n, D, b or less)
        Of constants the first, as many as there is room for.
    """
    n, D, width = len(covariance), covariance.shape[1], len(end)
    joint, alone, T = end, np.empty((D, D)), end[:D].copy()
    turned = np.empty((width, D))
    for k in range(n - 1, -1, -1):
        here = covariance[k]
        if k < n - 1:
            _negative_product(gain[k], joint, T)
            inverse_of_square(root[k], alone)
            _transpose(gain[k], turned)
            _less_product(alone, T, turned)
            for i in range(D):
                for j in range(D):
                    cross[k, i, j] = T[i, j]
                    joint[i, j] = alone[i, j] if j <= i else alone[j, i]
                for j in range(D, width):
                    joint[i, j] = joint[j, i] = T[i, j]
        for i in range(D):
            for j in range(D):
                here[i, j] = joint[i, j]
            for j in range(constant_cross.shape[2]):
                constant_cross[k, i, j] = joint[i, D + j]


@inlined
def _transpose(G: FloatArray, out: FloatArray) -> None:
    """Fill the transpose of G's first columns."""
    for i in range(len(out)):
        for j in range(len(G)):
            out[i, j] = G[j, i]


@inlined
def _less_product(out: FloatArray, A: FloatArray, B: FloatArray) -> None:
    """Take A B off the lower half of a square matrix."""
    for i in range(len(out)):
        less_rows(out[i, : i + 1], A[i], B)


@inlined
def _negative_product(G: FloatArray, S: FloatArray, out: FloatArray) -> None:
    """Set ``out`` to minus the product of G's first columns with a square S."""
    for i in range(len(out)):
        row = out[i]
        for j in range(len(S)):
            row[j] = 0.0
        less_rows(row, G[i], S)


@kernel
def less_rows(row: FloatArray, scale: FloatArray, B: FloatArray) -> None:
    """Take the rows of B off a row, each times its scale: four at once, for sums wait for each.

    The last ones, too, are summed before they are taken off: as many rows of zeros as may follow
    change no rounding. Arcs are padded to the most of a flight, of which what was before knows
    nothing.
    """
    n, last = len(B), len(B) - 1
    for k in range(0, n, 4):
        a = scale[k]
        b = scale[k + 1] if k + 1 < n else 0.0
        c = scale[k + 2] if k + 2 < n else 0.0
        d = scale[k + 3] if k + 3 < n else 0.0
        w, x, y, z = B[k], B[min(k + 1, last)], B[min(k + 2, last)], B[min(k + 3, last)]
        for j in range(len(row)):
            row[j] -= a * w[j] + b * x[j] + c * y[j] + d * z[j]


@kernel
def inverse_of_square(L: FloatArray, out: FloatArray) -> None:
    """Set the lower half of ``out`` to that of the inverse of L L'."""
    n = len(L)
    for i in range(n):
        row = out[i]
        for j in range(n):
            row[j] = 0.0
        row[i] = 1.0
        for k in range(i):
            scale, other = L[i, k], out[k]
            for j in range(k + 1):
                row[j] -= scale * other[j]
        for j in range(i + 1):
            row[j] /= L[i, i]
    backward_solve(L, out)


@kernel
def triangular(A: FloatArray, count: int) -> bool:
    """Turn the first rows of A into those of its Cholesky factor, take their square off the rest.

    Upper half; rows are taken off as by ``less_rows``, what has nothing to do with four of them is
    left alone. Returns whether pivots have digits.
    """
    for i in range(len(A)):
        row, end = A[i, i:], min(i, count)
        diagonal, last = row[0], end - 1
        for k in range(0, end, 4):
            w, x, y = A[k, i:], A[min(k + 1, last), i:], A[min(k + 2, last), i:]
            z = A[min(k + 3, last), i:]
            a = w[0]
            b = x[0] if k + 1 < end else 0.0
            c = y[0] if k + 2 < end else 0.0
            d = z[0] if k + 3 < end else 0.0
            if a != 0.0 or b != 0.0 or c != 0.0 or d != 0.0:
                for j in range(len(row)):
                    row[j] -= a * w[j] + b * x[j] + c * y[j] + d * z[j]
        if i < count:
            if not row[0] > NOTHING * diagonal:
                return False
            scale = 1.0 / np.sqrt(row[0])
            for j in range(len(row)):
                row[j] *= scale
    return True


@kernel
def backward_solve(L: FloatArray, Y: FloatArray) -> None:
    """Solve L' X = Y in place."""
    n = len(L)
    column = np.empty(n)
    for i in range(n - 1, -1, -1):
        row = Y[i]
        for k in range(i + 1, n):
            column[k] = L[k, i]
        less_rows(row, column[i + 1 :], Y[i + 1 :])
        scale = 1.0 / L[i, i]
        for j in range(len(row)):
            row[j] *= scale
