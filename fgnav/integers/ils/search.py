"""Exact integer least squares: LAMBDA's depth-first search, in compiled kernels.

After decorrelation the search enumerates integers outward from each conditional estimate
(Schnorr-Euchner) and shrinks its bound to the worst candidate held. What it returns is the minimum;
a caller that cannot wait for it sets a limit of nodes and is told when that was reached.

Where not all integers can be trusted, the last ones after decorrelation, whose conditional
variances are smallest, are fixed alone [1]_: as many as their success rate allows.

References
----------
.. [1] P. J. G. Teunissen, P. Joosten, C. Tiberius, "Geometry-free ambiguity success rates in case
   of partial fixing", ION NTM 1999.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav.integers.ils.decorrelation import decorrelate
from fgnav.kernels.compiled import kernel

OK, NOT_FINITE, ASYMMETRIC, NOT_POSITIVE, UNFINISHED = range(5)  # how a kernel ended
WITHOUT_LIMIT = 2**62  # nodes: centuries

_LARGEST_CYCLES = 2.0**53  # above, a double holds no fraction
_ASYMMETRY = 1e-6  # of the geometric mean of two variances: printed tables pass, mistakes do not

_CERTAIN = 3e-3  # cycles^2: rounding is wrong in less than 1e-18 of all cases

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

    Examples
    --------
    Joosten and Tiberius' example, whose nearest vector is not the rounded one:

    >>> from fgnav.integers import integer_least_squares
    >>> covariance = [[6.290, 5.978, 0.544], [5.978, 6.292, 2.340], [0.544, 2.340, 6.288]]
    >>> integers, squared_norms = integer_least_squares([5.45, 3.10, 2.97], covariance)
    >>> integers
    array([[5, 3, 4],
           [6, 4, 4]])
    >>> squared_norms.round(4)
    array([0.2183, 0.3073])
    """
    values, metric = checked_problem(float_cycles, covariance, candidates)
    status, integers, squared_norms = solve(values, metric, candidates, WITHOUT_LIMIT)
    if status != OK:
        raise refused(status)
    return integers, squared_norms


def checked_problem(
    float_cycles: ArrayLike, covariance: ArrayLike, candidates: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return float cycles and covariance as kernels take them; copies only where they must be.

    Raises
    ------
    BadInputError
        If the shapes differ or ``candidates`` is below 1.
    """
    values, metric = _writable(float_cycles), _writable(covariance)
    n = values.shape[-1] if values.ndim else 0
    if values.ndim != 1 or n < 1:
        raise BadInputError(
            f"float_cycles: expected shape (n,) with n of 1 or more, got {values.shape}"
        )
    if metric.shape != (n, n):
        raise BadInputError(f"covariance: expected shape {(n, n)}, got {metric.shape}")
    if candidates < 1:
        raise BadInputError(f"candidates: must be 1 or more, got {candidates}")
    return values, metric


def _writable(value: ArrayLike) -> NDArray[np.float64]:
    """Return the array itself where it can be: kernels are compiled for writable ones alone."""
    array = np.asarray(value, dtype=np.float64)
    return array if array.flags.carray else np.array(array, order="C")


def refused(status: int) -> BadInputError:
    """Return the error that says why a kernel refused its input."""
    return BadInputError(_WRONG[status])


@kernel
def solve(
    a: FloatArray, Q: FloatArray, candidates: int, limit: int
) -> tuple[int, IntArray, FloatArray]:
    """Kernel of ``integer_least_squares``: status, integers and squared norms.

    ``limit`` nodes end the search with status ``UNFINISHED``.
    """
    status, integers, squared_norms, _, _ = solve_subset(a, Q, candidates, limit, -1.0)
    return status, integers, squared_norms


@kernel
def solve_subset(
    a: FloatArray, Q: FloatArray, candidates: int, limit: int, success_min: float
) -> tuple[int, IntArray, FloatArray, BoolArray, float]:
    """Solve for as many decorrelated integers as are right with a probability.

    Parameters
    ----------
    a : ndarray, shape (n,)
    Q : ndarray, shape (n, n)
    candidates, limit : int
        As ``solve``.
    success_min : float
        Least bootstrapped success rate of the integers that are searched; 0: all of them; below:
        all, and the rate is not worked out.

    Returns
    -------
    status : int
    integers : ndarray of int64, shape (candidates, n)
        Those of ambiguities that the fixed ones do not determine are 0.
    squared_norms : ndarray, shape (candidates,)
        In the metric of the fixed ones.
    determined : ndarray of bool, shape (n,)
        Ambiguities that are combinations of fixed integers alone.
    success : float
        Bootstrapped success rate of the fixed ones: a lower bound of that of the search.
    """
    n = len(a)
    rounded, transformed = np.empty(n), np.empty((n, 1))
    for i in range(n):
        rounded[i] = np.floor(a[i] + 0.5)
        transformed[i, 0] = a[i] - rounded[i]
    integers = np.zeros((candidates, n), dtype=np.int64)
    determined = np.zeros(n, dtype=np.bool_)
    status = fault(a, Q)
    if status != OK:
        return status, integers, np.zeros(candidates), determined, 0.0
    positive, L, d, T = decorrelate(Q, transformed)
    if not positive:
        return NOT_POSITIVE, integers, np.zeros(candidates), determined, 0.0
    first, success = fixable(d, success_min)
    if first == n:
        return OK, integers, np.zeros(candidates), determined, 1.0
    if first > 0:
        L, d, transformed = L[first:, first:].copy(), d[first:].copy(), transformed[first:].copy()
    z_float = np.empty(len(transformed))  # in one piece: else the search is compiled once more
    for i in range(len(transformed)):
        z_float[i] = transformed[i, 0]
    finished, vectors, squared_norms = search(L, d, z_float, candidates, limit)
    for j in range(n):
        determined[j] = True
        for i in range(first):
            determined[j] &= T[i, j] == 0.0
    _return_to_cycles(vectors, T[first:], rounded, determined, integers)
    return OK if finished else UNFINISHED, integers, squared_norms, determined, success


@kernel
def fixable(d: FloatArray, success_min: float) -> tuple[int, float]:
    """Return the first integer of the longest tail whose success rate is enough, and that rate."""
    if success_min < 0.0:
        return 0, math.nan
    success = 1.0
    for k in range(len(d) - 1, -1, -1):
        if d[k] < _CERTAIN:
            continue
        more = success * math.erf(1.0 / math.sqrt(8.0 * d[k]))
        if more < success_min:
            return k + 1, success
        success = more
    return 0, success


@kernel
def fault(a: FloatArray, Q: FloatArray) -> int:
    """Return the fault of a float solution, ``OK`` if none can be seen without work."""
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
def search(
    L: FloatArray, d: FloatArray, z_float: FloatArray, candidates: int, limit: int
) -> tuple[bool, FloatArray, FloatArray]:
    """Return True if it finished, the best integers, (candidates, n), and their squared norms."""
    n = len(d)
    vectors, squared_norms = np.zeros((candidates, n)), np.full(candidates, np.inf)
    room = np.zeros((n + 5, n))
    above = room[5:]  # row k: what the levels above k add to the conditional estimates
    norm_above, centre, z, step, weight = room[0], room[1], room[2], room[3], room[4]
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
            _insert(vectors, squared_norms, z, norm)
        elif k == n - 1:
            return True, vectors, squared_norms
        else:
            k += 1
        z[k] += step[k]
        step[k] = -step[k] - (1.0 if step[k] > 0 else -1.0)
    return False, vectors, squared_norms


@kernel
def _insert(vectors: FloatArray, squared_norms: FloatArray, z: FloatArray, norm: float) -> None:
    i = len(squared_norms) - 1
    while i > 0 and squared_norms[i - 1] > norm:
        squared_norms[i] = squared_norms[i - 1]
        for j in range(len(z)):
            vectors[i, j] = vectors[i - 1, j]
        i -= 1
    squared_norms[i] = norm
    for j in range(len(z)):
        vectors[i, j] = z[j]


@kernel
def _return_to_cycles(
    vectors: FloatArray, T: FloatArray, rounded: FloatArray, wanted: BoolArray, integers: IntArray
) -> None:
    for i in range(len(vectors)):
        for j in range(len(rounded)):
            if wanted[j]:
                total = 0.0  # exact: whole numbers far below 2^53
                for k in range(len(T)):
                    total += vectors[i, k] * T[k, j]
                integers[i, j] = np.int64(total) + np.int64(rounded[j])
