"""One step of elimination by rows, not squares: for states that are hardly known.

Normal equations add a motion's information, 1e7 per square metre and more, to what is known of a
position by then, and sixteen digits are all they have: after a minute without a fix, or where the
motion is so slow that its noise is next to nothing, rounding is what is left of the difference.
Rows whose square is the information keep their digits: Householder's triangle of the rows is
Cholesky's factor, at several times the work.

References
----------
Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, chapter V.
"""

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.kernels.compiled import inlined, inner, inner_with
from fgnav.solve.chain.back_kernel import NOTHING


@inlined
def eliminate_rows(
    motion: FloatArray,
    node: FloatArray,
    before: FloatArray,
    after: FloatArray,
    root: FloatArray,
    gain: FloatArray,
) -> bool:
    """Carry forward information one keyframe on; shapes as in ``kernel.eliminate``.

    ``gain`` is left as the right-hand side of the factor's transpose. Returns whether the data
    determine the state given the next one.
    """
    D, last = motion.shape[0], motion.shape[1] - 1
    J = D + len(node)
    columns = np.zeros((J, 2 * J - D))  # one row of the system in each column
    for m in range(D):
        for j in range(last):
            columns[j, m] = motion[m, j]
        columns[J - 1, m] = motion[m, last]
    count = D
    for later in range(2):  # a literal would be a type of its own, and compiled twice
        count = _square_root(node if later else before, D, later, columns, count)
    if not _triangle(columns, count, D):
        return False
    for i in range(D):
        for j in range(D):
            root[j, i] = columns[j, i] if j >= i else 0.0
        for j in range(J - D):
            gain[i, j] = columns[D + j, i]
    _square(columns[D:, D:count], after)
    return True


@inner_with(fastmath={"reassoc"})
def _square(columns: FloatArray, out: FloatArray) -> None:
    """Set the upper half of ``out`` to the products of rows, the lower to zero."""
    for i in range(len(out)):
        for j in range(len(out)):
            total = 0.0
            if j >= i:
                one, other = columns[i], columns[j]
                for r in range(len(one)):
                    total += one[r] * other[r]
            out[i, j] = total


@inner
def _square_root(A: FloatArray, D: int, later: int, columns: FloatArray, count: int) -> int:
    """Append rows whose square is A, by Cholesky with pivots; return how many there are by then.

    A belongs to the later state and the constants, or else to the earlier one and the constants.
    What rounding leaves of a diagonal has no row.
    """
    n = len(A)
    M, whole, done = np.empty((n, n)), np.empty(n), np.zeros(n, np.bool_)
    for i in range(n):
        whole[i] = A[i, i]
        for j in range(i, n):
            M[i, j] = M[j, i] = A[i, j]
    for _ in range(n):
        pivot = _largest(M, whole, done)
        done[pivot] = True
        if not M[pivot, pivot] > NOTHING * whole[pivot]:
            continue
        scale = np.sqrt(M[pivot, pivot])
        for j in range(n):
            if j == pivot or not done[j]:
                columns[j + D if later or j >= D else j, count] = M[pivot, j] / scale
        _take_off(M, pivot, done)
        count += 1
    return count


@inlined
def _take_off(M: FloatArray, pivot: int, done: BoolArray) -> None:
    """Take a pivot's square off what is not done."""
    for i in range(len(M)):
        share = 0.0 if done[i] else M[pivot, i] / M[pivot, pivot]
        if share != 0.0:
            for j in range(len(M)):
                M[i, j] -= share * M[pivot, j]


@inlined
def _largest(M: FloatArray, whole: FloatArray, done: BoolArray) -> int:
    """Return which diagonal has kept the largest share of itself, of those not done."""
    pivot, most = -1, -np.inf
    for i in range(len(M)):
        share = M[i, i] / whole[i] if whole[i] > 0.0 else 0.0
        if not done[i] and (pivot < 0 or share > most):
            pivot, most = i, share
    return pivot


@inner_with(fastmath={"reassoc"})  # sums in any order: four times the pace
def _triangle(columns: FloatArray, count: int, D: int) -> bool:
    """Turn the first D columns of ``count`` rows into a triangle of positive diagonal.

    Householder's reflections. Returns whether no diagonal is zero beside its column.
    """
    for c in range(D):
        column, above, below = columns[c, c:count], 0.0, 0.0
        for i in range(c):
            above += columns[c, i] ** 2
        for i in range(len(column)):
            below += column[i] ** 2
        if not below > NOTHING**2 * (above + below):
            return False
        head, size = column[0], np.sqrt(below)
        up = 1.0 if head > 0.0 else -1.0
        column[0] += up * size
        twice = 2 / (column[0] ** 2 + below - head**2)
        for j in range(c + 1, len(columns)):
            other, along = columns[j, c:count], 0.0
            for i in range(len(column)):
                along += column[i] * other[i]
            along *= twice
            for i in range(len(column)):
                other[i] -= along * column[i]
            other[0] *= -up  # so that the diagonal is positive
        column[0] = size
        for i in range(1, len(column)):
            column[i] = 0.0
    return True
