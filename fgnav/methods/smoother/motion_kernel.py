"""Inertial samples between keyframes summed up, all intervals at once, with what that costs.

The measurement is that of GTSAM's combined factor: rotation vector, position and velocity gained in
the axes of the interval's start, corrected to first order for the slot, with the random walk of the
slot in its covariance. GTSAM's own classes take a call from Python for each sub-step.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from fgnav import rotation_kernel as rot
from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother.chain_kernel import cholesky, forward

MOTION = 15  # rotation vector, position, velocity, slot
INTEGRATION_M2 = 1e-7  # m2/s: a third of a millimetre in a second keeps linear systems well posed


class Gained(NamedTuple):
    """What intervals sum up to."""

    total: FloatArray  # (m, 9), rotation vector, position, velocity
    correction: FloatArray  # (m, 9, 6), derivative by the slot
    white: FloatArray  # (m, 15, 15), whitens the residual of ``link_kernel``


@njit(cache=True)
def preintegrate(
    intervals: IntArray,
    first: IntArray,
    step_s: FloatArray,
    f_b_mps2: FloatArray,
    w_b_radps: FloatArray,
    noise: FloatArray,
    about: FloatArray,
    gained: Gained,
) -> int:
    """Sum up sub-steps of some intervals; return how many covariances are not positive.

    Parameters
    ----------
    intervals : ndarray of int, shape (m,)
    first, step_s, f_b_mps2, w_b_radps : ndarray
        As in ``Increments``.
    noise : ndarray, shape (n, 8)
        Of each interval; see ``Preintegrator.noise``.
    about : ndarray, shape (m, 6)
        Slots that the intervals are integrated about.
    gained : Gained
        To be filled.
    """
    failed = 0
    P, half, F = np.empty((MOTION, MOTION)), np.empty((9, MOTION)), np.empty((9, 6))
    room = np.empty((5, 3, 3))
    for row in range(len(intervals)):
        k, z, by_slot = intervals[row], gained.total[row], gained.correction[row]
        z[:], P[:], by_slot[:] = 0.0, 0.0, 0.0
        for i in range(first[k], first[k + 1]):
            _step(z, f_b_mps2[i], w_b_radps[i], about[row], step_s[k], F, room)
            _carry_slope(F, step_s[k], by_slot)
            _carry_covariance(F, step_s[k], P, half)
            _add_noise(P, F, noise[k], step_s[k])
        failed += 0 if _whitening(z, P, gained.white[row]) else 1
    return failed


@njit(cache=True)
def _step(
    z: FloatArray,
    f_b: FloatArray,
    w_b: FloatArray,
    about: FloatArray,
    dt: float,
    F: FloatArray,
    room: FloatArray,
) -> None:
    """Carry a sum, (9,), on by a sub-step; fill how that changes with sum and slot, (9, 6).

    The columns are the sum's own rotation vector, then the half of the slot that matters: the
    gyroscope's for the rotation vector, the accelerometer's for position and velocity. The
    derivative is that, the time step of the position by the velocity, and the identity.

    Specific forces are turned to the axes that the body had at the start of the sub-step, where
    the integration takes them: half a sub-step late, velocities would be those of a millisecond
    ago. To second order in the angle, 0.06 rad at two turns a second.
    """
    R, by_rate, by_theta, turned, by_turn = room[0], room[1], room[2], room[3], room[4]
    t_x, t_y, t_z = z[0], z[1], z[2]
    w_x, w_y, w_z = w_b[0] - about[3], w_b[1] - about[4], w_b[2] - about[5]
    a_x, a_y, a_z = _turned_by(
        w_x * dt / 2,
        w_y * dt / 2,
        w_z * dt / 2,
        f_b[0] - about[0],
        f_b[1] - about[1],
        f_b[2] - about[2],
    )
    twice, slope = rot.inverse_terms(z)
    _about_rotation(t_x, t_y, t_z, twice, R, by_turn, by_rate)
    _rate_by(z, (w_x, w_y, w_z), twice, slope, by_theta)
    for i in range(3):  # R times the cross product with a from the left
        r_x, r_y, r_z = R[i, 0], R[i, 1], R[i, 2]
        turned[i, 0], turned[i, 1] = r_y * a_z - r_z * a_y, r_z * a_x - r_x * a_z
        turned[i, 2] = r_x * a_y - r_y * a_x
    for i in range(3):
        rate = by_rate[i, 0] * w_x + by_rate[i, 1] * w_y + by_rate[i, 2] * w_z
        a_0 = R[i, 0] * a_x + R[i, 1] * a_y + R[i, 2] * a_z
        z[i] += rate * dt
        z[3 + i] += z[6 + i] * dt + a_0 * dt**2 / 2
        z[6 + i] += a_0 * dt
        for j in range(3):
            force = 0.0
            for m in range(3):
                force += turned[i, m] * by_turn[m, j]
            F[i, j], F[i, 3 + j] = by_theta[i, j] * dt, by_rate[i, j] * dt
            F[3 + i, j], F[3 + i, 3 + j] = -force * dt**2 / 2, R[i, j] * dt**2 / 2
            F[6 + i, j], F[6 + i, 3 + j] = -force * dt, R[i, j] * dt


@njit(cache=True)
def _turned_by(
    h_x: float, h_y: float, h_z: float, f_x: float, f_y: float, f_z: float
) -> tuple[float, float, float]:
    """Return a vector turned by a rotation vector, to second order."""
    keeps = 1 - (h_x * h_x + h_y * h_y + h_z * h_z) / 2
    along = (h_x * f_x + h_y * f_y + h_z * f_z) / 2
    return (
        keeps * f_x + along * h_x + h_y * f_z - h_z * f_y,
        keeps * f_y + along * h_y + h_z * f_x - h_x * f_z,
        keeps * f_z + along * h_z + h_x * f_y - h_y * f_x,
    )


@njit(cache=True)
def _about_rotation(
    x: float, y: float, z: float, twice: float, R: FloatArray, right: FloatArray, back: FloatArray
) -> None:
    """Fill a rotation vector's rotation, its right Jacobian and the inverse of that.

    ``twice`` is the first of ``inverse_terms``.
    """
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    if angle < rot.SMALL_RAD:
        sine, versine, rest = 1 - square / 6, 0.5 - square / 24, 1 / 6 - square / 120
    else:
        sine, versine = np.sin(angle) / angle, (1 - np.cos(angle)) / square
        rest = (1 - sine) / square
    _series(x, y, z, square, sine, versine, R)
    _series(x, y, z, square, -versine, rest, right)
    _series(x, y, z, square, 0.5, twice, back)


@njit(cache=True)
def _series(
    x: float, y: float, z: float, square: float, once: float, twice: float, out: FloatArray
) -> None:
    """Fill I + once K + twice K^2 with K the matrix of the cross product with a vector."""
    rest = 1 - twice * square
    out[0, 0], out[1, 1], out[2, 2] = (
        rest + twice * x * x,
        rest + twice * y * y,
        rest + twice * z * z,
    )
    out[0, 1], out[1, 0] = twice * x * y - once * z, twice * x * y + once * z
    out[0, 2], out[2, 0] = twice * x * z + once * y, twice * x * z - once * y
    out[1, 2], out[2, 1] = twice * y * z - once * x, twice * y * z + once * x


@njit(cache=True)
def _carry_slope(F: FloatArray, dt: float, X: FloatArray) -> None:
    """Carry a sum's derivative by the slot, (9, 6), on by a sub-step."""
    for j in range(6):
        a, b, c = X[0, j], X[1, j], X[2, j]
        for i in range(9):
            led = X[6 + i % 3, j] * dt if 3 <= i < 6 else 0.0
            own = F[i, 3 + j % 3] if (i < 3) == (j >= 3) else 0.0  # what is told less the slot
            X[i, j] += F[i, 0] * a + F[i, 1] * b + F[i, 2] * c + led - own


@njit(cache=True)
def _carry_covariance(F: FloatArray, dt: float, P: FloatArray, half: FloatArray) -> None:
    """Carry the covariance of sum and slot, (15, 15), on by a sub-step, what is new excepted."""
    for i in range(9):
        slot, after = 12 if i < 3 else 9, 6 + i % 3
        a, b, c, d, e, f = F[i, 0], F[i, 1], F[i, 2], F[i, 3], F[i, 4], F[i, 5]
        g = dt if 3 <= i < 6 else 0.0
        for j in range(MOTION):
            turned = a * P[0, j] + b * P[1, j] + c * P[2, j]
            led = d * P[slot, j] + e * P[slot + 1, j] + f * P[slot + 2, j]
            half[i, j] = P[i, j] + turned + led + g * P[after, j]
    for i in range(9):
        for j in range(i + 1):
            slot = 12 if j < 3 else 9
            total = half[i, j] + (dt * half[i, 6 + j % 3] if 3 <= j < 6 else 0.0)
            for m in range(3):
                total += F[j, m] * half[i, m] + F[j, 3 + m] * half[i, slot + m]
            P[i, j] = P[j, i] = total
        for j in range(9, MOTION):
            P[i, j] = P[j, i] = half[i, j]


@njit(cache=True)
def _rate_by(
    theta: FloatArray,
    w: tuple[float, float, float],
    twice: float,
    slope: float,
    out: FloatArray,
) -> None:
    """Fill how the rotation vector's rate at a body rate changes with the vector, (3, 3).

    ``twice`` and ``slope`` are the vector's ``inverse_terms``.
    """
    square = theta[0] ** 2 + theta[1] ** 2 + theta[2] ** 2
    along = theta[0] * w[0] + theta[1] * w[1] + theta[2] * w[2]
    for i in range(3):
        across = slope * (theta[i] * along - w[i] * square)
        for j in range(3):
            out[i, j] = twice * (theta[i] * w[j] - 2 * w[i] * theta[j]) + across * theta[j]
        out[i, i] += twice * along
    out[0, 1] += w[2] / 2
    out[1, 0] -= w[2] / 2
    out[0, 2] -= w[1] / 2
    out[2, 0] += w[1] / 2
    out[1, 2] += w[0] / 2
    out[2, 1] -= w[0] / 2


@njit(cache=True)
def _add_noise(P: FloatArray, F: FloatArray, noise: FloatArray, dt: float) -> None:
    """Add what a sub-step's own noise brings; ``noise`` is a row of ``Preintegrator.noise``."""
    for i in range(3):
        P[3 + i, 3 + i] += noise[0] * dt**3 / 4 + INTEGRATION_M2 * dt
        P[3 + i, 6 + i] += noise[0] * dt**2 / 2
        P[6 + i, 3 + i] += noise[0] * dt**2 / 2
        P[6 + i, 6 + i] += noise[0] * dt
        P[9 + i, 9 + i] += noise[1] * dt
        P[12 + i, 12 + i] += noise[5 + i] * dt
        for j in range(3):
            for m in range(3):
                P[i, j] += F[i, 3 + m] * F[j, 3 + m] * noise[2 + m] / dt


@njit(cache=True)
def _whitening(z: FloatArray, P: FloatArray, out: FloatArray) -> bool:
    """Fill what whitens the residual of ``link_kernel``; return whether there is such a thing.

    The residual stands in the axes of the interval's end, and the slot's part of it is the earlier
    less the later one.
    """
    theta = np.empty(3)
    for i in range(3):
        theta[i] = z[i]
    J, R = rot.right_jacobian(theta), rot.exp(theta)
    T = np.zeros((MOTION, MOTION))
    for i in range(3):
        for j in range(3):
            T[i, j], T[3 + i, 3 + j], T[6 + i, 6 + j] = J[i, j], R[j, i], R[j, i]
        T[9 + i, 9 + i] = T[12 + i, 12 + i] = -1.0
    L = rot.sandwich(T, P)
    out[:] = 0.0
    for i in range(MOTION):
        out[i, i] = 1.0
    if not cholesky(L):
        return False
    forward(L, out)
    return True
