"""Elimination along a chain by rows, not squares: for states that are hardly known.

Normal equations hold a motion's information, 1e7 per square metre and more, beside what is known of
a place by then, and sixteen digits are all they have: after a minute without a fix nothing of a
position is left that rounding did not write. Rows whose square is the information keep their own
digits: Householder's triangle of the rows is Cholesky's root, at ten times the work.
"""

import numpy as np
from numba import njit

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.methods.smoother.chain_kernel import STATE, backward

_NOTHING = 1e-13  # of a diagonal: less than that is rounding


@njit(cache=True)
def eliminate_rows(
    link: FloatArray,
    message: FloatArray,
    root: FloatArray,
    gain: FloatArray,
    first: int,
    last: int,
) -> int:
    """Carry the message of state ``first`` on to ``last``, as ``chain_kernel.eliminate`` does.

    Returns the first state that nothing determines, or -1.

    References
    ----------
    Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, chapter V.
    """
    wide, joint = message.shape[1], link.shape[1]
    rows = np.zeros((wide + joint, joint))
    own, all_of_it = np.arange(wide), np.arange(joint)  # where columns stand in a link
    own[STATE:] += STATE
    for k in range(first, last):
        rows[:] = 0.0
        count = roots(message[k].copy(), 0, rows, 0, own)
        count += roots(link[k + 1].copy(), STATE, rows, count, all_of_it)
        if not triangle(rows, count, STATE):
            return k
        root[k] = rows[:STATE, :STATE].T
        gain[k] = rows[:STATE, STATE:]
        backward(root[k], gain[k])
        rest = rows[STATE:count, STATE:].copy()
        message[k + 1] = rest.T @ rest
    return -1


@njit(cache=True)
def roots(M: FloatArray, kept: int, out: FloatArray, first: int, place: IntArray) -> int:
    """Fill rows of ``out``, from ``first`` on, whose square is a matrix; return their number.

    Columns go where ``place`` says. The first ``kept`` pivots are taken in their order, so that
    what is left of the others is exact where it is nothing; what rounding leaves of a diagonal has
    no row. ``M`` is overwritten.
    """
    n, count = len(M), 0
    whole, done = np.empty(n), np.zeros(n, np.bool_)
    for i in range(n):
        whole[i] = M[i, i]
    for step in range(n):
        pivot = step if step < kept else _largest(M, whole, done)
        done[pivot] = True
        if not M[pivot, pivot] > _NOTHING * whole[pivot]:
            continue
        row, scale = np.zeros(n), np.sqrt(M[pivot, pivot])
        for j in range(n):
            if not done[j] or j == pivot:
                row[j] = M[pivot, j] / scale
                out[first + count, place[j]] = row[j]
        for i in range(n):
            for j in range(n):
                M[i, j] -= row[i] * row[j]
        count += 1
    return count


@njit(cache=True)
def _largest(M: FloatArray, whole: FloatArray, done: BoolArray) -> int:
    """Return which diagonal has kept the largest share of itself, of those not done."""
    pivot, most = -1, -np.inf
    for i in range(len(M)):
        share = M[i, i] / whole[i] if whole[i] > 0.0 else 0.0
        if not done[i] and (pivot < 0 or share > most):
            pivot, most = i, share
    return pivot


@njit(cache=True)
def triangle(rows: FloatArray, count: int, columns: int) -> bool:
    """Turn the first columns of some rows into a triangle of positive diagonal, by reflections.

    Returns whether no diagonal is zero beside its column.
    """
    for c in range(columns):
        above, below = 0.0, 0.0
        for i in range(c):
            above += rows[i, c] ** 2
        for i in range(c, count):
            below += rows[i, c] ** 2
        if not below > _NOTHING**2 * (above + below):
            return False
        _reflect(rows, c, count, np.sqrt(below))
    return True


@njit(cache=True)
def _reflect(rows: FloatArray, c: int, count: int, size: float) -> None:
    """Turn a column, from its diagonal down, into its size and zeros."""
    up = 1.0 if rows[c, c] > 0.0 else -1.0
    head = rows[c, c] + up * size
    twice = 2 / (head**2 + size**2 - rows[c, c] ** 2)
    for j in range(c + 1, rows.shape[1]):
        along = head * rows[c, j]
        for i in range(c + 1, count):
            along += rows[i, c] * rows[i, j]
        for i in range(c + 1, count):
            rows[i, j] -= twice * along * rows[i, c]
        rows[c, j] = -up * (rows[c, j] - twice * along * head)  # its sign makes ``size`` positive
    rows[c, c] = size
    for i in range(c + 1, count):
        rows[i, c] = 0.0
