"""Innovations of a Kalman filter of rotation, rate, its derivatives and mean, from attitudes.

The error state has 15 dimensions: rotation (body axes), then (w, T0 a, T0^2 j), three axes each,
and the mean rate m. Plain loops, for numba.
"""

import numpy as np
from numba import njit

from fgnav.checks import BoolArray, FloatArray
from fgnav.process import matern_kernel as matern
from fgnav.rotation_kernel import (
    exp,
    inverse,
    product,
    right_jacobian,
    scaled,
    skew,
    times,
    transposed,
    turn,
)

_SIZE, _MEAN = 15, 12  # of the error state; where m stands in it
_WRONG_SHARE = 0.01  # of attitudes, before they are seen
_UNKNOWN = -np.log(8 * np.pi**2)  # log density of an attitude that may be any, per rad^3
_LOST = 4  # attitudes in a row held to be wrong: it is the filter that is, and starts anew
_SAME_S = 1e-9  # durations closer than this are one


@njit(cache=True)
def log_densities(
    t_s: FloatArray,
    R_nb: FloatArray,
    covariance_rad2: FloatArray,
    open_axis: FloatArray,
    linked: BoolArray,
    mean_rate: FloatArray,
    length_s: float,
    variance_rad2ps2: FloatArray,
) -> FloatArray:
    """Return the log density of each attitude given those before, (n,); the first has none, 0.

    An attitude is right, or wrong and then any; the update by that mixture keeps its mean and
    covariance (probabilistic data association [1]_), so the density is smooth in what is searched.

    Parameters
    ----------
    t_s, R_nb, covariance_rad2 : ndarray, shape (n,), (n, 3, 3), (n, 3, 3)
    open_axis : ndarray, shape (n, 3)
        Unit vector, body axes, about which an attitude is next to unknown; zero if there is none.
    linked : ndarray of bool, shape (n - 1,)
        Where the rotation goes on from one attitude to the next; else it starts anew with the next,
        while rate and mean go on: a gap, over which turns cannot be counted.
    mean_rate : ndarray, shape (4,)
        Of the mean rate, rad/s: where it is linearised, (3,), and its 1-sigma before the flight.
    length_s : float
    variance_rad2ps2 : ndarray, shape (3,)

    References
    ----------
    .. [1] Bar-Shalom, Daum and Huang, The probabilistic data association filter, IEEE Control
       Systems Magazine 29, 2009.
    """
    n = len(t_s)
    out, x = np.zeros(n), np.zeros((4, 3))
    _start_rates(x, mean_rate[:3])
    P = _start(length_s, variance_rad2ps2, mean_rate[3])
    C, N = np.empty((3, _SIZE)), np.empty((3, 6))
    R = R_nb[0].copy()
    _restart(P, covariance_rad2[0])
    contradicted = 0
    T_s = -1.0
    F: FloatArray = np.empty((3, 3))
    H: FloatArray = np.empty(3)
    Q: FloatArray = np.empty((4, 4))
    for k in range(1, n):
        if abs(t_s[k] - t_s[k - 1] - T_s) > _SAME_S:
            T_s = t_s[k] - t_s[k - 1]
            F, H = matern.transition(T_s, length_s), matern.integral(T_s, length_s)
            L = matern.noise_factor(T_s, length_s)
            Q = product(L, transposed(L))
        R = product(R, exp(_rotation_rows(x, F, H, T_s, C, N)))
        P = _predicted(P, C, N, F, Q, variance_rad2ps2)
        _move(x, F)
        if linked[k - 1]:
            z = _difference(R, R_nb[k], open_axis[k])
            out[k], share, R = _updated(P, x, R, z, covariance_rad2[k])
            contradicted = contradicted + 1 if share < 0.5 else 0
        if contradicted == _LOST:
            contradicted = 0
            P = _start(length_s, variance_rad2ps2, mean_rate[3])
            _start_rates(x, scaled(turn(R_nb[k - 1], R_nb[k]), 1 / T_s))
        elif linked[k - 1]:
            continue
        R = R_nb[k].copy()
        _restart(P, covariance_rad2[k])
    return out


@njit(cache=True)
def _start_rates(x: FloatArray, rate: FloatArray) -> None:
    """Set rate and mean rate, derivatives zero, in x, (4, 3)."""
    for i in range(3):
        x[0, i] = x[3, i] = rate[i]
        x[1, i] = x[2, i] = 0.0


@njit(cache=True)
def _start(length_s: float, variance: FloatArray, sigma: float) -> FloatArray:
    """Return the covariance of rate, derivatives and mean before the first attitude, (15, 15)."""
    square = (matern.rate_constant(length_s) * matern.DERIVATIVE_SCALE_S) ** 2
    P = np.zeros((_SIZE, _SIZE))
    for i in range(3):
        w, a, j, m = 3 + i, 6 + i, 9 + i, _MEAN + i
        P[m, m] = P[w, m] = P[m, w] = sigma**2
        P[w, w] = sigma**2 + variance[i]
        P[a, a] = variance[i] * square / 3
        P[j, j] = variance[i] * square**2
        P[w, j] = P[j, w] = -variance[i] * square / 3
    return P


@njit(cache=True)
def _restart(P: FloatArray, V: FloatArray) -> None:
    """Make the rotation as well known as an attitude is, whatever was before."""
    for i in range(3):
        for j in range(_SIZE):
            P[i, j] = P[j, i] = V[i, j] if j < 3 else 0.0


@njit(cache=True)
def _rotation_rows(
    x: FloatArray, F: FloatArray, H: FloatArray, T_s: float, C: FloatArray, N: FloatArray
) -> FloatArray:
    """Return the predicted turn, (3,): integral of the rate and the Magnus term.

    Writes its derivatives, as the error of the rotation it leads to, by the error state to C,
    (3, 15), and by the noise of integral and rate to N, (3, 6).
    """
    after, phi = np.empty(3), np.empty(3)
    for i in range(3):
        after[i] = F[0, 0] * x[0, i] + F[0, 1] * x[1, i] + F[0, 2] * x[2, i]
        after[i] += (1 - F[0, 0]) * x[3, i]
        phi[i] = H[0] * x[0, i] + H[1] * x[1, i] + H[2] * x[2, i] + (T_s - H[0]) * x[3, i]
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
            C[i, 3 + j] = H[0] * J[i, j] + A[i, j] + F[0, 0] * B[i, j]
            C[i, 6 + j] = H[1] * J[i, j] + F[0, 1] * B[i, j]
            C[i, 9 + j] = H[2] * J[i, j] + F[0, 2] * B[i, j]
            C[i, 12 + j] = (T_s - H[0]) * J[i, j] + (1 - F[0, 0]) * B[i, j]
            N[i, j], N[i, 3 + j] = J[i, j], B[i, j]
    return phi


@njit(cache=True)
def _move(x: FloatArray, F: FloatArray) -> None:
    """Move rate and derivatives, rows 0 to 2 of x, on about the mean, row 3."""
    for i in range(3):
        w, a, j = x[0, i] - x[3, i], x[1, i], x[2, i]
        for d in range(3):
            x[d, i] = F[d, 0] * w + F[d, 1] * a + F[d, 2] * j
        x[0, i] += x[3, i]


@njit(cache=True)
def _times_transition(P: FloatArray, C: FloatArray, F: FloatArray) -> FloatArray:
    """Return the transition times a matrix, (15, 15); most of the transition is zero."""
    out = np.zeros((_SIZE, _SIZE))
    for i in range(3):
        for m in range(_SIZE):
            c = C[i, m]
            for q in range(_SIZE):
                out[i, q] += c * P[m, q]
        for d in range(3):
            f0, f1, f2 = F[d, 0], F[d, 1], F[d, 2]
            fm = (1.0 if d == 0 else 0.0) - f0
            row = 3 + 3 * d + i
            for q in range(_SIZE):
                out[row, q] = f0 * P[3 + i, q] + f1 * P[6 + i, q] + f2 * P[9 + i, q]
                out[row, q] += fm * P[_MEAN + i, q]
        for q in range(_SIZE):
            out[_MEAN + i, q] = P[_MEAN + i, q]
    return out


@njit(cache=True)
def _predicted(
    P: FloatArray, C: FloatArray, N: FloatArray, F: FloatArray, Q: FloatArray, variance: FloatArray
) -> FloatArray:
    """Return the covariance after an interval, (15, 15)."""
    U, out = _times_transition(P, C, F), np.empty((_SIZE, _SIZE))
    for r in range(_SIZE):  # the lower half of U times the transition's transpose
        x, y, z = 0.0, 0.0, 0.0
        for m in range(_SIZE):
            x += U[r, m] * C[0, m]
            y += U[r, m] * C[1, m]
            z += U[r, m] * C[2, m]
        out[r, 0], out[r, 1], out[r, 2] = x, y, z
        for d in range(3):
            fm = (1.0 if d == 0 else 0.0) - F[d, 0]
            for i in range(3):
                value = F[d, 0] * U[r, 3 + i] + F[d, 1] * U[r, 6 + i] + F[d, 2] * U[r, 9 + i]
                out[r, 3 + 3 * d + i] = value + fm * U[r, _MEAN + i]
        for i in range(3):
            out[r, _MEAN + i] = U[r, _MEAN + i]
    _add_noise(out, N, Q, variance)
    for i in range(_SIZE):
        for j in range(i):  # both halves alike: what differs would grow
            out[j, i] = out[i, j]
    return out


@njit(cache=True)
def _add_noise(P: FloatArray, N: FloatArray, Q: FloatArray, variance: FloatArray) -> None:
    """Add the noise of an interval to the lower half of the covariance after it."""
    for axis in range(3):
        s2 = variance[axis]
        for i in range(3):
            J, B = N[i, axis], N[i, 3 + axis]
            by_phi = s2 * (J * Q[0, 0] + B * Q[1, 0])
            by_rate = s2 * (J * Q[0, 1] + B * Q[1, 1])
            for j in range(i + 1):
                P[i, j] += by_phi * N[j, axis] + by_rate * N[j, 3 + axis]
            for d in range(3):
                P[3 + 3 * d + axis, i] += s2 * (J * Q[0, 1 + d] + B * Q[1, 1 + d])
        for d in range(3):
            for e in range(d + 1):
                P[3 + 3 * d + axis, 3 + 3 * e + axis] += s2 * Q[1 + d, 1 + e]


@njit(cache=True)
def _difference(R: FloatArray, R_measured: FloatArray, axis: FloatArray) -> FloatArray:
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


@njit(cache=True)
def _gain(P: FloatArray, z: FloatArray, V: FloatArray) -> tuple[FloatArray, float, float]:
    """Return the gain, (15, 3), square of the whitened innovation, its log-determinant."""
    S = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            S[i, j] = P[i, j] + V[i, j]
    W, determinant = inverse(S)
    K, square = np.zeros((_SIZE, 3)), 0.0
    for j in range(3):
        for m in range(3):
            square += z[m] * W[m, j] * z[j]
            for i in range(_SIZE):
                K[i, j] += P[i, m] * W[m, j]
    return K, square, np.log(determinant)


@njit(cache=True)
def _updated(
    P: FloatArray, x: FloatArray, R: FloatArray, z: FloatArray, V: FloatArray
) -> tuple[float, float, FloatArray]:
    """Return log density of an attitude, probability that it is right, and the rotation after it.

    P and x are updated; z is the innovation.
    """
    K, square, log_determinant = _gain(P, z, V)
    step = times(K, z)
    right = np.log(1 - _WRONG_SHARE) - (square + log_determinant + 3 * np.log(2 * np.pi)) / 2
    wrong = np.log(_WRONG_SHARE) + _UNKNOWN
    density = max(right, wrong) + np.log1p(np.exp(-abs(right - wrong)))
    share = np.exp(right - density)
    rows = P[:3].copy()
    for i in range(_SIZE):
        for j in range(i + 1):
            gained = K[i, 0] * rows[0, j] + K[i, 1] * rows[1, j] + K[i, 2] * rows[2, j]
            P[i, j] += share * ((1 - share) * step[i] * step[j] - gained)
            P[j, i] = P[i, j]
    for d in range(4):
        for i in range(3):
            x[d, i] += share * step[3 + 3 * d + i]
    return density, share, product(R, exp(scaled(step[:3], share)))
