"""Elimination of the arcs that end between two keyframes, in plain loops.

Matrices of a few tens of rows: a threaded BLAS spends more time waiting for its threads than on
them, and rounds by its number of columns.
"""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.kernels.compiled import inlined, kernel
from fgnav.solve.chain.back_kernel import backward_solve, less_rows, triangular


@kernel
def change_arcs(
    forward: FloatArray,
    size: int,
    width: int,
    before: FloatArray,
    after: FloatArray,
    right: FloatArray,
) -> tuple[bool, FloatArray, FloatArray]:
    """Turn the information of a keyframe, in place, into that with the A of the next block.

    Parameters
    ----------
    forward : ndarray, shape (W, W)
        Upper half, see ``kernel``; its A has ``size`` dimensions of ``width``.
    size, width : int
    before, after, right : ndarray
        Of the next ``ArcBlock``.

    Returns
    -------
    is_known : bool
        Whether the data leave nothing of A open.
    root : ndarray, shape (size, size)
        Lower Cholesky factor of its information given the others.
    gain : ndarray, shape (size, n - size)
        ``E[A | others] = gain[:, -1] - gain[:, :-1] @ others``.
    """
    W, new = len(forward), after.shape[1]
    first = W - 1 - width  # of A
    order = np.empty(first + size + 1, np.int64)
    for i in range(size):
        order[i] = first + i
    for i in range(first):
        order[size + i] = i
    order[first + size] = W - 1
    # Not as wide as the widest A of the flight, or what comes later would change the rounding of
    # what was before.
    is_known, joint = lead_on(forward, order, size, (before, after, right), np.ones(len(right)))
    root, gain = np.zeros((size, size)), joint[:size, size:].copy()
    if not is_known:
        return False, root, gain
    for i in range(size):
        for j in range(i + 1):
            root[i, j] = joint[j, i]
    backward_solve(root, gain)
    remaining = joint[size:, size:]
    end = first + new
    for i in range(W):
        for j in range(W):
            forward[i, j] = 0.0
        if i < end:
            for j in range(i, end):
                forward[i, j] = remaining[i, j]
            forward[i, W - 1] = remaining[i, end]
        else:
            forward[i, i] = 1.0
    forward[W - 1, W - 1] = remaining[end, end]
    return True, root, gain


@kernel
def lead_on(
    information: FloatArray,
    order: IntArray,
    size: int,
    rows: tuple[FloatArray, FloatArray, FloatArray],
    weight: FloatArray,
) -> tuple[bool, FloatArray]:
    """Lead information of a block's A on to the A' of the next block, and eliminate A.

    Parameters
    ----------
    information : ndarray
        Augmented, upper half, of A, of others and the right-hand side.
    order : ndarray of int, shape (size + m + 1,)
        Where A, others and the right-hand side stand in it.
    size : int
        Dimensions of A; ``before`` may have no column at all: then nothing leads on from A.
    rows : tuple of ndarray, shapes (q, size or 0), (q, size'), (q,)
        ``before``, ``after`` and ``right`` of the next ``ArcBlock``.
    weight : ndarray, shape (q,)
        Of the squares of ``after A' - before A - right``.

    Returns
    -------
    is_known : bool
        Whether the data leave nothing of A open.
    joint : ndarray, shape (size + m + size' + 1,) * 2
        Of A, others, A' and the right-hand side, upper half: first the rows of A of the Cholesky
        factor, then the information of the others.
    """
    before, after, right = rows
    m, new = len(order) - 1, after.shape[1]
    n = m + new + 1
    joint, row = np.zeros((n, n)), np.zeros(n)
    for i in range(m + 1):
        for j in range(i, m + 1):
            a, b = min(order[i], order[j]), max(order[i], order[j])
            joint[i if i < m else n - 1, j if j < m else n - 1] = information[a, b]
    for k in range(len(right)):
        for i in range(before.shape[1]):
            row[i] = -before[k, i]
        for i in range(new):
            row[m + i] = after[k, i]
        row[n - 1] = right[k]
        for i in range(n):
            scale = weight[k] * row[i]
            if scale != 0.0:
                _add(joint[i, i:], row[i:], scale)
    return triangular(joint, size), joint


@inlined
def _add(out: FloatArray, row: FloatArray, scale: float) -> None:
    """Add a multiple of a row."""
    for j in range(len(out)):
        out[j] += scale * row[j]


@kernel
def covariance_before(root: FloatArray, gain: FloatArray, joint: FloatArray, width: int) -> None:
    """Turn the covariance of (state, constants, A'), in place, into that of the A before.

    Which has root and gain as of ``change_arcs``; ``width`` is of the widest A.
    """
    size, n, taken = len(root), len(joint), gain.shape[1] - 1
    first = n - width
    rows = covariance_of_first(root, gain, joint[:taken, :taken].copy())
    for i in range(n):
        for j in range(first if i < first else 0, n):
            joint[i, j] = 0.0
    for i in range(size):
        for j in range(first):
            joint[first + i, j] = joint[j, first + i] = rows[i, j]
        for j in range(size):
            joint[first + i, first + j] = rows[i, taken + j]
    for i in range(first + size, n):
        joint[i, i] = 1.0


@inlined
def covariance_of_first(root: FloatArray, gain: FloatArray, others: FloatArray) -> FloatArray:
    """Return rows of the joint covariance of what was eliminated, (size, m + size).

    With the others, whose covariance is given, (m, m), and of it with itself.
    """
    size, m = len(root), len(others)
    out, inverse = np.zeros((size, m + size)), np.zeros((size, size))
    turned, column = np.empty((m, size)), np.empty(size)
    for i in range(size):
        less_rows(out[i, :m], gain[i, :m], others)
        for k in range(m):
            turned[k, i] = gain[i, k]
        less_rows(inverse[i, :i], root[i], inverse[:i])
        inverse[i, i] = 1.0
        for j in range(i + 1):
            inverse[i, j] /= root[i, i]
    for i in range(size):
        for k in range(i, size):
            column[k] = -inverse[k, i]
        row = out[i, m : m + i + 1]
        less_rows(row, column[i:], inverse[i:])
        less_rows(row, out[i, :m], turned)
    for i in range(size):
        for j in range(i):
            out[j, m + i] = out[i, m + j]
    return out
