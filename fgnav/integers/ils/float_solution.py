"""Float solution of an epoch's array: columns by code, and the ambiguities that these leave."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.integers.ils.array_model import LinkArrays, Spans, link_covariance, link_design
from fgnav.kernels.compiled import kernel

_SINGULAR = 1e-9  # of a pivot to its diagonal: beyond, satellites lie in a plane or are too few


class FloatSolution(NamedTuple):
    """The cost of integers z, ``constant + |cycles - z|^2`` in the metric of ``covariance``.

    With z known the columns of the array, one after the other, are ``columns + gain @ (cycles -
    z)``.
    """

    links: IntArray  # (q, 3): baseline, channel, reference
    cycles: FloatArray  # (q,)
    covariance: FloatArray  # (q, q)
    constant: float  # weighted squares of the residuals of code
    columns: FloatArray  # (3 r,)
    gain: FloatArray  # (3 r, q)
    information: FloatArray  # (3 r, 3 r), on the columns with z known
    determined: bool  # whether code alone determines the columns


@kernel
def float_solution(
    epochs: LinkArrays, arrays: Spans, k: int, pattern: int, links: IntArray, multiplier: float
) -> FloatSolution:
    """Solve an epoch, ``multiplier (|M|^2 - r)`` of its r columns M added to the cost."""
    q, u = len(links), 3 * arrays.rank[pattern]
    A = np.empty((q, u + 1))  # code behind the columns
    design = link_design(epochs.e_n[k], arrays.coordinates_m[pattern], links, u)
    for i in range(q):
        for c in range(u):
            A[i, c] = design[i, c]
        A[i, u] = epochs.code_m[k, links[i, 0], links[i, 1]]
    code = solve_symmetric(link_covariance(links, epochs.code_variance_m2[k]), A)
    phase = solve_symmetric(link_covariance(links, epochs.phase_variance_m2[k]), design)
    N, information = np.zeros((u, u)), np.zeros((u, u))
    right, gain = np.zeros((u, q + 1)), np.empty((u, q))
    constant = 0.0
    for i in range(q):
        constant += code[i, u] * A[i, u]
        for c in range(u):
            right[c, i] = A[i, c]
            right[c, q] += code[i, c] * A[i, u]
            gain[c, i] = phase[i, c] * epochs.wavelength_m[links[i, 1]]
            for d in range(u):
                N[c, d] += code[i, c] * A[i, d]
                information[c, d] += phase[i, c] * A[i, d]
    determined = _determined(N)
    for c in range(u):
        N[c, c] += multiplier
    by_code = solve_symmetric(N, right)
    columns = np.empty(u)
    constant -= multiplier * arrays.rank[pattern]
    for c in range(u):
        columns[c] = by_code[c, q]
        constant -= right[c, q] * columns[c]
        for d in range(u):
            information[c, d] += N[c, d]
    cycles, covariance = _ambiguities(epochs, k, links, A, columns, by_code)
    gain = solve_symmetric(information, gain)
    return FloatSolution(
        links, cycles, covariance, constant, columns, gain, information, determined
    )


@kernel
def _ambiguities(
    epochs: LinkArrays,
    k: int,
    links: IntArray,
    A: FloatArray,
    columns: FloatArray,
    by_code: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the cycles of phase less the range by columns, and their covariance."""
    q, u = len(links), len(columns)
    cycles, covariance = np.empty(q), link_covariance(links, epochs.phase_variance_m2[k])
    for i in range(q):
        wavelength_m = epochs.wavelength_m[links[i, 1]]
        cycles[i] = epochs.phase_m[k, links[i, 0], links[i, 1]]
        for c in range(u):
            cycles[i] -= A[i, c] * columns[c]
            for j in range(i + 1):
                covariance[i, j] += A[i, c] * by_code[c, j]
        cycles[i] /= wavelength_m
        for j in range(i + 1):
            covariance[i, j] /= wavelength_m * epochs.wavelength_m[links[j, 1]]
            covariance[j, i] = covariance[i, j]
    return cycles, covariance


@kernel
def _determined(N: FloatArray) -> bool:
    """Return True if every pivot of a symmetric matrix is more than rounding of its diagonal."""
    U = N.copy()
    for j in range(len(U)):
        if not U[j, j] > _SINGULAR * N[j, j]:
            return False
        for i in range(j + 1, len(U)):
            factor = U[j, i] / U[j, j]
            for c in range(i, len(U)):
                U[i, c] -= factor * U[j, c]
    return True


@kernel
def solve_symmetric(S: FloatArray, B: FloatArray) -> FloatArray:
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
