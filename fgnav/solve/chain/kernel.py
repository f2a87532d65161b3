"""Block elimination along a chain of keyframes, in plain loops.

Keyframe k has a state of D dimensions (a multiple of three); b constants belong to all, and beside
them may stand a more variables, of which the motion knows nothing. With W = D + b + a + 1, what
enters with it is ``motion[k]``, (D, 2 D + b + 1), whitened rows over (state k - 1, state k,
constants, minus the residual), and ``node[k]``, (W, W), the augmented information of all else over
(state k, constants, those beside, right-hand side). ``forward[k]``, (W, W), is the augmented
information of state k and the shared given all up to k: a filter's. An augmented information A
means the cost ``(x, -1) A (x, -1)'``; only upper halves are read and written.

References
----------
Barfoot, State Estimation for Robotics, 2nd edition, section 3.2.3 (Cholesky smoother).
"""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.factors.antenna_phase import residual
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
    into: IntArray,
    columns: tuple[int, int],
    places: tuple[FloatArray, FloatArray, FloatArray],
    arcs: FloatArray,
    first: IntArray,
    shape: IntArray,
    rows: tuple[FloatArray, FloatArray, FloatArray],
) -> None:
    """Add whitened phases of j epochs to the nodes ``into``, (j,), of their keyframes.

    Parameters
    ----------
    columns : tuple of int
        First of the arcs; first of the lever arm, or -1.
    places : tuple of ndarray, shapes (j, 3, 3), (j, 3), (j, 3)
        R_nb, p_n_m, and the lever arm in body axes.
    arcs : ndarray
        Where all A are linearised; each epoch's stands from ``first``, (j,), on.
    shape, rows : ndarray, tuple of ndarray
        Of ``StackedRows``: its G, H and z.
    """
    (by_arcs, by_lever), (R_nb, p_n_m, arm_b_m), (G, H, z) = columns, places, rows
    pose, a, h = np.empty((4, 4)).T, 0, 0  # as GTSAM's are: another order would be compiled anew
    row = np.zeros(node.shape[1])
    for j in range(len(into)):
        (m, d), out = shape[j], node[into[j]]
        for i in range(3):
            pose[i, 3] = p_n_m[j, i]
            for k in range(3):
                pose[i, k] = R_nb[j, i, k]
        A, H_j = arcs[first[j] : first[j] + d], H[h : h + m * d].reshape((m, d))
        value, of_pose, of_lever = residual(pose, A, arm_b_m[j], G[a : a + m], H_j, z[a : a + m])
        row[:] = 0.0
        for k in range(m):
            for i in range(6):
                row[i] = of_pose[k, i]
            for i in range(d):
                row[by_arcs + i] = H_j[k, i]
            for i in range(3 if by_lever >= 0 else 0):
                row[by_lever + i] = of_lever[k, i]
            row[-1] = -value[k]
            for i in range(len(row)):
                if row[i] != 0.0:
                    _add(out[i, i:], row[i:], row[i])
        a, h = a + m, h + m * d


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
    D = motion.shape[1]
    J = D + node.shape[1]
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
    """Fill the information of two states and what is shared, three rows of the motion at once."""
    D, last, J = motion.shape[0], motion.shape[1] - 1, len(joint)
    of_motion = np.empty(last + 1)
    for i in range(J):
        row = joint[i, i:]
        row[:] = 0.0
        if i >= D:
            _add(row, node[i - D, i - D :], 1.0)
        if i < D:
            _add(row[: D - i], forward[i, i:D], 1.0)
            _add(row[2 * D - i :], forward[i, D:], 1.0)
        elif i >= 2 * D:
            _add(row, forward[i - D, i - D :], 1.0)
        if i >= last and i < J - 1:
            continue
        column = min(i, last)
        added = of_motion[column:]
        added[:] = 0.0
        for k in range(0, D, 3):
            x, y, z = motion[k, column:], motion[k + 1, column:], motion[k + 2, column:]
            a, b, c = x[0], y[0], z[0]
            if a != 0.0 or b != 0.0 or c != 0.0:
                for j in range(len(added)):
                    added[j] += a * x[j] + b * y[j] + c * z[j]
        _add(row[: last - column], added[:-1], 1.0)
        row[len(row) - 1] += of_motion[last]


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
