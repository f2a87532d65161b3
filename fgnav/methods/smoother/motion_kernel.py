"""Inertial samples between keyframes summed up, all intervals at once, with what that costs.

The measurement is that of GTSAM's combined factor: rotation vector, position and velocity gained in
the axes of the interval's start, corrected to first order for the slot, with the random walk of the
slot in its covariance. GTSAM's own classes take a call from Python for each sub-step.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother import rotation_kernel as rot
from fgnav.methods.smoother.chain_kernel import cholesky, forward

MOTION = 15  # rotation vector, position, velocity, slot
_INTEGRATION_M2 = 1e-6  # m2/s: a millimetre in a second keeps the linear systems well posed


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
    noise : ndarray, shape (n, 6)
        Of each interval; see ``Preintegrator.noise``.
    about : ndarray, shape (m, 6)
        Slots that the intervals are integrated about.
    gained : Gained
        To be filled.
    """
    failed = 0
    for row in range(len(intervals)):
        k = intervals[row]
        P: FloatArray = np.zeros((MOTION, MOTION))
        by_slot: FloatArray = np.zeros((MOTION, 6))
        z = gained.total[row]
        z[:] = 0.0
        for i in range(6):
            by_slot[9 + i, i] = -1.0
        for i in range(first[k], first[k + 1]):
            F = _step(z, f_b_mps2[i], w_b_radps[i], about[row], step_s[k])
            by_slot, half = _carried(F, by_slot), _carried(F, P)
            P = _carried(F, rot.transposed(half))  # P is symmetric
            _add_noise(P, F, noise[k], step_s[k])
        for i in range(9):
            for j in range(6):
                gained.correction[row, i, j] = by_slot[i, j]
        failed += 0 if _whitening(z, P, gained.white[row]) else 1
    return failed


@njit(cache=True)
def _step(
    z: FloatArray, f_b: FloatArray, w_b: FloatArray, about: FloatArray, dt: float
) -> FloatArray:
    """Carry a sum, (9,), on by a sub-step; return how that changes with sum and slot, (15, 15).

    The derivative is that and the identity.

    Specific forces are turned to the axes that the body had at the start of the sub-step, where
    the integration takes them: half a sub-step late, velocities would be those of a millisecond
    ago. To second order in the angle, 0.06 rad at two turns a second.
    """
    theta, w, f = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        theta[i], w[i], f[i] = z[i], w_b[i] - about[3 + i], f_b[i] - about[i]
    a = rot.times(rot.series(rot.scaled(w, dt / 2), 1.0, 0.5), f)
    R, by_rate, by_theta = rot.exp(theta), rot.inverse_right_jacobian(theta), _rate_by(theta, w)
    a_by_theta = rot.product(rot.product(R, rot.skew(a)), rot.right_jacobian(theta))
    a_0, rate = rot.times(R, a), rot.times(by_rate, w)
    F = np.zeros((MOTION, MOTION))
    for i in range(3):
        z[i] += rate[i] * dt
        z[3 + i] += z[6 + i] * dt + a_0[i] * dt**2 / 2
        z[6 + i] += a_0[i] * dt
        F[3 + i, 6 + i] = dt
        for j in range(3):
            F[i, j] = by_theta[i, j] * dt
            F[3 + i, j], F[6 + i, j] = -a_by_theta[i, j] * dt**2 / 2, -a_by_theta[i, j] * dt
            F[3 + i, 9 + j], F[6 + i, 9 + j] = R[i, j] * dt**2 / 2, R[i, j] * dt
            F[i, 12 + j] = by_rate[i, j] * dt
    return F


@njit(cache=True)
def _carried(F: FloatArray, X: FloatArray) -> FloatArray:
    """Return X + F X with what ``_step`` returns, whose zeros are known."""
    out, n = X.copy(), X.shape[1]
    for i in range(9):
        slot, after = 12 if i < 3 else 9, 6 + i % 3
        dt = F[i, after] if 3 <= i < 6 else 0.0
        a, b, c = F[i, 0], F[i, 1], F[i, 2]
        d, e, f = F[i, slot], F[i, slot + 1], F[i, slot + 2]
        for j in range(n):
            turned = a * X[0, j] + b * X[1, j] + c * X[2, j]
            led = d * X[slot, j] + e * X[slot + 1, j] + f * X[slot + 2, j]
            out[i, j] += turned + led + dt * X[after, j]
    return out


@njit(cache=True)
def _rate_by(theta: FloatArray, w: FloatArray) -> FloatArray:
    """Return how the rotation vector's rate at a body rate changes with the vector, (3, 3)."""
    twice, slope = rot.inverse_terms(theta)
    out, square, along = rot.skew(w), 0.0, 0.0
    for i in range(3):
        square += theta[i] ** 2
        along += theta[i] * w[i]
    for i in range(3):
        across = slope * (theta[i] * along - w[i] * square)
        for j in range(3):
            out[i, j] *= -0.5
            out[i, j] += twice * (theta[i] * w[j] - 2 * w[i] * theta[j]) + across * theta[j]
        out[i, i] += twice * along
    return out


@njit(cache=True)
def _add_noise(P: FloatArray, F: FloatArray, noise: FloatArray, dt: float) -> None:
    """Add what a sub-step's own noise brings; ``noise`` is a row of ``Preintegrator.noise``."""
    for i in range(3):
        P[3 + i, 3 + i] += noise[0] * dt**3 / 4 + _INTEGRATION_M2 * dt
        P[3 + i, 6 + i] += noise[0] * dt**2 / 2
        P[6 + i, 3 + i] += noise[0] * dt**2 / 2
        P[6 + i, 6 + i] += noise[0] * dt
        P[9 + i, 9 + i] += noise[2] * dt
        P[12 + i, 12 + i] += noise[3 + i] * dt
        for j in range(3):
            for m in range(3):
                P[i, j] += F[i, 12 + m] * F[j, 12 + m] * noise[1] / dt


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
