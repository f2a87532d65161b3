"""Test the redundant phases of an antenna against each other.

Of each epoch the place is eliminated, so that no motion is asked; what is left of the rows
(``factors.antenna_phase``), the information of the arcs from epochs before,

    R A = y + white noise of variance 1

and what leads from block to block stand in one linear system, which orthogonal matrices make
triangular [1]_. What is left over is the epoch's innovation, its square of the chi-square
distribution.

References
----------
.. [1] Bierman: Factorization Methods for Discrete Sequential Estimation, 1977, chapter V.
"""

import numpy as np
from scipy.linalg.lapack import dtpqrt, dtrcon

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.factors.antenna_phase import AntennaPhase, ArcBlock

_TOGETHER = 8  # columns: LAPACK's blocks, by which 90 take .1 ms


def phase_innovations(phase: AntennaPhase) -> tuple[FloatArray, IntArray]:
    """Return the innovation squared of each epoch, (k,), and its degrees of freedom, (k,)."""
    squared, freedom = np.zeros(len(phase.row)), np.zeros(len(phase.row), dtype=np.int64)
    before, block, rank = phase.blocks[0].before.shape[1], phase.first_block - 1, 0
    root = np.zeros((before + 1, before + 1))  # triangular: of A and y
    for i, number in enumerate(phase.block.tolist()):
        while block < number:
            block += 1
            root = _propagated(root, phase.blocks[block - phase.first_block])
            rank = _rank(root)
        H, z = phase.rows[i].without_place()
        root, squared[i] = _updated(root, np.column_stack([H, z]))
        is_full = rank == len(root) - 1  # nothing is open to tell
        previous, rank = rank, rank if is_full else _rank(root)
        freedom[i] = len(z) + previous - rank
    return squared, freedom


def _propagated(root: FloatArray, block: ArcBlock) -> FloatArray:
    """Propagate the arcs of the previous block to a block.

    As a triangular system ``[A | y]``, (d + 1, d + 1), as that before is.
    """
    d, size = block.before.shape[1], block.size
    rows = np.zeros((d + len(block.right), d + size + 1))
    rows[:d, :d], rows[:d, -1] = root[:d, :d], root[:d, d]
    rows[d:, :d], rows[d:, d:-1], rows[d:, -1] = -block.before, block.after, block.right
    triangular = np.asarray(np.linalg.qr(rows, mode="r"))
    after, out = triangular[d : d + size, d:], np.zeros((size + 1, size + 1))
    out[: len(after)] = after
    return out


def _updated(root: FloatArray, rows: FloatArray) -> tuple[FloatArray, float]:
    """Return a triangular system with further rows, and the square of what is left over."""
    taken = dtpqrt(0, min(_TOGETHER, len(root)), root, rows)[0] if len(rows) else root.copy()
    left, taken[-1, -1] = float(taken[-1, -1] ** 2), 0.0
    return taken, left


def _rank(root: FloatArray) -> int:
    """Compute the rank of A, by singular values only where it may be deficient.

    The least of d is no less than the reciprocal condition in the 1-norm over d, times the largest.
    """
    A = root[:-1, :-1]
    d = len(A)
    if d and dtrcon(A)[0] > d**2 * np.finfo(float).eps:
        return d
    return int(np.linalg.matrix_rank(A)) if d else 0
