"""Exact integer least squares: LAMBDA's decorrelation and depth-first search, in compiled kernels.

The covariance is factored into ``Q = L^T diag(d) L`` with L unit lower triangular [1]_, taking the
smallest conditional variance first [2]_. Integer row operations then make ``d`` flat. Only the
element that decides about an exchange is reduced, and those that have grown: the others change
neither ``d`` nor the number of nodes the search visits [3]_. The search enumerates integers outward
from each conditional estimate (Schnorr-Euchner) and shrinks its bound to the worst candidate held.
What it returns is the minimum; a caller that cannot wait for it sets a limit of nodes and is told
when that was reached.

References
----------
.. [1] P. J. G. Teunissen, "The least-squares ambiguity decorrelation adjustment", J. Geodesy 70,
   1995.
.. [2] X.-W. Chang, X. Yang, T. Zhou, "MLAMBDA", J. Geodesy 79, 2005.
.. [3] X. Xie, X.-W. Chang, M. Al Borno, "Partial LLL reduction", 2011.
"""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from fgnav.checks import BadInputError, FloatArray, IntArray

kernel = njit(cache=True, nogil=True, error_model="numpy")

OK, NOT_FINITE, ASYMMETRIC, NOT_POSITIVE, UNFINISHED = range(5)  # how a kernel ended
WITHOUT_LIMIT = 2**62  # nodes: centuries

_LARGEST_CYCLES = 2.0**53  # above, a double holds no fraction
_ASYMMETRY = 1e-6  # of the geometric mean of two variances: printed tables pass, mistakes do not
_EPSILON = 2.0**-52
_GAIN = 1e-12  # least relative gain of an exchange: rounding errors must not cycle
# An element that is never reduced can grow without end: of 1000 epochs of 8 antennas and 7
# satellites one ended with a transform of 1e15, beyond which doubles hold no integers. One that has
# grown above the first is reduced with its row; the second makes do, at 1.6 times the time.
_GROWN, _GROWN_AT_ALL = 1e3, 2.0
_LARGEST_TRANSFORM = 1e6  # 1e-10 of precision in the metric, and room for any cycles

_WRONG = {
    NOT_FINITE: "float_cycles and covariance: must be finite, and float_cycles below 2^53",
    ASYMMETRIC: "covariance: must be symmetric",
    NOT_POSITIVE: "covariance: must be positive definite",
}


def integer_least_squares(
    float_cycles: ArrayLike, covariance: ArrayLike, candidates: int = 2
) -> tuple[IntArray, FloatArray]:
    """Return the integer vectors nearest to a float solution in the metric of its covariance.

    Parameters
    ----------
    float_cycles : array_like, shape (n,)
        Float ambiguities, n of 1 or more; those of 1e9 cycles keep their precision.
    covariance : array_like, shape (n, n)
        Their covariance, cycles^2.
    candidates : int
        How many vectors to return.

    Returns
    -------
    integers : ndarray of int64, shape (candidates, n)
        The best first.
    squared_norms : ndarray, shape (candidates,)
        ``(a - z)^T Q^-1 (a - z)`` of each.

    Raises
    ------
    BadInputError
        If a value is not finite, the shapes differ, ``candidates`` is below 1, or the covariance is
        not symmetric and positive definite.
    """
    values, metric = _checked(float_cycles, covariance, candidates, axes=1)
    status, integers, squared_norms = solve(values, metric, candidates, WITHOUT_LIMIT)
    if status != OK:
        raise BadInputError(_WRONG[status])
    return integers, squared_norms


def integer_least_squares_batch(
    float_cycles: ArrayLike, covariance: ArrayLike, candidates: int = 2
) -> tuple[IntArray, FloatArray]:
    """Solve many float solutions of one covariance, whose decorrelation they share.

    Parameters
    ----------
    float_cycles : array_like, shape (k, n)
    covariance : array_like, shape (n, n)
    candidates : int

    Returns
    -------
    integers : ndarray of int64, shape (k, candidates, n)
    squared_norms : ndarray, shape (k, candidates)

    Raises
    ------
    BadInputError
        As ``integer_least_squares``.
    """
    values, metric = _checked(float_cycles, covariance, candidates, axes=2)
    status, integers, squared_norms = _solve_batch(values, metric, candidates)
    if status != OK:
        raise BadInputError(_WRONG[status])
    return integers, squared_norms


def _checked(
    float_cycles: ArrayLike, covariance: ArrayLike, candidates: int, *, axes: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    values = np.array(float_cycles, dtype=np.float64, order="C")
    metric = np.array(covariance, dtype=np.float64, order="C")
    n = values.shape[-1] if values.ndim else 0
    if values.ndim != axes or n < 1:
        want = "(n,)" if axes == 1 else "(k, n)"
        raise BadInputError(
            f"float_cycles: expected shape {want} with n of 1 or more, got {values.shape}"
        )
    if metric.shape != (n, n):
        raise BadInputError(f"covariance: expected shape {(n, n)}, got {metric.shape}")
    if candidates < 1:
        raise BadInputError(f"candidates: must be 1 or more, got {candidates}")
    return values, metric


@kernel
def solve(
    a: FloatArray, Q: FloatArray, candidates: int, limit: int
) -> tuple[int, IntArray, FloatArray]:
    """Kernel of ``integer_least_squares``: status, integers and squared norms.

    ``limit`` nodes end the search with status ``UNFINISHED``.
    """
    n = len(a)
    whole = np.floor(a + 0.5)
    carried = (a - whole).reshape(n, 1)
    integers = np.zeros((candidates, n), dtype=np.int64)
    status = _fault(a, Q)
    if status != OK:
        return status, integers, np.zeros(candidates)
    positive, L, d, T = decorrelate(Q, carried)
    if not positive:
        return NOT_POSITIVE, integers, np.zeros(candidates)
    finished, found, squared_norms = search(L, d, carried[:, 0], candidates, limit)
    _return_to_cycles(found, T, whole, integers)
    return OK if finished else UNFINISHED, integers, squared_norms


@kernel
def _solve_batch(a: FloatArray, Q: FloatArray, candidates: int) -> tuple[int, IntArray, FloatArray]:
    epochs, n = a.shape
    integers = np.zeros((epochs, candidates, n), dtype=np.int64)
    squared_norms = np.zeros((epochs, candidates))
    Z_T = np.eye(n)
    status = max(_fault(a.ravel(), Q[:0]), _fault(a[:0].ravel(), Q))
    if status != OK:
        return status, integers, squared_norms
    positive, L, d, T = decorrelate(Q, Z_T)
    if not positive:
        return NOT_POSITIVE, integers, squared_norms
    for k in range(epochs):
        whole = np.floor(a[k] + 0.5)
        z_float = np.dot(Z_T, a[k] - whole)
        _, found, squared_norms[k] = search(L, d, z_float, candidates, WITHOUT_LIMIT)
        _return_to_cycles(found, T, whole, integers[k])
    return OK, integers, squared_norms


@kernel
def _fault(a: FloatArray, Q: FloatArray) -> int:
    for value in a:
        if not abs(value) < _LARGEST_CYCLES:
            return NOT_FINITE
    for i in range(len(Q)):
        for j in range(i + 1):
            if not np.isfinite(Q[i, j] + Q[j, i]):
                return NOT_FINITE
            if (Q[i, j] - Q[j, i]) ** 2 > _ASYMMETRY**2 * abs(Q[i, i] * Q[j, j]):
                return ASYMMETRIC
    return OK


@kernel
def decorrelate(
    Q: FloatArray, carried: FloatArray
) -> tuple[bool, FloatArray, FloatArray, FloatArray]:
    """Factor and reduce a covariance.

    Parameters
    ----------
    Q : ndarray, shape (n, n)
        Covariance; only its lower triangle is read.
    carried : ndarray, shape (n, c)
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
    before = carried.copy()
    positive, U, d, T = _reduced(Q, carried, _GROWN)
    if positive and not _sound(T):
        carried[:] = before
        positive, U, d, T = _reduced(Q, carried, _GROWN_AT_ALL)
        positive = positive and _sound(T)
    L = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            L[i, j] = U[j, i]
    return positive, L, d, T


@kernel
def _reduced(
    Q: FloatArray, carried: FloatArray, grown: float
) -> tuple[bool, FloatArray, FloatArray, FloatArray]:
    T = np.eye(len(Q))
    positive, U, d = _factor(Q, carried, T)
    if positive:
        _reduce(U, d, carried, T, grown)
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
    Q: FloatArray, carried: FloatArray, T: FloatArray
) -> tuple[bool, FloatArray, FloatArray]:
    """Return whether Q is positive definite, U = L^T in an upper triangle, and d."""
    n = len(Q)
    U = np.empty((n, n))  # U, not L: the rows that the reduction works on lie together in memory
    d = np.empty(n)
    for i in range(n):
        d[i] = 4.0 * n * _EPSILON * Q[i, i]  # until the factor gets there: what rounding can leave
        for j in range(i + 1):
            U[i, j] = U[j, i] = Q[i, j]
    for i in range(n - 1, -1, -1):
        best = _least_diagonal(U, i)
        if best != i:
            _exchange_rows(U, i, best, 0)
            _exchange_rows(carried, i, best, 0)
            _exchange_rows(T, i, best, 0)
            d[i], d[best] = d[best], d[i]
            for j in range(i + 1):
                U[j, i], U[j, best] = U[j, best], U[j, i]
        if not U[i, i] > d[i]:
            return False, U, d
        d[i] = U[i, i]
        for j in range(i):
            factor = U[i, j] / d[i]
            for k in range(i):
                U[j, k] -= factor * U[i, k]
            U[j, i] = factor
        U[i, i] = 1.0
    return True, U, d


@kernel
def _least_diagonal(U: FloatArray, last: int) -> int:
    best = last
    for j in range(last):
        if U[j, j] < U[best, best]:
            best = j
    return best


@kernel
def _exchange_rows(A: FloatArray, i: int, j: int, first: int) -> None:
    for k in range(first, A.shape[1]):
        A[i, k], A[j, k] = A[j, k], A[i, k]


@kernel
def _reduce(U: FloatArray, d: FloatArray, carried: FloatArray, T: FloatArray, grown: float) -> None:
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
            _subtract(U, carried, T, k, k + 1)
        eta, lam = d[k] / variance, d[k + 1] * slope / variance
        d[k], d[k + 1] = eta * d[k + 1], variance
        for j in range(k):
            left, right = U[j, k], U[j, k + 1]
            U[j, k] = right - slope * left
            U[j, k + 1] = eta * left + lam * right
        U[k, k + 1] = lam
        _exchange_rows(U, k, k + 1, k + 2)
        _exchange_rows(carried, k, k + 1, 0)
        _exchange_rows(T, k, k + 1, 0)
        for j in range(k):
            if abs(U[j, k]) + abs(U[j, k + 1]) > grown:
                for i in range(j + 1, n):
                    _subtract(U, carried, T, j, i)
        k = min(k + 1, n - 2)


@kernel
def _subtract(U: FloatArray, carried: FloatArray, T: FloatArray, k: int, i: int) -> None:
    """Reduce element i of row k by its nearest integer times row i."""
    mu = np.floor(U[k, i] + 0.5)
    if mu == 0.0:
        return
    for j in range(i, len(U)):
        U[k, j] -= mu * U[i, j]
    for j in range(carried.shape[1]):
        carried[k, j] -= mu * carried[i, j]
    for j in range(len(T)):
        T[i, j] += mu * T[k, j]


@kernel
def search(
    L: FloatArray, d: FloatArray, z_float: FloatArray, candidates: int, limit: int
) -> tuple[bool, FloatArray, FloatArray]:
    """Return whether it finished, the best integers, (candidates, n), and their squared norms."""
    n = len(d)
    found, squared_norms = np.zeros((candidates, n)), np.full(candidates, np.inf)
    above = np.zeros((n, n))  # row k: what the levels above k add to the conditional estimates
    state = np.zeros((5, n))
    norm_above, centre, z, step, weight = state[0], state[1], state[2], state[3], state[4]
    for k in range(n):
        weight[k] = 1.0 / d[k]
    k = n - 1
    centre[k] = z_float[k]
    z[k] = np.floor(centre[k] + 0.5)
    step[k] = 1.0 if centre[k] >= z[k] else -1.0
    for _ in range(limit):
        gap = centre[k] - z[k]
        norm = norm_above[k] + gap * gap * weight[k]
        if norm < squared_norms[-1]:
            if k > 0:
                k -= 1
                norm_above[k] = norm
                for j in range(k + 1):
                    above[k, j] = above[k + 1, j] - gap * L[k + 1, j]
                centre[k] = z_float[k] + above[k, k]
                z[k] = np.floor(centre[k] + 0.5)
                step[k] = 1.0 if centre[k] >= z[k] else -1.0
                continue
            _insert(found, squared_norms, z, norm)
        elif k == n - 1:
            return True, found, squared_norms
        else:
            k += 1
        z[k] += step[k]
        step[k] = -step[k] - (1.0 if step[k] > 0 else -1.0)
    return False, found, squared_norms


@kernel
def _insert(found: FloatArray, squared_norms: FloatArray, z: FloatArray, norm: float) -> None:
    i = len(squared_norms) - 1
    while i > 0 and squared_norms[i - 1] > norm:
        squared_norms[i] = squared_norms[i - 1]
        found[i] = found[i - 1]
        i -= 1
    squared_norms[i] = norm
    found[i] = z


@kernel
def _return_to_cycles(
    found: FloatArray, T: FloatArray, whole: FloatArray, integers: IntArray
) -> None:
    n = len(whole)
    for i in range(len(found)):
        for k in range(n):
            for j in range(n):
                integers[i, j] += np.int64(found[i, k]) * np.int64(T[k, j])
        for j in range(n):
            integers[i, j] += np.int64(whole[j])
