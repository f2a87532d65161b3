"""Blocks of derivatives put together and squared, in plain loops; see ``link_kernel``."""

import numpy as np
from numba import njit

from fgnav.checks import FloatArray


@njit(cache=True)
def fill(E: FloatArray, column: int, J: FloatArray, r: FloatArray) -> None:
    """Set a residual, negative, and its derivative by three columns."""
    end = E.shape[1] - 1
    for i in range(len(r)):
        E[i, end] = -r[i]
        for j in range(3):
            E[i, column + j] = J[i, j]


@njit(cache=True)
def put(E: FloatArray, row: int, column: int, block: FloatArray, factor: float) -> None:
    """Add a block times a factor."""
    for i in range(block.shape[0]):
        for j in range(block.shape[1]):
            E[row + i, column + j] += factor * block[i, j]


@njit(cache=True)
def whitened(white: FloatArray, E: FloatArray) -> FloatArray:
    """Return a lower triangle times a matrix."""
    out = np.zeros_like(E)
    for i in range(len(E)):
        for k in range(i + 1):
            scale = white[i, k]
            if scale != 0.0:
                for j in range(E.shape[1]):
                    out[i, j] += scale * E[k, j]
    return out


@njit(cache=True)
def add_square(out: FloatArray, E: FloatArray, first: int) -> None:
    """Add E'E to the upper triangle of a matrix, from a row and column on.

    Rows are summed up beside it: the compiler then knows that they are not E's.
    """
    n = E.shape[1]
    total = np.empty(n)
    for i in range(n):
        total[:] = 0.0
        for k in range(E.shape[0]):
            scale = E[k, i]
            if scale != 0.0:
                for j in range(n):
                    total[j] += scale * E[k, j]
        for j in range(i, n):
            out[first + i, first + j] += total[j]


@njit(cache=True)
def mirror(out: FloatArray) -> None:
    """Copy the upper triangle to the lower."""
    for i in range(len(out)):
        for j in range(i):
            out[i, j] = out[j, i]
