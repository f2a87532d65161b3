"""LAMBDA's decorrelation: a covariance factored, and its conditional variances made flat.

The covariance is factored into ``Q = L^T diag(d) L`` with L unit lower triangular [1]_, taking the
smallest conditional variance first [2]_. Integer row operations then make ``d`` flat. Only the
element that decides about an exchange is reduced, and those that have grown: the others change
neither ``d`` nor the number of nodes a search visits [3]_.

References
----------
.. [1] P. J. G. Teunissen, "The least-squares ambiguity decorrelation adjustment", J. Geodesy 70,
   1995.
.. [2] X.-W. Chang, X. Yang, T. Zhou, "MLAMBDA", J. Geodesy 79, 2005.
.. [3] X. Xie, X.-W. Chang, M. Al Borno, "Partial LLL reduction", 2011.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.kernels.compiled import kernel

_EPSILON = 2.0**-52
_GAIN = 1e-12  # least relative gain of an exchange: rounding errors must not cycle
# An element that is never reduced can grow without end: of 1000 epochs of 8 antennas and 7
# satellites one ended with a transform of 1e15, beyond which doubles hold no integers. One that has
# grown above the first is reduced with its row; the second makes do, at 1.6 times the time.
_GROWN, _GROWN_AT_ALL = 1e3, 2.0
_LARGEST_TRANSFORM = 1e6  # 1e-10 of precision in the metric, and room for any cycles


@kernel
def decorrelate(
    Q: FloatArray, transformed: FloatArray
) -> tuple[bool, FloatArray, FloatArray, FloatArray]:
    """Factor and reduce a covariance.

    Parameters
    ----------
    Q : ndarray, shape (n, n)
        Covariance; only its lower triangle is read.
    transformed : ndarray, shape (n, c)
        Float ambiguities, or the identity; multiplied in place by the transform Z^T.

    Returns
    -------
    positive : bool
        Whether Q is positive definite beyond rounding errors, and the transform sound.
    L : ndarray, shape (n, n)
        Unit lower triangular factor of Z^T Q Z.
    d : ndarray, shape (n,)
        Conditional variances: ``Z^T Q Z = L^T diag(d) L``.
    T : ndarray, shape (n, n)
        Integers; the rows turn z back into ambiguities, ``a = z @ T``.
    """
    n = len(Q)
    before = transformed.copy()
    U = np.empty((n, n))  # L^T: the rows that the reduction works on lie together in memory
    d, T = np.empty(n), np.empty((n, n))
    positive = False
    for grown in (_GROWN, _GROWN_AT_ALL):
        for i in range(n):
            for j in range(n):
                T[i, j] = 1.0 if i == j else 0.0
            for j in range(transformed.shape[1]):
                transformed[i, j] = before[i, j]
        positive = _factor(Q, U, d, transformed, T)
        if not positive:
            break
        _reduce(U, d, transformed, T, grown)
        positive = _sound(T)
        if positive:
            break
    for i in range(n):  # U^T in its place
        for j in range(i):
            U[i, j], U[j, i] = U[j, i], 0.0
    return positive, U, d, T


@kernel
def _sound(T: FloatArray) -> bool:
    for row in T:
        for value in row:
            if not abs(value) < _LARGEST_TRANSFORM:
                return False
    return True


@kernel
def _factor(
    Q: FloatArray, U: FloatArray, d: FloatArray, transformed: FloatArray, T: FloatArray
) -> bool:
    """Set U = L^T in an upper triangle, and d; return whether Q is positive definite."""
    n = len(Q)
    for i in range(n):
        d[i] = 4.0 * n * _EPSILON * Q[i, i]  # until the factor gets there: what rounding can leave
        for j in range(i + 1):
            U[i, j] = U[j, i] = Q[i, j]
    for i in range(n - 1, -1, -1):
        best = _least_diagonal(U, i)
        if best != i:
            _exchange_rows(U, i, best)
            _exchange_rows(transformed, i, best)
            _exchange_rows(T, i, best)
            d[i], d[best] = d[best], d[i]
            for j in range(i + 1):
                U[j, i], U[j, best] = U[j, best], U[j, i]
        if not U[i, i] > d[i]:
            return False
        d[i] = U[i, i]
        for j in range(i):
            factor = U[i, j] / d[i]
            for k in range(i):
                U[j, k] -= factor * U[i, k]
            U[j, i] = factor
        U[i, i] = 1.0
    return True


@kernel
def _least_diagonal(U: FloatArray, last: int) -> int:
    best = last
    for j in range(last):
        if U[j, j] < U[best, best]:
            best = j
    return best


@kernel
def _exchange_rows(A: FloatArray, i: int, j: int) -> None:
    for k in range(A.shape[1]):
        A[i, k], A[j, k] = A[j, k], A[i, k]


@kernel
def _reduce(
    U: FloatArray, d: FloatArray, transformed: FloatArray, T: FloatArray, grown: float
) -> None:
    """Exchange neighbours while that lowers the variance that is searched first."""
    n = len(d)
    k = n - 2
    while k >= 0:
        mu = np.floor(U[k, k + 1] + 0.5)
        slope = U[k, k + 1] - mu
        variance = d[k] + slope * slope * d[k + 1]
        if variance >= d[k + 1] * (1.0 - _GAIN):
            k -= 1
            continue
        if mu != 0.0:
            _subtract(U, transformed, T, k, k + 1)
        eta, lam = d[k] / variance, d[k + 1] * slope / variance
        d[k], d[k + 1] = eta * d[k + 1], variance
        for j in range(k):
            left, right = U[j, k], U[j, k + 1]
            U[j, k] = right - slope * left
            U[j, k + 1] = eta * left + lam * right
        U[k, k + 1] = lam
        for j in range(k + 2, n):
            U[k, j], U[k + 1, j] = U[k + 1, j], U[k, j]
        _exchange_rows(transformed, k, k + 1)
        _exchange_rows(T, k, k + 1)
        for j in range(k):
            if abs(U[j, k]) + abs(U[j, k + 1]) > grown:
                for i in range(j + 1, n):
                    _subtract(U, transformed, T, j, i)
        k = min(k + 1, n - 2)


@kernel
def _subtract(U: FloatArray, transformed: FloatArray, T: FloatArray, k: int, i: int) -> None:
    """Reduce element i of row k by its nearest integer times row i."""
    mu = np.floor(U[k, i] + 0.5)
    if mu == 0.0:
        return
    for j in range(i, len(U)):
        U[k, j] -= mu * U[i, j]
    for j in range(transformed.shape[1]):
        transformed[k, j] -= mu * transformed[i, j]
    for j in range(len(T)):
        T[i, j] += mu * T[k, j]
