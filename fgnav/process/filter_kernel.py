"""One step of a filter of rotation, rate, its derivatives and mean, from attitudes; compiled.

The error state has 15 dimensions: rotation (body axes), then (w, T0 a, T0^2 j), three axes each,
and the mean rate m. Each axis has a process of its own, the first index of F, H and Q. Plain loops,
for numba.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotation_kernel import (
    exp,
    inverse,
    product,
    right_jacobian,
    scaled,
    turn,
)
from fgnav.kernels.compiled import kernel, kernel_with

SIZE, MEAN = 15, 12  # of the error state; where m stands in it
WIDTH = 16  # of rows: the last is zero, and they are added four numbers at a time


@kernel
def rotation_rows(
    x: FloatArray, F: FloatArray, H: FloatArray, T_s: float, C: FloatArray, N: FloatArray
) -> FloatArray:
    """Return the predicted turn, (3,): integral of the rate and the Magnus term.

    Writes its derivatives, as the error of the rotation it leads to, by the error state to the
    first columns of C, (3, 15), and by the noise of integral and rate to N, (3, 6).
    """
    after, phi, by = np.empty(3), np.empty(3), T_s * T_s / 12  # of w x w'
    for i in range(3):
        after[i] = F[i, 0, 0] * x[0, i] + F[i, 0, 1] * x[1, i] + F[i, 0, 2] * x[2, i]
        after[i] += (1 - F[i, 0, 0]) * x[3, i]
        phi[i] = H[i, 0] * x[0, i] + H[i, 1] * x[1, i] + H[i, 2] * x[2, i]
        phi[i] += (T_s - H[i, 0]) * x[3, i]
    for i in range(3):
        j, m = (i + 1) % 3, (i + 2) % 3
        phi[i] += by * (x[0, j] * after[m] - x[0, m] * after[j])
    J, R = right_jacobian(phi), exp(phi)
    for i in range(3):
        for j in range(3):
            m, p = (j + 1) % 3, (j + 2) % 3
            A = by * (J[i, p] * after[m] - J[i, m] * after[p])
            B = by * (J[i, m] * x[0, p] - J[i, p] * x[0, m])
            C[i, j] = R[j, i]
            C[i, 3 + j] = H[j, 0] * J[i, j] + A + F[j, 0, 0] * B
            C[i, 6 + j] = H[j, 1] * J[i, j] + F[j, 0, 1] * B
            C[i, 9 + j] = H[j, 2] * J[i, j] + F[j, 0, 2] * B
            C[i, 12 + j] = (T_s - H[j, 0]) * J[i, j] + (1 - F[j, 0, 0]) * B
            N[i, j], N[i, 3 + j] = J[i, j], B
    return phi


@kernel
def move(x: FloatArray, F: FloatArray) -> None:
    """Move rate and derivatives, rows 0 to 2 of x, on about the mean, row 3."""
    for i in range(3):
        w, a, j = x[0, i] - x[3, i], x[1, i], x[2, i]
        for d in range(3):
            x[d, i] = F[i, d, 0] * w + F[i, d, 1] * a + F[i, d, 2] * j
        x[0, i] += x[3, i]


@kernel
def turn_on(R: FloatArray, C: FloatArray) -> FloatArray:
    """Return a rotation after the turn whose transpose the first columns of C are, (3, 3)."""
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = R[i, 0] * C[j, 0] + R[i, 1] * C[j, 1] + R[i, 2] * C[j, 2]
    return out


@kernel_with(fastmath={"reassoc", "contract"})
def by_rows(P: FloatArray, C: FloatArray, out: FloatArray) -> None:
    """Write ``C P`` to three rows, P symmetric; sums in any order: four times the pace."""
    for i in range(SIZE):
        x, y, z = 0.0, 0.0, 0.0
        for m in range(P.shape[1]):
            x += C[0, m] * P[i, m]
            y += C[1, m] * P[i, m]
            z += C[2, m] * P[i, m]
        out[0, i], out[1, i], out[2, i] = x, y, z


@kernel
def predict(
    P: FloatArray,
    C: FloatArray,
    N: FloatArray,
    F: FloatArray,
    Q: FloatArray,
    variance: FloatArray,
    moved: FloatArray,
) -> None:
    """Make P, (15, 16), the covariance after an interval; write the transition times that before.

    Most of the transition is zero.
    """
    by_rows(P, C, moved)
    _move_rows(P, F, moved)
    for r in range(SIZE):  # the lower half of that times the transition's transpose
        x, y, z = 0.0, 0.0, 0.0
        for m in range(P.shape[1]):
            x += C[0, m] * moved[r, m]
            y += C[1, m] * moved[r, m]
            z += C[2, m] * moved[r, m]
        P[r, 0], P[r, 1], P[r, 2] = x, y, z
        for i in range(3):
            w, a, j, mean = moved[r, 3 + i], moved[r, 6 + i], moved[r, 9 + i], moved[r, MEAN + i]
            for d in range(3):
                P[r, 3 + 3 * d + i] = F[i, d, 0] * (w - mean) + F[i, d, 1] * a + F[i, d, 2] * j
            P[r, 3 + i] += mean
            P[r, MEAN + i] = mean
    _add_noise(P, N, Q, variance)
    for i in range(SIZE):
        for j in range(i):  # both halves alike: what differs would grow
            P[j, i] = P[i, j]


@kernel
def _move_rows(P: FloatArray, F: FloatArray, out: FloatArray) -> None:
    """Write the rows of rates, derivatives and mean of the transition times P."""
    for i in range(3):
        for d in range(3):
            f0, f1, f2 = F[i, d, 0], F[i, d, 1], F[i, d, 2]
            fm = (1.0 if d == 0 else 0.0) - f0
            for q in range(P.shape[1]):
                value = f0 * P[3 + i, q] + f1 * P[6 + i, q] + f2 * P[9 + i, q]
                out[3 + 3 * d + i, q] = value + fm * P[MEAN + i, q]
        for q in range(P.shape[1]):
            out[MEAN + i, q] = P[MEAN + i, q]


@kernel
def _add_noise(P: FloatArray, N: FloatArray, Q: FloatArray, variance: FloatArray) -> None:
    """Add the noise of an interval to the lower half of the covariance after it."""
    for axis in range(3):
        s2 = variance[axis]
        for i in range(3):
            J, B = N[i, axis], N[i, 3 + axis]
            by_phi = s2 * (J * Q[axis, 0, 0] + B * Q[axis, 1, 0])
            by_rate = s2 * (J * Q[axis, 0, 1] + B * Q[axis, 1, 1])
            for j in range(i + 1):
                P[i, j] += by_phi * N[j, axis] + by_rate * N[j, 3 + axis]
            for d in range(3):
                P[3 + 3 * d + axis, i] += s2 * (J * Q[axis, 0, 1 + d] + B * Q[axis, 1, 1 + d])
        for d in range(3):
            for e in range(d + 1):
                P[3 + 3 * d + axis, 3 + 3 * e + axis] += s2 * Q[axis, 1 + d, 1 + e]


@kernel
def difference(R: FloatArray, R_measured: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the rotation vector from a prediction to an attitude, (3,).

    About an open axis the turn may be large, and a rotation vector would turn the rest by half of
    it: there it is split into a swing across the axis and a twist about it, and they are added.
    """
    z = turn(R, R_measured)
    along = z[0] * axis[0] + z[1] * axis[1] + z[2] * axis[2]
    angle = np.sqrt(z[0] ** 2 + z[1] ** 2 + z[2] ** 2)
    if along == 0.0:
        return z
    twist = 2 * np.arctan2(np.sin(angle / 2) * along / angle, np.cos(angle / 2))
    z = turn(R, product(R_measured, exp(scaled(axis, -twist))))
    for i in range(3):
        z[i] += twist * axis[i]
    return z


@kernel
def gain(
    P: FloatArray, z: FloatArray, V: FloatArray
) -> tuple[FloatArray, FloatArray, float, float]:
    """Return the gain's transpose, (3, 16); of the innovation inverse covariance, square, log-det.

    The square is of the whitened innovation, the determinant of the covariance; P is symmetric.
    """
    S = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            S[i, j] = P[i, j] + V[i, j]
    W, determinant = inverse(S)
    K, square = np.empty((3, WIDTH)), 0.0
    for j in range(3):
        for m in range(3):
            square += z[m] * W[m, j] * z[j]
        for i in range(P.shape[1]):
            K[j, i] = W[0, j] * P[0, i] + W[1, j] * P[1, i] + W[2, j] * P[2, i]
    return K, W, square, np.log(determinant)
