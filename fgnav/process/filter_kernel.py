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
    skew,
    turn,
)
from fgnav.kernels.compiled import inlined, kernel

SIZE, MEAN = 15, 12  # of the error state; where m stands in it


@inlined
def rotation_rows(
    x: FloatArray, F: FloatArray, H: FloatArray, T_s: float, C: FloatArray, N: FloatArray
) -> FloatArray:
    """Return the predicted turn, (3,): integral of the rate and the Magnus term.

    Writes its derivatives, as the error of the rotation it leads to, by the error state to C,
    (3, 15), and by the noise of integral and rate to N, (3, 6).
    """
    after, phi = np.empty(3), np.empty(3)
    for i in range(3):
        after[i] = F[i, 0, 0] * x[0, i] + F[i, 0, 1] * x[1, i] + F[i, 0, 2] * x[2, i]
        after[i] += (1 - F[i, 0, 0]) * x[3, i]
        phi[i] = H[i, 0] * x[0, i] + H[i, 1] * x[1, i] + H[i, 2] * x[2, i]
        phi[i] += (T_s - H[i, 0]) * x[3, i]
    by_after = skew(scaled(x[0], T_s * T_s / 12))  # of T^2 / 12 w x w'
    by_before = skew(scaled(after, -T_s * T_s / 12))
    for i in range(3):
        for j in range(3):
            phi[i] += by_after[i, j] * after[j]
    J, back = right_jacobian(phi), exp(scaled(phi, -1.0))
    A, B = product(J, by_before), product(J, by_after)
    for i in range(3):
        for j in range(3):
            C[i, j] = back[i, j]
            C[i, 3 + j] = H[j, 0] * J[i, j] + A[i, j] + F[j, 0, 0] * B[i, j]
            C[i, 6 + j] = H[j, 1] * J[i, j] + F[j, 0, 1] * B[i, j]
            C[i, 9 + j] = H[j, 2] * J[i, j] + F[j, 0, 2] * B[i, j]
            C[i, 12 + j] = (T_s - H[j, 0]) * J[i, j] + (1 - F[j, 0, 0]) * B[i, j]
            N[i, j], N[i, 3 + j] = J[i, j], B[i, j]
    return phi


@inlined
def move(x: FloatArray, F: FloatArray) -> None:
    """Move rate and derivatives, rows 0 to 2 of x, on about the mean, row 3."""
    for i in range(3):
        w, a, j = x[0, i] - x[3, i], x[1, i], x[2, i]
        for d in range(3):
            x[d, i] = F[i, d, 0] * w + F[i, d, 1] * a + F[i, d, 2] * j
        x[0, i] += x[3, i]


@kernel
def times_transition(P: FloatArray, C: FloatArray, F: FloatArray) -> FloatArray:
    """Return the transition times a matrix, (15, 15); most of the transition is zero."""
    out = np.zeros((SIZE, SIZE))
    for i in range(3):
        for m in range(SIZE):
            c = C[i, m]
            for q in range(SIZE):
                out[i, q] += c * P[m, q]
        for d in range(3):
            f0, f1, f2 = F[i, d, 0], F[i, d, 1], F[i, d, 2]
            fm = (1.0 if d == 0 else 0.0) - f0
            row = 3 + 3 * d + i
            for q in range(SIZE):
                out[row, q] = f0 * P[3 + i, q] + f1 * P[6 + i, q] + f2 * P[9 + i, q]
                out[row, q] += fm * P[MEAN + i, q]
        for q in range(SIZE):
            out[MEAN + i, q] = P[MEAN + i, q]
    return out


@inlined
def predicted(
    P: FloatArray, C: FloatArray, N: FloatArray, F: FloatArray, Q: FloatArray, variance: FloatArray
) -> FloatArray:
    """Return the covariance after an interval, (15, 15)."""
    U, out = times_transition(P, C, F), np.empty((SIZE, SIZE))
    for r in range(SIZE):  # the lower half of U times the transition's transpose
        x, y, z = 0.0, 0.0, 0.0
        for m in range(SIZE):
            x += U[r, m] * C[0, m]
            y += U[r, m] * C[1, m]
            z += U[r, m] * C[2, m]
        out[r, 0], out[r, 1], out[r, 2] = x, y, z
        for d in range(3):
            for i in range(3):
                fm = (1.0 if d == 0 else 0.0) - F[i, d, 0]
                value = F[i, d, 0] * U[r, 3 + i] + F[i, d, 1] * U[r, 6 + i]
                value += F[i, d, 2] * U[r, 9 + i]
                out[r, 3 + 3 * d + i] = value + fm * U[r, MEAN + i]
        for i in range(3):
            out[r, MEAN + i] = U[r, MEAN + i]
    _add_noise(out, N, Q, variance)
    for i in range(SIZE):
        for j in range(i):  # both halves alike: what differs would grow
            out[j, i] = out[i, j]
    return out


@inlined
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


@inlined
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


@inlined
def gain(
    P: FloatArray, z: FloatArray, V: FloatArray
) -> tuple[FloatArray, FloatArray, float, float]:
    """Return the gain, (15, 3), and of the innovation inverse covariance, square, log-determinant.

    The square is of the whitened innovation, the determinant of the covariance.
    """
    S = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            S[i, j] = P[i, j] + V[i, j]
    W, determinant = inverse(S)
    K, square = np.zeros((SIZE, 3)), 0.0
    for j in range(3):
        for m in range(3):
            square += z[m] * W[m, j] * z[j]
            for i in range(SIZE):
                K[i, j] += P[i, m] * W[m, j]
    return K, W, square, np.log(determinant)
