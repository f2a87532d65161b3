"""The rotation within an interval, and what the specific force gains along it, compiled.

Equations in ``gyro_free``: the path is cubic in the rotation vector, its slopes are those of the
body rate at both ends.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.kernels.compiled import kernel


class Intervals(NamedTuple):
    """Constants of n - 1 intervals, independent of their states; see ``gyro_free.GyroFree``."""

    span_s: FloatArray  # (n - 1,)
    step_s: FloatArray  # (n - 1,)
    first: IntArray  # (n,)
    f_b_mps2: FloatArray  # (k, 3)
    gravity_n_mps2: FloatArray  # (n, 3)
    earth_rate_n_radps: FloatArray  # (3,)
    transition: FloatArray  # (n - 1, 3, 3, 3), F of each axis
    turn: FloatArray  # (n - 1, 3, 3), H of each axis
    white: FloatArray  # (n - 1, 3, 4, 4), W of each axis, of unit variance
    sigma_radps: FloatArray  # (n - 1, 3), of the process about each axis
    force_white: FloatArray  # (n - 1, 3), see ``gyro_free._force_white``
    walk_white: FloatArray  # (n - 1,)
    correlated: FloatArray  # (n - 1, q, q), of the array's correlated error; q may be 0
    correlated_white: FloatArray  # (n - 1, q, q), what whitens its noise


class Path(NamedTuple):
    """The path of the rotation vector through an interval, and what the force gains along it."""

    theta: FloatArray  # (3,), its value at the end
    end: FloatArray  # (3,), its slope there
    J: FloatArray  # (3, 3), inverse right Jacobian of theta
    C: FloatArray  # (3, 3), derivative of that slope by theta
    gain: FloatArray  # (2, 3), velocity and position, axes of the start
    # (8, 3, 3), derivatives of each by theta, slope at the start, slope at the end, force
    sums: FloatArray


@kernel
def empty_path() -> Path:
    """Return room for a path."""
    return Path(
        np.empty(3),
        np.empty(3),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((2, 3)),
        np.empty((8, 3, 3)),
    )


@kernel
def turn(R_0: FloatArray, R_1: FloatArray, path: Path) -> None:
    """Fill the path's end: the rotation against the frame n, ``Log(R_0' R_1)``."""
    theta = rot.turn(R_0, R_1)
    for i in range(3):
        path.theta[i] = theta[i]


@kernel
def _end_slope(aux: FloatArray, path: Path) -> None:
    """Fill the path's slope at its end, ``J_r^-1(theta) w``, and the derivative by theta."""
    theta, C = path.theta, path.C
    J = rot.inverse_right_jacobian(theta)
    twice, slope = rot.inverse_terms(theta)
    square = theta[0] ** 2 + theta[1] ** 2 + theta[2] ** 2
    along = theta[0] * aux[3] + theta[1] * aux[4] + theta[2] * aux[5]
    for i in range(3):
        path.end[i] = 0.0
        across = slope * (theta[i] * along - aux[3 + i] * square)
        for j in range(3):
            path.J[i, j] = J[i, j]
            path.end[i] += J[i, j] * aux[3 + j]
            outer = theta[i] * aux[3 + j] - 2 * aux[3 + i] * theta[j]
            C[i, j] = twice * outer + across * theta[j]
        C[i, i] += twice * along
        a, b = (i + 1) % 3, (i + 2) % 3
        C[i, a] += aux[3 + b] / 2
        C[i, b] -= aux[3 + a] / 2


@kernel
def integrate(of: Intervals, k: int, aux: FloatArray, aux_end: FloatArray, path: Path) -> None:
    """Integrate the specific force along a path that ends at ``path.theta``; fill the rest of it.

    ``aux`` and ``aux_end`` are the vectors of the keyframes at both ends, (12,).
    """
    _end_slope(aux_end, path)
    theta, end, gain, sums = path.theta, path.end, path.gain, path.sums
    T, dt, n = of.span_s[k], of.step_s[k], of.first[k + 1] - of.first[k]
    _clear(path)
    R, L, G = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    t, f, g = np.empty(3), np.empty(3), np.empty(3)
    for step in range(n):
        s = (step + 0.5) / n
        value, start_slope = s * s * (3 - 2 * s), T * s * (1 - s) ** 2
        end_slope = -T * s * s * (1 - s)
        for i in range(3):
            t[i] = value * theta[i] + start_slope * aux[3 + i] + end_slope * end[i]
            f[i] = of.f_b_mps2[of.first[k] + step, i] - aux[i]
        _rotation_and_jacobian(t, R, L)
        for i in range(3):
            g[i] = R[i, 0] * f[0] + R[i, 1] * f[1] + R[i, 2] * f[2]
        rest_s = T * (1 - s)
        for j in range(3):
            G[0, j] = g[2] * L[1, j] - g[1] * L[2, j]
            G[1, j] = g[0] * L[2, j] - g[2] * L[0, j]
            G[2, j] = g[1] * L[0, j] - g[0] * L[1, j]
        for i in range(3):
            gain[0, i] += dt * g[i]
            gain[1, i] += dt * rest_s * g[i]
            for j in range(3):
                by, by_force = dt * G[i, j], dt * R[i, j]
                sums[0, i, j] += value * by
                sums[1, i, j] += start_slope * by
                sums[2, i, j] += end_slope * by
                sums[3, i, j] += by_force
                sums[4, i, j] += rest_s * value * by
                sums[5, i, j] += rest_s * start_slope * by
                sums[6, i, j] += rest_s * end_slope * by
                sums[7, i, j] += rest_s * by_force


@kernel
def _rotation_and_jacobian(v: FloatArray, R: FloatArray, L: FloatArray) -> None:
    """Fill a rotation vector's rotation and its left Jacobian."""
    x, y, z = v[0], v[1], v[2]
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    if angle < rot.SMALL_RAD:
        sine, versine, rest = 1 - square / 6, 0.5 - square / 24, 1 / 6 - square / 120
    else:
        sine, versine = np.sin(angle) / angle, (1 - np.cos(angle)) / square
        rest = (1 - sine) / square
    for once, twice, out in ((sine, versine, R), (versine, rest, L)):
        diagonal = 1 - twice * square
        out[0, 0], out[1, 1], out[2, 2] = (
            diagonal + twice * x * x,
            diagonal + twice * y * y,
            diagonal + twice * z * z,
        )
        out[0, 1], out[1, 0] = twice * x * y - once * z, twice * x * y + once * z
        out[0, 2], out[2, 0] = twice * x * z + once * y, twice * x * z - once * y
        out[1, 2], out[2, 1] = twice * y * z - once * x, twice * y * z + once * x


@kernel
def _clear(path: Path) -> None:
    """Set the sums along a path to zero."""
    for i in range(3):
        for k in range(2):
            path.gain[k, i] = 0.0
        for j in range(3):
            for k in range(8):
                path.sums[k, i, j] = 0.0
