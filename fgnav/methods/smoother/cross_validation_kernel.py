"""How well each attitude is foretold by all the others, if the rate is a random walk."""

import numpy as np
from numba import njit

from fgnav.checks import BoolArray, FloatArray
from fgnav.rotation_kernel import (
    exp,
    inverse,
    product,
    right_jacobian,
    sandwich,
    scaled,
    times,
    transposed,
    turn,
)

_UNKNOWN_RAD2 = 1.0  # a prediction as uncertain as this tells nothing: a gap


@njit(cache=True)
def deletion_residuals(
    t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray, density: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return squares and log-determinants of what each attitude leaves to its prediction.

    The prediction is from all other attitudes, before and after: a Kalman filter of rotation and
    rate, and the backward recursion of its innovations [1]_.

    Parameters
    ----------
    t_s, R_nb, covariance_rad2 : ndarray, shape (n,), (n, 3, 3), (n, 3, 3)
    density : ndarray, shape (3,)
        Of white angular acceleration, body axes.

    Returns
    -------
    square, log_determinant : ndarray, shape (n,)
        Normalised square of the residual, chi-square with 3 degrees of freedom, and logarithm of
        the determinant of its covariance; NaN at the first two attitudes after a gap.

    References
    ----------
    .. [1] de Jong, A cross-validation filter for time series models, Biometrika 75, 1988.
    """
    z, W, K, F, goes_on = _filtered(t_s, R_nb, covariance_rad2, density)
    n = len(t_s)
    square, log_determinant = np.full(n, np.nan), np.full(n, np.nan)
    r: FloatArray = np.zeros(6)  # what later innovations say of the state, and its covariance
    N: FloatArray = np.zeros((6, 6))
    for k in range(n - 1, 0, -1):
        if not goes_on[k]:
            r, N = np.zeros(6), np.zeros((6, 6))
            continue
        gain = transposed(K[k])
        D, u = product(product(gain, N), K[k]), times(gain, r)
        said = times(W[k], z[k])
        for i in range(3):
            u[i] = said[i] - u[i]
            r[i] += u[i]
            for j in range(3):
                D[i, j] += W[k, i, j]
        D_inverse, determinant = inverse(D)
        residual = times(D_inverse, u)
        square[k] = u[0] * residual[0] + u[1] * residual[1] + u[2] * residual[2]
        log_determinant[k] = -np.log(determinant)
        r, N = times(transposed(F[k]), r), _carried_back(N, F[k], W[k], K[k])
    return square, log_determinant


@njit(cache=True)
def innovation_residuals(
    t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray, density: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the same of predictions from the attitudes before alone: a filter's innovations."""
    z, W, _, _, goes_on = _filtered(t_s, R_nb, covariance_rad2, density)
    n = len(t_s)
    square, log_determinant = np.full(n, np.nan), np.full(n, np.nan)
    for k in range(1, n):
        if goes_on[k]:
            said = times(W[k], z[k])
            square[k] = z[k, 0] * said[0] + z[k, 1] * said[1] + z[k, 2] * said[2]
            log_determinant[k] = -np.log(inverse(W[k])[1])
    return square, log_determinant


@njit(cache=True)
def _filtered(
    t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray, density: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, BoolArray]:
    """Run the filter of rotation and rate.

    Return innovations (n, 3), inverses of their covariances (n, 3, 3), gains (n, 6, 3), transitions
    to each epoch (n, 6, 6), and where they are: not at the first two attitudes after a gap.
    """
    n = len(t_s)
    z, W, K, F = np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 6, 3)), np.zeros((n, 6, 6))
    goes_on = np.zeros(n, dtype=np.bool_)
    R: FloatArray = R_nb[0]
    w: FloatArray = np.zeros(3)
    P: FloatArray = np.zeros((6, 6))
    started = False
    for k in range(1, n):
        dt = t_s[k] - t_s[k - 1]
        if not started:
            R, w = R_nb[k], scaled(turn(R_nb[k - 1], R_nb[k]), 1 / dt)
            P = _first(covariance_rad2[k - 1], covariance_rad2[k], density, dt)
            started = True
            continue
        turned = scaled(w, dt)
        R = product(R, exp(turned))
        P = _predicted(P, turned, density, dt, F[k])
        if P[0, 0] + P[1, 1] + P[2, 2] > _UNKNOWN_RAD2:
            started = False
            continue
        off = turn(R, R_nb[k])
        P = _measured(P, covariance_rad2[k], W[k], K[k])
        change = times(K[k], off)
        for i in range(3):
            z[k, i] = off[i]
            w[i] += change[3 + i]
        R = product(R, exp(change))
        goes_on[k] = True
    return z, W, K, F, goes_on


@njit(cache=True)
def _first(before: FloatArray, after: FloatArray, density: FloatArray, dt: float) -> FloatArray:
    """Return the covariance after two attitudes, (6, 6): the rate is their difference."""
    P = np.empty((6, 6))
    for i in range(3):
        for j in range(3):
            P[i, j] = after[i, j]
            P[i, 3 + j] = P[3 + j, i] = after[i, j] / dt
            P[3 + i, 3 + j] = (before[i, j] + after[i, j]) / dt**2
        P[3 + i, 3 + i] += density[i] * dt / 3
    return P


@njit(cache=True)
def _predicted(
    P: FloatArray, turned: FloatArray, density: FloatArray, dt: float, F: FloatArray
) -> FloatArray:
    """Return the covariance after a turn: white angular acceleration, twice integrated.

    Writes how errors of rotation and rate go on over the turn to F, (6, 6).
    """
    back, lean = exp(scaled(turned, -1.0)), right_jacobian(turned)
    for i in range(3):
        F[3 + i, 3 + i] = 1.0
        for j in range(3):
            F[i, j], F[i, 3 + j] = back[i, j], dt * lean[i, j]
    out = sandwich(F, P)
    for i in range(3):
        out[i, i] += density[i] * dt**3 / 3
        out[i, 3 + i] += density[i] * dt**2 / 2
        out[3 + i, i] += density[i] * dt**2 / 2
        out[3 + i, 3 + i] += density[i] * dt
    return out


@njit(cache=True)
def _measured(P: FloatArray, V: FloatArray, W: FloatArray, K: FloatArray) -> FloatArray:
    """Return the covariance after a rotation was measured with covariance V.

    Writes the inverse of the innovation's covariance to W, (3, 3), and the gain to K, (6, 3).
    """
    S, B = np.empty((3, 3)), np.empty((6, 3))
    for j in range(3):
        for i in range(3):
            S[i, j] = P[i, j] + V[i, j]
        for i in range(6):
            B[i, j] = P[i, j]
    inverted, _ = inverse(S)
    gain = product(B, inverted)
    for j in range(3):
        for i in range(3):
            W[i, j] = inverted[i, j]
        for i in range(6):
            K[i, j] = gain[i, j]
    out = np.empty((6, 6))
    for i in range(6):
        for j in range(i + 1):  # both halves alike: what differs would grow
            out[i, j] = P[i, j] - K[i, 0] * B[j, 0] - K[i, 1] * B[j, 1] - K[i, 2] * B[j, 2]
            out[j, i] = out[i, j]
    return out


@njit(cache=True)
def _carried_back(N: FloatArray, F: FloatArray, W: FloatArray, K: FloatArray) -> FloatArray:
    """Return the covariance of what later innovations say, one epoch earlier.

    As a sum of squares: by differences it would lose its sign within a minute.
    """
    L, H = F.copy(), np.empty((6, 3))  # L = (I - K [I, 0]) F, H = ([I, 0] F)'
    for j in range(6):
        for m in range(3):
            H[j, m] = F[m, j]
            for i in range(6):
                L[i, j] -= K[i, m] * F[m, j]
    out, said = sandwich(transposed(L), N), product(product(H, W), transposed(H))
    for i in range(6):
        for j in range(6):
            out[i, j] += said[i, j]
    return out
