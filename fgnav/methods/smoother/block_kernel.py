"""Blocks of derivatives put together and squared, in plain loops; see ``link_kernel``."""

from typing import TypeAlias

import numpy as np
from numba import njit

from fgnav.checks import FloatArray

# Where parts of a state stand, and what comes after it. Plain integers would be types of their own
# to numba: it compiles a function anew for each that it is called with.
ROTATION, POSITION, VELOCITY, SLOT, NEXT = (np.int64(k) for k in (0, 3, 6, 9, 15))
TOP = np.int64(0)  # row
Place: TypeAlias = int | np.int64


@njit(cache=True)
def fill(E: FloatArray, column: Place, J: FloatArray, r: FloatArray) -> None:
    """Set a residual, negative, and its derivative by three columns."""
    end = E.shape[1] - 1
    for i in range(len(r)):
        E[i, end] = -r[i]
        for j in range(3):
            E[i, column + j] = J[i, j]


@njit(cache=True)
def put(E: FloatArray, row: Place, column: Place, block: FloatArray, factor: float) -> None:
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
def add_square(out: FloatArray, E: FloatArray) -> None:
    """Add E'E to a matrix, to its last rows and columns.

    Three rows of E at once: sums then wait less for memory, and most of E comes in threes.
    """
    m, n = E.shape
    first = len(out) - n
    for k in range(0, m - 2, 3):
        x, y, z = E[k], E[k + 1], E[k + 2]
        for i in range(n):
            a, b, c = x[i], y[i], z[i]
            if a != 0.0 or b != 0.0 or c != 0.0:
                total = out[first + i, first:]
                for j in range(n):
                    total[j] += a * x[j] + b * y[j] + c * z[j]
    for k in range(m - m % 3, m):
        for i in range(n):
            for j in range(n):
                out[first + i, first + j] += E[k, i] * E[k, j]
