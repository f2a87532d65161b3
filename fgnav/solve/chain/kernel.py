"""Block elimination along a chain of keyframes, in plain loops.

Keyframe k has a state of D dimensions (a multiple of three); b constants belong to all. With
W = D + b + 1 and J = 2 D + b + 1, what enters with it is ``motion[k]``, (D, J), whitened rows over
(state k - 1, state k, constants, minus the residual), and ``node[k]``, (W, W), the augmented
information of all else over (state k, constants, right-hand side). ``forward[k]``, (W, W), is the
augmented information of state k and the constants given all up to k: a filter's. An augmented
information A means the cost ``(x, -1) A (x, -1)'``; only upper halves are read and written.

References
----------
Barfoot, State Estimation for Robotics, 2nd edition, section 3.2.3 (Cholesky smoother).
"""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.kernels.compiled import inlined, kernel
from fgnav.solve.chain.back_kernel import backward_solve
from fgnav.solve.chain.rows_kernel import eliminate_rows

# Of a diagonal: what elimination leaves of it has lost eleven of sixteen digits; rows keep theirs.
_DIGITS_LOST = 1e-11


@kernel
def add_squares(
    node: FloatArray, into: IntArray, value: FloatArray, state: FloatArray, shared: FloatArray
) -> None:
    """Add whitened measurements, j of each, to the nodes ``into``; shapes as ``Linearised``."""
    D, b = state.shape[2], shared.shape[2]
    row = np.empty(D + b + 1)
    for j in range(len(into)):
        for m in range(value.shape[1]):
            for i in range(D):
                row[i] = state[j, m, i]
            for i in range(b):
                row[D + i] = shared[j, m, i]
            row[D + b] = -value[j, m]
            for i in range(D + b + 1):
                if row[i] != 0.0:
                    _add(node[into[j], i, i:], row[i:], row[i])


@kernel
def add_phases(
    node: FloatArray,
    columns: tuple[int, int],
    value: FloatArray,
    by_pose: FloatArray,
    by_arcs: FloatArray,
    by_lever: FloatArray,
) -> None:
    """Add whitened phases to the node of their keyframe, (W, W).

    Parameters
    ----------
    columns : tuple of int
        First of the arcs; first of the lever arm, or -1.
    value, by_pose, by_arcs, by_lever : ndarray, shapes (m,), (m, 6), (m, a), (m, 3)
        Residual, and how it changes.
    """
    arcs, lever = columns
    row = np.zeros(len(node))
    for m in range(len(value)):
        for i in range(6):
            row[i] = by_pose[m, i]
        for i in range(by_arcs.shape[1]):
            row[arcs + i] = by_arcs[m, i]
        if lever >= 0:
            for i in range(3):
                row[lever + i] = by_lever[m, i]
        row[-1] = -value[m]
        for i in range(len(row)):
            if row[i] != 0.0:
                _add(node[i, i:], row[i:], row[i])


@inlined
def _add(out: FloatArray, row: FloatArray, scale: float) -> None:
    """Add a multiple of a row; here and below slices let loops begin at 0: the processor's pace."""
    for j in range(len(out)):
        out[j] += scale * row[j]


@kernel
def eliminate(
    motion: FloatArray,
    node: FloatArray,
    forward: FloatArray,
    root: FloatArray,
    gain: FloatArray,
    by_rows: bool,
) -> int:
    """Carry the forward information of keyframe 0 to the last, n - 1.

    Parameters
    ----------
    motion, node, forward : ndarray, shape (n, ...)
        See the module. ``forward[0]`` is given, the others are filled.
    root : ndarray, shape (n - 1 or more, D, D)
        Filled with lower Cholesky factors L of the information of state k given the next.
    gain : ndarray, shape (n - 1 or more, D, W)
        Filled: ``E[x_k | rest] = gain[:, -1] - gain[:, :-1] @ (x_k+1, constants)``.
    by_rows : bool
        Whether to eliminate rows in place of their squares: slower, of twice the digits. Else rows
        are where squares have lost theirs.

    Returns
    -------
    int
        The first keyframe whose state is open, or -1.
    """
    D, J = motion.shape[1], motion.shape[2]
    joint, whole = np.empty((J, J)), np.empty(J)
    for k in range(len(motion) - 1):
        if not by_rows:
            _fill(joint, motion[k + 1], node[k + 1], forward[k])
            for i in range(J):
                whole[i] = joint[i, i]
            _triangular(joint, D)
            if _digits_left(joint, whole, D):
                _copy(joint, root[k], gain[k], forward[k + 1])
                backward_solve(root[k], gain[k])
                continue
        if not eliminate_rows(
            motion[k + 1], node[k + 1], forward[k], forward[k + 1], root[k], gain[k]
        ):
            return k
        backward_solve(root[k], gain[k])
    return -1


@inlined
def _fill(joint: FloatArray, motion: FloatArray, node: FloatArray, forward: FloatArray) -> None:
    """Fill the information of two states and the constants, three rows of the motion at once."""
    D, J = motion.shape
    for i in range(D):
        joint[i, i:] = 0.0
        _add(joint[i, i:D], forward[i, i:D], 1.0)
        _add(joint[i, 2 * D :], forward[i, D:], 1.0)
    for i in range(D, J):
        joint[i, i:] = 0.0
        _add(joint[i, i:], node[i - D, i - D :], 1.0)
        if i >= 2 * D:
            _add(joint[i, i:], forward[i - D, i - D :], 1.0)
    for k in range(0, D, 3):
        for i in range(J):
            x, y, z, row = motion[k, i:], motion[k + 1, i:], motion[k + 2, i:], joint[i, i:]
            a, b, c = x[0], y[0], z[0]
            if a != 0.0 or b != 0.0 or c != 0.0:
                for j in range(len(row)):
                    row[j] += a * x[j] + b * y[j] + c * z[j]


@inlined
def _triangular(A: FloatArray, count: int) -> None:
    """Turn the first rows of A into those of its Cholesky factor, take their square off the rest.

    A pivot that is not positive leaves NaN.
    """
    for k in range(0, count, 3):
        for p in range(k, k + 3):
            top = A[p, p:]
            scale = 1.0 / np.sqrt(top[0]) if top[0] > 0.0 else np.nan
            for j in range(len(top)):
                top[j] *= scale
            for i in range(p + 1, k + 3):
                _add(A[i, i:], top[i - p :], -top[i - p])
        for i in range(k + 3, len(A)):
            x, y, z, row = A[k, i:], A[k + 1, i:], A[k + 2, i:], A[i, i:]
            a, b, c = x[0], y[0], z[0]
            for j in range(len(row)):
                row[j] -= a * x[j] + b * y[j] + c * z[j]


@inlined
def _digits_left(A: FloatArray, whole: FloatArray, count: int) -> bool:
    """Return whether pivots, squared, and what is left of the diagonal have digits of their own.

    The last diagonal is a cost: it may vanish.
    """
    for i in range(len(A) - 1):
        left = A[i, i] ** 2 if i < count else A[i, i]
        if not left > _DIGITS_LOST * whole[i]:
            return False
    return True


@inlined
def _copy(joint: FloatArray, root: FloatArray, gain: FloatArray, forward: FloatArray) -> None:
    """Take the factor, the right-hand sides and what is left out of an eliminated matrix."""
    D, W = gain.shape
    for i in range(D):
        for j in range(i, D):
            root[j, i] = joint[i, j]
            if j > i:
                root[i, j] = 0.0
        for j in range(W):
            gain[i, j] = joint[i, D + j]
    for i in range(W):
        for j in range(W):
            forward[i, j] = joint[D + i, D + j] if j >= i else 0.0
