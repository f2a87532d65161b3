"""The orthonormal columns nearest to given ones, in the metric of an information matrix.

One column is ``nearest_direction``. Two or three columns are the first columns of a rotation:
Gauss-Newton from the orthonormalised columns.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotation_kernel import exp, product, transposed
from fgnav.integers.array.nearest_direction import nearest_direction
from fgnav.integers.array.principal_axes import principal_axes
from fgnav.integers.ils.float_solution import solve_symmetric
from fgnav.kernels.compiled import kernel

_STEPS = 20
_HALVINGS = 6
_EXACT = 1e-7  # of the squared distance, whose unit is one variance
_STARTS, _DESCENTS = 6, 2
_WEAK = 0.01  # one sigma of a tenth of their length


@kernel
def nearest(
    columns: FloatArray, information: FloatArray, weak_axis: FloatArray
) -> tuple[float, FloatArray]:
    """Return the least squared distance of orthonormal columns, and those columns.

    Parameters
    ----------
    columns : ndarray, shape (3 r,)
        One after the other; r is 1, 2 or 3.
    information : ndarray, shape (3 r, 3 r)
        The metric.
    weak_axis : ndarray, shape (3,)
        As ``weak_axis`` returns.

    Returns
    -------
    float
    ndarray, shape (3 r,)
    """
    if len(columns) == 3:
        M = nearest_direction(columns, information)
        return _distance(M, columns, information), M
    weak = weak_axis[0] != 0.0 or weak_axis[1] != 0.0 or weak_axis[2] != 0.0
    distance = np.empty(_STARTS if weak else 1)
    starts = np.empty((len(distance), len(columns)))
    for i in range(len(distance)):
        start = _start(columns, weak_axis, i)
        distance[i] = _distance(start, columns, information)
        for c in range(len(columns)):
            starts[i, c] = start[c]
    best, M = np.inf, columns
    for _ in range(_DESCENTS if weak else 1):
        nearest_start = 0
        for i in range(1, len(distance)):
            if distance[i] < distance[nearest_start]:
                nearest_start = i
        distance[nearest_start] = np.inf
        trial_cost, rotated = _descend(starts[nearest_start], columns, information)
        if trial_cost < best:
            best, M = trial_cost, rotated
    return best, M


@kernel
def weak_axis(information: FloatArray, variance: float) -> FloatArray:
    """Return the axis of ``n`` along which the metric knows least of the columns.

    Zeros where they are known well enough, however far off, by the sum of their variances: then
    orthonormalising them leads to the nearest minimum. Otherwise there may be several, as
    satellites near a plane make them.
    """
    if variance < _WEAK:
        return np.zeros(3)
    across = np.zeros((3, 3))
    for c in range(len(information)):
        for i in range(3):
            across[c % 3, i] += information[c, c - c % 3 + i]
    axes = principal_axes(across)[1]
    least = np.empty(3)
    for i in range(3):
        least[i] = axes[i, 0]
    return least


@kernel
def _start(columns: FloatArray, axis: FloatArray, start: int) -> FloatArray:
    """Return columns to start from: four turn the array, two complete lengths along the axis."""
    if start < 4:
        upright, turn_rad = orthonormal(columns), np.zeros(3)
        _add(turn_rad, 0.5 * np.pi * start, upright[:3])
        return _rotated(upright, turn_rad)
    sign = 2.0 * start - 9.0
    out = columns.copy()
    along = np.zeros(len(columns) // 3)
    for u in range(len(along)):
        column = out[3 * u : 3 * u + 3]
        _add(column, -_dot(column, axis), axis)
        along[u] = sign * np.sqrt(max(0.0, 1.0 - _dot(column, column)))
    if _dot(out[:3], out[3:6]) * along[0] * along[1] > 0.0:
        along[1] = -along[1]
    for u in range(2):
        _add(out[3 * u : 3 * u + 3], along[u], axis)
    return orthonormal(out)


@kernel
def orthonormal(columns: FloatArray) -> FloatArray:
    """Return right-handed orthonormal columns: the first keeps its direction, the second its plane.

    Columns that leave a direction open get an arbitrary one.
    """
    out = columns.copy()
    first = out[:3]
    if not _normalised(first):
        first[0] = 1.0
    if len(columns) > 3:
        second = out[3:6]
        _add(second, -_dot(second, first), first)
        if not _normalised(second):
            second[0 if abs(first[0]) < 0.7 else 1] = 1.0
            _add(second, -_dot(second, first), first)
            _normalised(second)
        if len(columns) > 6:
            _cross(first, second, out[6:])
    return out


@kernel
def log_volume(M: FloatArray, information: FloatArray) -> float:
    """Return minus half the log determinant of the information on the attitude behind M.

    Two angles for one column, three for more: the log volume of a Gaussian around M, without the
    powers of 2 pi that all candidates share.
    """
    H = normal_matrix(tangent(M), information)
    return half_log_determinant(H, np.zeros(len(H)))


@kernel
def half_log_determinant(H: FloatArray, smallest: FloatArray) -> float:
    """Return minus half the log determinant of a matrix, spoilt, with pivots of a least size."""
    logarithm = 0.0
    for i in range(len(H)):
        pivot = max(H[i, i], smallest[i])
        logarithm += np.log(pivot)
        for j in range(i + 1, len(H)):
            factor = H[i, j] / pivot
            for c in range(j, len(H)):
                H[j, c] -= factor * H[i, c]
    return -0.5 * logarithm


# Vectors are handled in place, in plain loops: numba compiles those in a third of the time.
@kernel
def _dot(a: FloatArray, b: FloatArray) -> float:
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@kernel
def _add(a: FloatArray, factor: float, b: FloatArray) -> None:
    for i in range(len(a)):
        a[i] += factor * b[i]


@kernel
def _normalised(v: FloatArray) -> bool:
    """Scale to length 1, or to 0 where there is no direction."""
    length = np.sqrt(_dot(v, v))
    has_direction = length > 1e-9
    for i in range(len(v)):
        v[i] = v[i] / length if has_direction else 0.0
    return bool(has_direction)


@kernel
def _cross(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = a[j] * b[k] - a[k] * b[j]


@kernel
def tangent(M: FloatArray) -> FloatArray:
    """Return the derivative of M by a turn about the axes of ``n``, (3 r, 3).

    One column does not feel the turn about itself: (3, 2), by two turns across it.
    """
    J = np.zeros((len(M), 3))
    for u in range(0, len(M), 3):
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            J[u + k, i] = M[u + j]
            J[u + j, i] = -M[u + k]
    if len(M) > 3:
        return J
    bare = np.zeros(9)
    for i in range(3):
        bare[i] = M[i]
    axes = orthonormal(bare)
    across = np.zeros((3, 2))
    for i in range(3):
        across[i, 0], across[i, 1] = axes[3 + i], axes[6 + i]
    return across


@kernel
def normal_matrix(J: FloatArray, information: FloatArray) -> FloatArray:
    """Return ``J^T information J``."""
    n, u = J.shape
    weighted = np.zeros((u, n))
    for i in range(n):
        for j in range(n):
            for c in range(u):
                weighted[c, j] += J[i, c] * information[i, j]
    out = np.zeros((u, u))
    for c in range(u):
        for i in range(n):
            for d in range(u):
                out[c, d] += weighted[c, i] * J[i, d]
    return out


@kernel
def _distance(M: FloatArray, columns: FloatArray, information: FloatArray) -> float:
    total = 0.0
    for i in range(len(M)):
        row = 0.0
        for j in range(len(M)):
            row += information[i, j] * (M[j] - columns[j])
        total += row * (M[i] - columns[i])
    return total


@kernel
def _descend(
    start: FloatArray, columns: FloatArray, information: FloatArray
) -> tuple[float, FloatArray]:
    M = start.copy()
    cost = _distance(M, columns, information)
    for _ in range(_STEPS):
        J = tangent(M)
        residual = M.copy()
        _add(residual, -1.0, columns)
        step = _newton_step(J, information, residual)
        gained = False
        for _ in range(_HALVINGS):
            rotated = _rotated(M, step)
            trial_cost = _distance(rotated, columns, information)
            if trial_cost <= cost:
                gained = cost - trial_cost > _EXACT
                cost, M = trial_cost, rotated
                break
            _add(step, -0.6, step)
        if not gained:
            break
    return cost, M


@kernel
def _newton_step(J: FloatArray, information: FloatArray, residual: FloatArray) -> FloatArray:
    H = normal_matrix(J, information)
    g = np.zeros(3)
    for i in range(len(residual)):
        row = _dot(information[i], residual)
        for c in range(3):
            g[c] -= J[i, c] * row
    return solve_symmetric(H, g.reshape(3, 1)).reshape(3)


@kernel
def _rotated(M: FloatArray, turn_rad: FloatArray) -> FloatArray:
    """Turn every column about the axes of ``n``."""
    return product(M.reshape(len(M) // 3, 3), transposed(exp(turn_rad))).reshape(len(M))
