"""Whether the phases of an antenna agree with each other: its satellites are more than it needs.

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

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.factors.antenna_phase import AntennaPhase, ArcBlock


def phase_innovations(phase: AntennaPhase) -> tuple[FloatArray, IntArray]:
    """Return the innovation squared of each epoch, (k,), and its degrees of freedom, (k,)."""
    squared, freedom = np.zeros(len(phase.row)), np.zeros(len(phase.row), dtype=np.int64)
    root, last, known = np.zeros((0, phase.blocks[0].before.shape[1] + 1)), -1, 0
    for i, (G, H, z) in enumerate(phase.rows):
        while last < phase.block[i] - phase.first_block:
            last += 1
            root = _led_on(root, phase.blocks[last])
            known = _rank(root)
        across = np.linalg.qr(G, mode="complete")[0][:, 3:]
        seen = np.column_stack([across.T @ H, across.T @ z])
        root, squared[i] = _triangular(np.vstack([root, seen]))
        before, whole = known, known == root.shape[1] - 1  # nothing is open that they could tell
        known = known if whole else _rank(root)
        freedom[i] = len(seen) + before - known
    return squared, freedom


def _led_on(root: FloatArray, block: ArcBlock) -> FloatArray:
    """Return what is known of a block's arcs by those of the block before."""
    d = block.before.shape[1]
    known = np.zeros((len(root), block.size))
    rows = np.block(
        [
            [root[:, :d], known, root[:, d:]],
            [-block.before, block.after, block.right[:, None]],
        ]
    )
    return _triangular(np.asarray(np.linalg.qr(rows)[1])[d:, d:])[0]


def _triangular(rows: FloatArray) -> tuple[FloatArray, float]:
    """Return a system ``[A | y]`` as at most d rows, and the square of what is left over."""
    d = rows.shape[1] - 1
    upper = np.asarray(np.linalg.qr(rows)[1])
    left = float((upper[d:, d] ** 2).sum())
    return upper[:d], left


def _rank(root: FloatArray) -> int:
    return int(np.linalg.matrix_rank(root[:, :-1])) if root.size else 0
