"""What samples of force and rate sum up between keyframes, compiled: one element of a group.

A sub-step of dt with force a and turn ``x = w dt``, both less their biases, adds

    R <- R Exp(x)    p <- p + v dt + R G2(x) a dt2    v <- v + R G1(x) a dt

exactly where both are constant within it [1]_, with ``G1 = sum K^k / (k + 1)!`` and ``G2 = sum
K^k / (k + 2)!`` of K, the skew matrix of x. An error of rotation, position and velocity in axes of
the end follows by F, and the biases' by B,

    D <- F D - B    P <- F P F' + B S B' + Q    for D by biases and P with them

S are the noises of force and rate, Q that of position and the walks of biases. GTSAM's
``PreintegratedCombinedMeasurementsG`` is the same to rounding (``test_galilean``).

References
----------
.. [1] Delama, Fornasier, Mahony, Weiss: Equivariant IMU preintegration with biases, a Galilean
   group approach, IEEE RA-L 10, 2025.
"""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.kernels.compiled import inlined, inner, kernel

NOISES = 9  # powers of force, rate and position, and of the walk of each axis of both biases
# What an interval sums up, one after another: T, dR dp dv, the biases that it is summed up about,
# by them rotation, position and velocity in axes of the end, then G, g_p, g_v of
# ``preintegrated_kernel``, and the whitening of its residuals, upper triangular.
SPAN, ROTATION, POSITION, VELOCITY, BIAS = 0, 1, 10, 13, 16
BY_BIAS = 22, 40, 58
FRAME, GRAVITY_POSITION, GRAVITY_VELOCITY, WHITE = 76, 85, 88, 91
SUMS = 316
_WIDTH, _STATE = 15, 9  # rotation, position, velocity, both biases
_TERMS = 9  # of series: of a radian the tenth is 1e-21 of the first
_NOTHING = 1e-22  # of terms, which changes no sum of them


@kernel
def sums(
    steps: tuple[IntArray, FloatArray, FloatArray, FloatArray],
    biases: FloatArray,
    noises: FloatArray,
    gravity: FloatArray,
    earth_rate: FloatArray,
) -> FloatArray:
    """Return what intervals sum up, (j, 316).

    Parameters
    ----------
    steps : tuple
        Number of the first sub-step of each, (j + 1,), their length, (j,), and forces and rates in
        the middles of sub-steps, (k, 3).
    biases : ndarray, shape (j, 6)
        About which they are summed up.
    noises : ndarray, shape (j, 9)
    gravity : ndarray, shape (j, 3)
        In n.
    earth_rate : ndarray, shape (3,)
        rad/s, in n.
    """
    first, step_s, force, rate = steps
    out = np.empty((len(step_s), SUMS))
    for j in range(len(step_s)):
        P = np.zeros((_WIDTH, _WIDTH))
        dR, dp, dv, D = _summed(
            force[first[j] : first[j + 1]],
            rate[first[j] : first[j + 1]],
            step_s[j],
            biases[j],
            noises[j],
            P,
        )
        _put_frame((first[j + 1] - first[j]) * step_s[j], gravity[j], earth_rate, out[j])
        for i in range(3):
            out[j, POSITION + i], out[j, VELOCITY + i] = dp[i], dv[i]
            for m in range(3):
                out[j, ROTATION + 3 * i + m] = dR[i, m]
        for i in range(6):
            out[j, BIAS + i] = biases[j, i]
            for m in range(_STATE):
                out[j, BY_BIAS[0] + 6 * m + i] = D[m, i]
        _carry_frame(P, dR, earth_rate)
        _put_whitening(P, out[j, WHITE:])
    return out


@kernel
def covariances(
    steps: tuple[IntArray, FloatArray, FloatArray, FloatArray],
    biases: FloatArray,
    noises: FloatArray,
    earth_rate: FloatArray,
) -> FloatArray:
    """Return covariances of intervals, (j, c, 15, 15), by noises, (c, 9), one at a time."""
    first, step_s, force, rate = steps
    out = np.zeros((len(step_s), len(noises), _WIDTH, _WIDTH))
    for j in range(len(step_s)):
        f, w = force[first[j] : first[j + 1]], rate[first[j] : first[j + 1]]
        for c in range(len(noises)):
            dR, _, _, _ = _summed(f, w, step_s[j], biases[j], noises[c], out[j, c])
            _carry_frame(out[j, c], dR, earth_rate)
    return out


@inner
def _summed(
    force: FloatArray,
    rate: FloatArray,
    step_s: float,
    bias: FloatArray,
    noises: FloatArray,
    P: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return rotation, position, velocity, and these by biases, (9, 6); fill the covariance."""
    p, v = np.zeros(3), np.zeros(3)
    R: FloatArray = np.zeros((3, 3))
    R[0, 0] = R[1, 1] = R[2, 2] = 1.0
    D, B = np.zeros((_STATE, 6)), np.zeros((_STATE, 6))
    a, x = np.empty(3), np.empty(3)
    for k in range(len(force)):
        for i in range(3):
            a[i], x[i] = force[k, i] - bias[i], (rate[k, i] - bias[3 + i]) * step_s
        dR, dp, dv = _one_step(a, x, step_s, B)
        led, turned = rot.times(R, dp), rot.times(R, dv)
        for i in range(3):
            p[i] += v[i] * step_s + led[i]
            v[i] += turned[i]
        R = rot.product(R, dR)
        _carry(dR, dp, dv, step_s, D)
        for i in range(_STATE):
            for m in range(6):
                D[i, m] -= B[i, m]
        _spread(dR, dp, dv, step_s, B, noises, P)
    return R, p, v, D


@inner
def _one_step(
    a: FloatArray, x: FloatArray, step_s: float, B: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what one sub-step adds; fill how an error of force and rate moves it, (9, 6)."""
    c, slope = _terms(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
    K = rot.skew(x)
    dR, K_t = rot.exp(x), rot.transposed(K)
    G1, G2 = _polynomial(K, 1.0, c[0], c[1]), _polynomial(K, 0.5, c[1], c[2])
    dv, dp = rot.times(G1, a), rot.times(G2, a)
    back = rot.transposed(dR)
    by_force = rot.product(back, G2), rot.product(back, G1)
    by_turn = (
        rot.product(back, rot.bend(x, a, c[1], c[2], slope[1], slope[2])),
        rot.product(back, rot.bend(x, a, c[0], c[1], slope[0], slope[1])),
    )
    J = _polynomial(K_t, 1.0, c[0], c[1])
    square = step_s * step_s
    for i in range(3):
        dp[i] *= square
        dv[i] *= step_s
        for j in range(3):
            B[i, 3 + j] = J[i, j] * step_s
            B[3 + i, j], B[6 + i, j] = by_force[0][i, j] * square, by_force[1][i, j] * step_s
            B[3 + i, 3 + j] = by_turn[0][i, j] * square * step_s
            B[6 + i, 3 + j] = by_turn[1][i, j] * square
    return dR, dp, dv


@inner
def _terms(square: float) -> tuple[FloatArray, FloatArray]:
    """Return ``1 / 2! - x2 / 4! + ..``, of 3! and 4! as well, and their slopes over the angle x.

    Of large angles in closed form: there terms of the series cancel, or never end.
    """
    c, slope = np.zeros(3), np.zeros(3)
    if square > 1.0:
        x = np.sqrt(square)
        sine, versine = np.sin(x), 1.0 - np.cos(x)
        c[0] = versine / square
        c[1] = (x - sine) / (square * x)
        c[2] = (square / 2 - versine) / square**2
        slope[0] = (x * sine - 2 * versine) / square**2
        slope[1] = (x * versine - 3 * (x - sine)) / (square**2 * x)
        slope[2] = (x * (x - sine) - 4 * (square / 2 - versine)) / square**3
        return c, slope
    term, by_square = 0.5, -1 / 24
    for k in range(_TERMS):
        if abs(by_square) < _NOTHING and abs(term) < _NOTHING:
            break
        odd, even = 2 * k + 3, (2 * k + 3) * (2 * k + 4)
        c[0] += term
        c[1] += term / odd
        c[2] += term / even
        term *= -square / even
        # The next term's slope.
        odd, even = 2 * k + 5, (2 * k + 5) * (2 * k + 6)
        slope[0] += 2 * (k + 1) * by_square
        slope[1] += 2 * (k + 1) * by_square / odd
        slope[2] += 2 * (k + 1) * by_square / even
        by_square *= -square / even
    return c, slope


@inner
def _polynomial(K: FloatArray, one: float, once: float, twice: float) -> FloatArray:
    """Return a number of I, of K and of K2, (3, 3)."""
    out = rot.product(K, K)
    for i in range(3):
        for j in range(3):
            out[i, j] = twice * out[i, j] + once * K[i, j]
        out[i, i] += one
    return out


@inner
def _carry(dR: FloatArray, dp: FloatArray, dv: FloatArray, step_s: float, X: FloatArray) -> None:
    """Lead columns, (9, m), of errors through a sub-step: F times them."""
    for j in range(X.shape[1]):
        a, b, c = X[0, j], X[1, j], X[2, j]
        s0 = X[3, j] + step_s * X[6, j] - dp[1] * c + dp[2] * b
        s1 = X[4, j] + step_s * X[7, j] - dp[2] * a + dp[0] * c
        s2 = X[5, j] + step_s * X[8, j] - dp[0] * b + dp[1] * a
        u0 = X[6, j] - dv[1] * c + dv[2] * b
        u1 = X[7, j] - dv[2] * a + dv[0] * c
        u2 = X[8, j] - dv[0] * b + dv[1] * a
        for i in range(3):
            x, y, z = dR[0, i], dR[1, i], dR[2, i]
            X[i, j] = x * a + y * b + z * c
            X[3 + i, j] = x * s0 + y * s1 + z * s2
            X[6 + i, j] = x * u0 + y * u1 + z * u2


@inner
def _spread(
    dR: FloatArray,
    dp: FloatArray,
    dv: FloatArray,
    step_s: float,
    B: FloatArray,
    noises: FloatArray,
    P: FloatArray,
) -> None:
    """Lead a covariance, (15, 15), through a sub-step and add what it adds."""
    _carry(dR, dp, dv, step_s, P[:_STATE])
    _carry(dR, dp, dv, step_s, P.T[:_STATE, :_STATE])
    half = np.empty((_STATE, 6))  # twice of it is what goes with B
    for m in range(6):
        bias, white = P[_STATE + m, _STATE + m], noises[0 if m < 3 else 1] / step_s
        for i in range(_STATE):
            half[i, m] = P[i, _STATE + m] - (bias + white) / 2 * B[i, m]
            P[i, _STATE + m] -= B[i, m] * bias
            P[_STATE + m, i] = P[i, _STATE + m]
        P[_STATE + m, _STATE + m] = bias + noises[3 + m] * step_s
    for i in range(_STATE):
        for j in range(i + 1):
            for m in range(6):
                P[i, j] -= half[i, m] * B[j, m] + B[i, m] * half[j, m]
            P[j, i] = P[i, j]
    for i in range(3, 6):
        P[i, i] += noises[2] * step_s


@inlined
def _put_frame(T: float, gravity: FloatArray, earth_rate: FloatArray, out: FloatArray) -> None:
    """Fill a row with how axes n turn, and what gravity adds: ``G1 g T`` and ``(G1 - G2) g T2``."""
    x = rot.scaled(earth_rate, -T)
    c, _ = _terms(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
    K, G = rot.skew(x), rot.exp(x)
    by_velocity = rot.times(_polynomial(K, 1.0, c[0], c[1]), gravity)
    by_position = rot.times(_polynomial(K, 0.5, c[0] - c[1], c[1] - c[2]), gravity)
    out[SPAN] = T
    for i in range(3):
        out[GRAVITY_POSITION + i] = by_position[i] * T * T
        out[GRAVITY_VELOCITY + i] = by_velocity[i] * T
        for j in range(3):
            out[FRAME + 3 * i + j] = G[i, j]


@inner
def _carry_frame(P: FloatArray, dR: FloatArray, earth_rate: FloatArray) -> None:
    """Change a covariance from velocities against inertial space to those against turning axes."""
    w = rot.skew(rot.times(rot.transposed(dR), earth_rate))
    _add_turning(w, P)
    _add_turning(w, P.T)


@inner
def _add_turning(w: FloatArray, X: FloatArray) -> None:
    for j in range(X.shape[1]):
        for i in range(3):
            for m in range(3):
                X[6 + i, j] -= w[i, m] * X[3 + m, j]


@inlined
def _put_whitening(P: FloatArray, out: FloatArray) -> None:
    """Fill the upper triangular W of ``W'W = P^-1``: the inverse of U where ``P = U U'``."""
    U = np.zeros((_WIDTH, _WIDTH))
    for j in range(_WIDTH - 1, -1, -1):
        for i in range(j, -1, -1):
            value = P[i, j]
            for m in range(j + 1, _WIDTH):
                value -= U[i, m] * U[j, m]
            U[i, j] = np.sqrt(value) if i == j else value / U[j, j]
    for j in range(_WIDTH):
        for i in range(_WIDTH):
            if i > j:
                out[i * _WIDTH + j] = 0.0
    for j in range(_WIDTH):
        out[j * _WIDTH + j] = 1 / U[j, j]
        for i in range(j - 1, -1, -1):
            value = 0.0
            for m in range(i + 1, j + 1):
                value -= U[i, m] * out[m * _WIDTH + j]
            out[i * _WIDTH + j] = value / U[i, i]
