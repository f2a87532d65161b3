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
from fgnav.integers.ils.affine import Epochs, epoch_links, link_covariance, link_design
from fgnav.integers.ils.link_weights import solved, weighed
from fgnav.kernels.compiled import inlined, inner, kernel

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
    if len(present) == 1 or (len(present) > 1 and (present == present[:1]).all()):
        patterns, pattern = present[:1], np.zeros(len(present), dtype=np.int64)  # the usual case
    else:
        patterns, pattern = np.unique(present, axis=0, return_inverse=True)
    known = _spans(baselines_b_m.tobytes(), patterns.tobytes())
    return known._replace(pattern=pattern.reshape(-1))


@lru_cache(maxsize=1000)  # single epochs of one flight ask for the same few again and again
def _spans(baselines: bytes, patterns: bytes) -> Spans:
    """Return the spans of patterns of presence, (p, b), read-only; no epochs."""
    baselines_b_m = np.frombuffer(baselines).reshape(-1, 3)
    present = np.frombuffer(patterns, dtype=np.bool_).reshape(-1, len(baselines_b_m))
    coordinates, basis_b = np.zeros((*present.shape, 3)), np.zeros((len(present), 3, 3))
    rank = np.zeros(len(present), dtype=np.int64)
    for p, there in enumerate(present):
        size, V_T = np.linalg.svd(baselines_b_m[there])[1:]
        rank[p] = (size > _FLAT_M).sum()
        basis_b[p] = V_T.T * [1.0, 1.0, np.linalg.det(V_T)]
        coordinates[p, there] = baselines_b_m[there] @ basis_b[p]
    for array in (coordinates, rank, basis_b):
        array.flags.writeable = False
    return Spans(np.zeros(0, dtype=np.int64), coordinates, rank, basis_b)


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
    A = _design_and_code(epochs, arrays.coordinates_m[pattern], k, links, u)
    weighted = weighed(links, epochs.code_variance_m2[k], epochs.phase_variance_m2[k], A)
    normal, of_phase = _normal(A, weighted[0]), _normal(A, weighted[1])
    constant = normal[u, u]
    if len(prior_columns) > 0:
        constant += _add_prior(prior_columns[k], prior_information[k], normal)
    multiplier = _multiplier(q, u)
    N, by_code, gain = np.empty((u, u)), np.empty((u, q + 1)), np.empty((u, q))
    for i in range(u):
        for j in range(u):
            N[i, j] = normal[i, j]
        N[i, i] += multiplier
        for j in range(q):
            by_code[i, j] = A[j, i]
        by_code[i, q] = normal[i, u]
    by_code = solved(N, by_code)  # N^-1 A^T, and the columns by code
    columns = np.empty(u)
    for i in range(u):
        columns[i] = by_code[i, q]
        constant -= normal[i, u] * columns[i]
    cycles, covariance = _floats(epochs, k, links, A, by_code)
    for i in range(u):
        for j in range(u):
            N[i, j] += of_phase[i, j]
        for j in range(q):
            gain[i, j] = weighted[1, j, i] * epochs.wavelength_m[links[j, 1]]
    gain = solved(N, gain)
    return Relaxation(links, cycles, covariance, constant - multiplier * r, columns, gain, N)


@inlined
def _design_and_code(
    epochs: Epochs, coordinates_m: FloatArray, k: int, links: IntArray, u: int
) -> FloatArray:
    """Return the design of links by the columns, and their code behind it, (q, u + 1)."""
    design = link_design(epochs.e_n[k], coordinates_m, links, u)
    out = np.empty((len(links), u + 1))
    for i in range(len(links)):
        for c in range(u):
            out[i, c] = design[i, c]
        out[i, u] = epochs.code_m[k, links[i, 0], links[i, 1]]
    return out


@inner
def _normal(A: FloatArray, weighted: FloatArray) -> FloatArray:
    """Return the transpose of A times what it is when weighed."""
    out = np.zeros((A.shape[1], A.shape[1]))
    for i in range(len(A)):
        for c in range(A.shape[1]):
            for d in range(A.shape[1]):
                out[c, d] += weighted[i, c] * A[i, d]
    return out


@inlined
def _floats(
    epochs: Epochs, k: int, links: IntArray, A: FloatArray, by_code: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the cycles of phase minus the range that code gives, (q,), and their covariance."""
    q, u = len(links), len(by_code)
    cycles, covariance = np.empty(q), link_covariance(links, epochs.phase_variance_m2[k])
    for i in range(q):
        wavelength_m = epochs.wavelength_m[links[i, 1]]
        cycles[i] = epochs.phase_m[k, links[i, 0], links[i, 1]]
        for c in range(u):
            cycles[i] -= A[i, c] * by_code[c, q]
            for j in range(i + 1):
                covariance[i, j] += A[i, c] * by_code[c, j]
        cycles[i] /= wavelength_m
        for j in range(i + 1):
            covariance[i, j] /= wavelength_m * epochs.wavelength_m[links[j, 1]]
            covariance[j, i] = covariance[i, j]
    return cycles, covariance


@inlined
def _add_prior(columns: FloatArray, information: FloatArray, normal: FloatArray) -> float:
    """Add a measurement of the columns to their normal equations; return its cost at zero."""
    cost, u = 0.0, len(normal) - 1
    for i in range(u):
        for j in range(u):
            normal[i, j] += information[i, j]
            normal[i, u] += information[i, j] * columns[j]
            cost += columns[i] * information[i, j] * columns[j]
    return cost


@inlined
def _multiplier(q: int, u: int) -> float:
    best = _PER_INTEGER * q / max(q - u, 1)
    return min(best, _LARGEST_MULTIPLIER) if q > u else _LARGEST_MULTIPLIER
