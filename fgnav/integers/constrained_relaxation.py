"""The relaxation of the rigid array that lets its integers be searched exactly.

In coordinates ``c_i``, (r,), of the space it spans, an array with attitude ``R_nb`` has baselines
``M c_i`` with orthonormal columns: ``M = R_nb V``, (3, r). Leaving M free gives the affine model
[1]_, whose integer search is exact but weak. It is not weak any more once the known length of the
columns enters: for every M with unit columns

    cost(M, z)  =  cost(M, z) + e (|M|^2 - r)

whatever e, and with e > 0 the right side, minimised over *all* M, is still a quadratic form in z.
It bounds the constrained cost from below as a Lagrangian relaxation does, and it stays positive
definite with any satellites. Enumerating the integers below a bound of the relaxed cost therefore
misses none below that bound of the constrained cost.

References
----------
.. [1] P. J. G. Teunissen, "The affine constrained GNSS attitude model and its multivariate integer
   least-squares solution", J. Geodesy 86, 2012.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.integers.affine import Epochs, epoch_links, link_covariance, link_design
from fgnav.integers.ils import kernel

_FLAT_M = 1e-3  # an array is flat in a direction it leaves by less: below phase noise

# The multiplier e trades what it takes off the bound, e r, for the reach of directions that code
# leaves open: of q integers least volume is left near 6 q / (q - 3 r), without end for q = 3 r.
# Nodes at the 1e-4 quantile of chi-square, four antennas and satellites, code 10 m: 3e5 at 1, 58880
# at 4, 6947 at 10, 2347 at 25; where more is known all but 1 are alike.
_PER_INTEGER = 6.0
_LARGEST_MULTIPLIER = 30.0


class Spans(NamedTuple):
    """Where the antennas that are there lie in the space they span."""

    pattern: IntArray  # (n,)
    coordinates_m: FloatArray  # (p, b, 3): the first r columns count, the longest axis first
    rank: IntArray  # (p,)
    basis_b: FloatArray  # (p, 3, 3): V, the first r columns count


class Relaxation(NamedTuple):
    """One epoch, relaxed: ``constant + |cycles - z|^2`` in the metric of ``covariance``.

    Once z is known the columns of M, one after the other, are ``columns + gain @ (cycles - z)``,
    and the constrained cost is the relaxed one plus the distance to the nearest M with orthonormal
    columns in the metric of ``information``.
    """

    links: IntArray  # (q, 3): baseline, channel, reference
    cycles: FloatArray  # (q,)
    covariance: FloatArray  # (q, q)
    constant: float
    columns: FloatArray  # (3 r,)
    gain: FloatArray  # (3 r, q)
    information: FloatArray  # (3 r, 3 r)


def spans(baselines_b_m: FloatArray, resolvable: BoolArray) -> Spans:
    """Find right-handed coordinates of the antennas present, once for every pattern of presence.

    Parameters
    ----------
    baselines_b_m : ndarray, shape (b, 3)
    resolvable : ndarray of bool, shape (n, b, m)
    """
    present = np.any(resolvable, axis=2)
    if (present == present[:1]).all():  # the usual case, and ten times as fast
        patterns, pattern = present[:1], np.zeros(len(present), dtype=np.int64)
    else:
        patterns, pattern = np.unique(present, axis=0, return_inverse=True)
    coordinates, basis_b = np.zeros((*patterns.shape, 3)), np.zeros((len(patterns), 3, 3))
    rank = np.zeros(len(patterns), dtype=np.int64)
    for p, there in enumerate(patterns):
        baselines = baselines_b_m[there]
        rank[p], basis_b[p] = _basis(baselines.tobytes())
        coordinates[p, there] = baselines @ basis_b[p]
    return Spans(pattern.reshape(-1), coordinates, rank, basis_b)


@lru_cache(maxsize=1000)  # single epochs of one flight ask for the same few again and again
def _basis(baselines: bytes) -> tuple[int, FloatArray]:
    """Return the rank of baselines, (b, 3), and right-handed axes, (3, 3), the longest first."""
    size, V_T = np.linalg.svd(np.frombuffer(baselines).reshape(-1, 3))[1:]
    return int((size > _FLAT_M).sum()), V_T.T * [1.0, 1.0, np.linalg.det(V_T)]


@kernel
def relaxation(
    epochs: Epochs,
    arrays: Spans,
    k: int,
    prior_columns: FloatArray,
    prior_information: FloatArray,
) -> Relaxation:
    """Relax one epoch; the prior, (n, 9) and (n, 9, 9) or without rows, counts as its code does."""
    pattern = arrays.pattern[k]
    r = arrays.rank[pattern]
    everywhere = np.ones(epochs.phase_m.shape[1], dtype=np.bool_)
    links = epoch_links(epochs.resolvable[k], epochs.of_reference[k], everywhere)
    q, u = len(links), 3 * r
    A = link_design(epochs.e_n[k], arrays.coordinates_m[pattern], links, u)
    wavelength_m, code_m = np.empty(q), np.empty((q, 1))
    for i in range(q):
        wavelength_m[i] = epochs.wavelength_m[links[i, 1]]
        code_m[i, 0] = epochs.code_m[k, links[i, 0], links[i, 1]]

    of_code = solved(link_covariance(links, epochs.code_variance_m2[k]), _beside(A, code_m))
    normal = product(transposed(A), of_code)
    N, g = normal[:, :u].copy(), normal[:, u:].copy()
    constant = np.sum(code_m[:, 0] * of_code[:, u])
    if len(prior_columns) > 0:
        constant += _add_prior(prior_columns[k], prior_information[k], N, g)
    multiplier = _multiplier(q, u)
    for i in range(u):
        N[i, i] += multiplier
    by_code = solved(N, _beside(transposed(A), g))  # N^-1 A^T, and the columns by code
    columns = by_code[:, q].copy()
    constant -= np.sum(g[:, 0] * columns) + multiplier * r

    C = link_covariance(links, epochs.phase_variance_m2[k])
    of_phase = transposed(solved(C, A))
    N += product(of_phase, A)
    for i in range(q):
        of_phase[:, i] *= wavelength_m[i]
    cycles = np.empty(q)
    for i in range(q):
        range_m = np.sum(A[i] * columns)
        phase_m = epochs.phase_m[k, links[i, 0], links[i, 1]]
        cycles[i] = (phase_m - range_m) / wavelength_m[i]
    covariance = C + product(A, by_code[:, :q])
    for i in range(q):
        for j in range(i + 1):
            covariance[i, j] /= wavelength_m[i] * wavelength_m[j]
            covariance[j, i] = covariance[i, j]
    gain = solved(N, of_phase)
    return Relaxation(links, cycles, covariance, constant, columns, gain, N)


@kernel
def _add_prior(columns: FloatArray, information: FloatArray, N: FloatArray, g: FloatArray) -> float:
    """Add a measurement of the columns to their normal equations; return its cost at zero."""
    cost = 0.0
    for i in range(len(N)):
        for j in range(len(N)):
            N[i, j] += information[i, j]
            g[i, 0] += information[i, j] * columns[j]
            cost += columns[i] * information[i, j] * columns[j]
    return cost


@kernel
def _beside(A: FloatArray, B: FloatArray) -> FloatArray:
    W = np.empty((A.shape[0], A.shape[1] + B.shape[1]))
    W[:, : A.shape[1]] = A
    W[:, A.shape[1] :] = B
    return W


@kernel
def transposed(A: FloatArray) -> FloatArray:
    """Return a copy of the transpose."""
    return A.T.copy()


@kernel
def product(A: FloatArray, B: FloatArray) -> FloatArray:
    """Return A B, in plain loops: numba compiles those in a third of the time."""
    out = np.zeros((A.shape[0], B.shape[1]))
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            if A[i, k] != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += A[i, k] * B[k, j]
    return out


@kernel
def solved(S: FloatArray, B: FloatArray) -> FloatArray:
    """Return ``S^-1 B``, S symmetric and positive definite; zeros of S between groups are free."""
    q = len(B)
    U, X = S.copy(), B.copy()
    for j in range(q):
        for i in range(j + 1, q):
            factor = U[j, i] / U[j, j]
            if factor != 0.0:
                _subtract(U, i, j, factor, i)
                _subtract(X, i, j, factor, 0)
    for j in range(q - 1, -1, -1):
        for i in range(j + 1, q):
            if U[j, i] != 0.0:
                _subtract(X, j, i, U[j, i], 0)
        for c in range(X.shape[1]):
            X[j, c] /= U[j, j]
    return X


@kernel
def _subtract(A: FloatArray, i: int, j: int, factor: float, first: int) -> None:
    """Take a multiple of row j off row i."""
    for c in range(first, A.shape[1]):
        A[i, c] -= factor * A[j, c]


@kernel
def _multiplier(q: int, u: int) -> float:
    best = _PER_INTEGER * q / max(q - u, 1)
    return min(best, _LARGEST_MULTIPLIER) if q > u else _LARGEST_MULTIPLIER
