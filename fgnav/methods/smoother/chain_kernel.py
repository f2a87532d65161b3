"""Elimination along a chain of states and back, block by block, in plain loops.

Blocks of fifteen are too small for LAPACK: calling it would cost more than its work. Arrays are
not set to arrays, here and in the kernels that call these: for the text of an error that never
comes, numba adds so much code that a kernel takes twice as long to load.
"""

import numpy as np
from numba import njit

from fgnav.checks import BoolArray, FloatArray, IntArray

STATE = 15  # pose 6 (rotation, position), velocity 3, slot 6


@njit(cache=True)
def place(out: FloatArray, augmented: FloatArray, index: IntArray) -> None:
    """Set ``out`` to a matrix whose row and column i stand at ``index[i]``, 0 elsewhere."""
    out[:] = 0.0
    for i in range(len(index)):
        for j in range(len(index)):
            out[index[i], index[j]] = augmented[i, j]


@njit(cache=True)
def eliminate(
    link: FloatArray,
    message: FloatArray,
    root: FloatArray,
    gain: FloatArray,
    first: int,
    last: int,
) -> int:
    """Carry the message of state ``first`` on to ``last``; see ``Chain``.

    Returns the first state whose pivot is not positive, or -1.
    """
    wide = message.shape[1]
    rows = np.empty((STATE, STATE + wide))
    for k in range(first, last):
        joint, before, after, pivot, Y = link[k + 1], message[k], message[k + 1], root[k], gain[k]
        for i in range(STATE):
            for j in range(STATE + wide):
                rows[i, j] = joint[i, j]
            for j in range(STATE):
                rows[i, j] += before[i, j]
            for j in range(STATE, wide):
                rows[i, STATE + j] += before[i, j]
        if not _triangular(rows):
            return k
        for i in range(STATE):
            for j in range(STATE):
                pivot[j, i] = rows[i, j]
            for j in range(wide):
                Y[i, j] = rows[i, STATE + j]
        _pass_on(joint, before, after)
        _less_square(after, Y)
        backward(pivot, Y)
    return -1


@njit(cache=True)
def _pass_on(joint: FloatArray, before: FloatArray, after: FloatArray) -> None:
    """Fill what a link says of the later state and the border, and of that what came before."""
    for i in range(len(after)):
        for j in range(len(after)):
            after[i, j] = joint[STATE + i, STATE + j]
            if i >= STATE and j >= STATE:
                after[i, j] += before[i, j]


@njit(cache=True)
def substitute(
    gain: FloatArray, newest: FloatArray, first: int, last: int, steps: FloatArray
) -> float:
    """Fill the steps of states first to last; return twice the least cost, NaN if it has none."""
    width = steps.shape[1]
    L, end = newest[:width, :width].copy(), newest[:width, width:].copy()
    if not cholesky(L):
        return np.nan
    forward(L, end)
    least = newest[width, width] - (end[:, 0] ** 2).sum()
    backward(L, end)
    for i in range(width):
        steps[last - first, i] = end[i, 0]
    for k in range(last - 1, first - 1, -1):
        after, step = steps[k + 1 - first], steps[k - first]
        for i in range(STATE):
            step[i] = gain[k, i, width]
        for i in range(STATE, width):
            step[i] = after[i]
        for j in range(width):
            for i in range(STATE):
                step[i] -= gain[k, i, j] * after[j]
    return float(least)


@njit(cache=True)
def marginals(
    gain: FloatArray,
    root: FloatArray,
    newest: FloatArray,
    first: int,
    covariance: FloatArray,
    beside: FloatArray,
) -> FloatArray:
    """Fill the covariances of states from ``first`` on; return those of each with the next.

    ``newest`` is the covariance of the last state and the border; ``beside``, (m, 15, b), is filled
    with those of states with the border.
    """
    count, width = len(covariance), len(newest)
    cross = np.empty((count - 1, STATE, STATE))
    _split(newest, 1.0, covariance[count - 1], beside[count - 1])
    joint, alone, T = newest.copy(), np.empty((STATE, STATE)), np.empty((STATE, width))
    for k in range(count - 2, -1, -1):
        G, here = gain[first + k], covariance[k]
        _product(G, joint, T)
        alone[:] = 0.0
        for i in range(STATE):
            alone[i, i] = 1.0
        forward(root[first + k], alone)
        backward(root[first + k], alone)
        for i in range(STATE):
            for j in range(i + 1):
                total = alone[i, j]
                for c in range(width):
                    total += T[i, c] * G[j, c]
                here[i, j] = total
                here[j, i] = total
        _split(T, -1.0, cross[k], beside[k])
        for i in range(STATE):
            for j in range(STATE):
                joint[i, j] = here[i, j]
            for j in range(STATE, width):
                joint[i, j] = joint[j, i] = -T[i, j]
    return cross


@njit(cache=True)
def _split(values: FloatArray, sign: float, own: FloatArray, beside: FloatArray) -> None:
    """Fill a state's covariances with a state, (15, 15), and with the border, (15, b)."""
    for i in range(STATE):
        for j in range(STATE):
            own[i, j] = sign * values[i, j]
        for j in range(beside.shape[1]):
            beside[i, j] = sign * values[i, STATE + j]


@njit(cache=True)
def far(
    steps: FloatArray,
    t_s: FloatArray,
    slot: FloatArray,
    about: FloatArray,
    moved_rad: float,
    turned_rad: float,
) -> tuple[BoolArray, BoolArray, int]:
    """Return which rotations are far from where they are linearised, which motions' slots; count.

    The slot of a motion is that of the keyframe before.
    """
    n = len(steps)
    moved, turned = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    for k in range(n):
        moved[k] = (steps[k, :3] ** 2).sum() > moved_rad**2
        if k:
            change = slot[k - 1, 3:] + steps[k - 1, 12:15] - about[k, 3:]
            turned[k] = (t_s[k] - t_s[k - 1]) ** 2 * (change**2).sum() > turned_rad**2
    return moved, turned, moved.sum() + turned.sum()


@njit(cache=True)
def cholesky(A: FloatArray) -> bool:
    """Leave the factor in A's lower half; return whether A was positive definite."""
    n = len(A)
    for j in range(n):
        for k in range(j):
            scale = A[j, k]
            for i in range(j, n):
                A[i, j] -= A[i, k] * scale
        if not A[j, j] > 0.0:
            return False
        scale = np.sqrt(A[j, j])
        for i in range(j, n):
            A[i, j] /= scale
    return True


@njit(cache=True)
def _triangular(rows: FloatArray) -> bool:
    """Turn [A Y] into [L' L^-1 Y] with Cholesky's A = L L'; return whether A was positive definite.

    Whole rows, what is zero by then with them: long ones are the processor's own pace.
    """
    n = len(rows)
    for k in range(n):
        top = rows[k]
        if not top[k] > 0.0:
            return False
        scale = 1.0 / np.sqrt(top[k])
        for j in range(rows.shape[1]):
            top[j] *= scale
        for i in range(k + 1, n):
            row, share = rows[i], top[i]
            for j in range(rows.shape[1]):
                row[j] -= share * top[j]
    return True


@njit(cache=True)
def _less_square(A: FloatArray, Y: FloatArray) -> None:
    """Take Y' Y off A, three of Y's fifteen rows at once."""
    for k in range(0, STATE, 3):
        x, y, z = Y[k], Y[k + 1], Y[k + 2]
        for i in range(len(A)):
            row, a, b, c = A[i], x[i], y[i], z[i]
            for j in range(len(A)):
                row[j] -= a * x[j] + b * y[j] + c * z[j]


@njit(cache=True)
def _product(A: FloatArray, B: FloatArray, out: FloatArray) -> None:
    """Set ``out`` to the product of A's first columns with a square B."""
    out[:] = 0.0
    for i in range(len(out)):
        for k in range(len(B)):
            scale = A[i, k]
            for j in range(len(B)):
                out[i, j] += scale * B[k, j]


@njit(cache=True)
def forward(L: FloatArray, Y: FloatArray) -> None:
    """Solve L X = Y in place."""
    for i in range(len(L)):
        for k in range(i):
            scale = L[i, k]
            for j in range(Y.shape[1]):
                Y[i, j] -= scale * Y[k, j]
        for j in range(Y.shape[1]):
            Y[i, j] /= L[i, i]


@njit(cache=True)
def backward(L: FloatArray, Y: FloatArray) -> None:
    """Solve L' X = Y in place."""
    for i in range(len(L) - 1, -1, -1):
        for k in range(i + 1, len(L)):
            scale = L[k, i]
            for j in range(Y.shape[1]):
                Y[i, j] -= scale * Y[k, j]
        for j in range(Y.shape[1]):
            Y[i, j] /= L[i, i]
