"""Rotations and small matrices one at a time, for the kernels of filters.

Plain loops over contiguous arrays: numba takes seconds to compile slices and sums of arrays.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.kernels.compiled import kernel

SMALL_RAD = 1e-5  # below, series are exact to double precision
_BERNOULLI_RAD = 0.2  # below, four terms are exact to 1e-12


@kernel
def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a b, any shapes."""
    out = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for m in range(a.shape[1]):
            if a[i, m] != 0.0:
                for j in range(b.shape[1]):
                    out[i, j] += a[i, m] * b[m, j]
    return out


@kernel
def put(a: FloatArray, out: FloatArray) -> None:
    """Fill a matrix with as many rows and columns of another, from its first."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = a[i, j]


@kernel
def transposed(a: FloatArray) -> FloatArray:
    """Return a', any shape."""
    out = np.empty((a.shape[1], a.shape[0]))
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            out[j, i] = a[i, j]
    return out


@kernel
def times(a: FloatArray, v: FloatArray) -> FloatArray:
    """Return a v, any shapes."""
    out = np.zeros(a.shape[0])
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            out[i] += a[i, j] * v[j]
    return out


@kernel
def scaled(v: FloatArray, factor: float) -> FloatArray:
    """Return a vector times a number."""
    out = np.empty(len(v))
    for i in range(len(v)):
        out[i] = factor * v[i]
    return out


@kernel
def inverse(S: FloatArray) -> tuple[FloatArray, float]:
    """Return inverse and determinant of a matrix, (3, 3), by its adjugate."""
    W = np.empty((3, 3))
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            c, d = (j + 1) % 3, (j + 2) % 3
            W[j, i] = S[a, c] * S[b, d] - S[a, d] * S[b, c]
    determinant = S[0, 0] * W[0, 0] + S[0, 1] * W[1, 0] + S[0, 2] * W[2, 0]
    for i in range(3):
        for j in range(3):
            W[i, j] /= determinant
    return W, determinant


@kernel
def exp(v: FloatArray) -> FloatArray:
    """Return the rotation of a rotation vector, (3, 3)."""
    square = v[0] ** 2 + v[1] ** 2 + v[2] ** 2
    angle = np.sqrt(square)
    if angle < SMALL_RAD:
        return series(v, 1 - square / 6, 0.5 - square / 24)
    return series(v, np.sin(angle) / angle, (1 - np.cos(angle)) / square)


@kernel
def accumulated(turns_rad: FloatArray, R: FloatArray) -> FloatArray:
    """Return where turns, (n, 3), one after another lead from a rotation, (n + 1, 3, 3).

    Each is about the axes that those before it have led to.
    """
    out = np.empty((len(turns_rad) + 1, 3, 3))
    put(R, out[0])
    for k in range(len(turns_rad)):
        T = exp(turns_rad[k])
        for i in range(3):
            for j in range(3):
                out[k + 1, i, j] = (
                    out[k, i, 0] * T[0, j] + out[k, i, 1] * T[1, j] + out[k, i, 2] * T[2, j]
                )
    return out


@kernel
def right_jacobian(v: FloatArray) -> FloatArray:
    """Return the change of the turn's end, in body axes, by the rotation vector, (3, 3)."""
    square = v[0] ** 2 + v[1] ** 2 + v[2] ** 2
    angle = np.sqrt(square)
    if angle < SMALL_RAD:
        return series(v, -0.5 + square / 24, 1 / 6 - square / 120)
    return series(v, -(1 - np.cos(angle)) / square, (angle - np.sin(angle)) / (angle * square))


@kernel
def inverse_right_jacobian(v: FloatArray) -> FloatArray:
    """Return the change of the rotation vector by a turn at its end, in body axes, (3, 3)."""
    return series(v, 0.5, inverse_terms(v)[0])


@kernel
def inverse_terms(v: FloatArray) -> tuple[float, float]:
    """Return the factor of K^2 in the inverse right Jacobian, and its slope over the angle.

    That is ``(1 - x / 2 cot(x / 2)) / x^2`` at angle x, and its derivative divided by x.
    """
    square = v[0] ** 2 + v[1] ** 2 + v[2] ** 2
    if square < _BERNOULLI_RAD**2:
        value = 1 / 12 + square * (1 / 720 + square * (1 / 30240 + square / 1209600))
        slope = 1 / 360 + square * (1 / 7560 + square * (1 / 201600 + square / 5987520))
        return value, slope
    half = np.sqrt(square) / 2
    cotangent = np.cos(half) / np.sin(half)
    value = (1 - half * cotangent) / square
    bend = half / np.sin(half) ** 2 - cotangent
    return value, (bend / (4 * half) - 2 * value) / square


@kernel
def skew(v: FloatArray) -> FloatArray:
    """Return the matrix of the cross product with a vector from the left, (3, 3)."""
    out = np.zeros((3, 3))
    out[0, 1], out[0, 2], out[1, 2] = -v[2], v[1], -v[0]
    out[1, 0], out[2, 0], out[2, 1] = v[2], -v[1], v[0]
    return out


@kernel
def series(v: FloatArray, once: float, twice: float) -> FloatArray:
    """Return I + once K + twice K^2 with K the skew matrix of v."""
    square = v[0] ** 2 + v[1] ** 2 + v[2] ** 2
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = twice * v[i] * v[j]
        out[i, i] += 1 - twice * square
    out[0, 1] -= once * v[2]
    out[1, 0] += once * v[2]
    out[0, 2] += once * v[1]
    out[2, 0] -= once * v[1]
    out[1, 2] -= once * v[0]
    out[2, 1] += once * v[0]
    return out


@kernel
def bend(
    v: FloatArray, x: FloatArray, once: float, twice: float, slope: float, second: float
) -> FloatArray:
    """Return the derivative of ``a K x + b K2 x`` by v, (3, 3); slopes of a, b over its size."""
    K = skew(v)
    K_x = times(K, x)
    KK_x, out = times(K, K_x), skew(x)
    along = v[0] * x[0] + v[1] * x[1] + v[2] * x[2]
    for i in range(3):
        by_size = slope * K_x[i] + second * KK_x[i]
        for j in range(3):
            out[i, j] *= -once
            out[i, j] += twice * (v[i] * x[j] - 2 * x[i] * v[j]) + by_size * v[j]
        out[i, i] += twice * along
    return out


@kernel
def turn(R_from: FloatArray, R_to: FloatArray) -> FloatArray:
    """Return the rotation vector from one attitude to another, body axes."""
    R = np.zeros((3, 3))
    for i in range(3):
        for m in range(3):
            for j in range(3):
                R[i, j] += R_from[m, i] * R_to[m, j]
    out = np.empty(3)
    out[0], out[1], out[2] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    length = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)  # twice the sine
    angle = np.arctan2(length, R[0, 0] + R[1, 1] + R[2, 2] - 1)
    return scaled(out, 0.5 if length < SMALL_RAD else angle / length)
