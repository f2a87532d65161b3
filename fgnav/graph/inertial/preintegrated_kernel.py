"""Residuals and derivatives of preintegrated intervals, compiled: as GTSAM's factor has them.

With what an interval sums up, ``dR dp dv`` over T seconds about biases, the earth's rate w, and
``G = Exp(-w T)``, gravity's share ``g_p g_v``, and ``u = v + w x p``, a state leads to

    R' = G R dR    p' = G (p + T u + R dp) + g_p    u' = G (u + R dv) + g_v

and the residual is the logarithm in SE_2(3) of what leads from the next state to that one [1]_.

References
----------
.. [1] Brossard, Barrau, Chauchat, Bonnabel: Associating uncertainty to extended poses for on Lie
   group IMU preintegration with rotating Earth, IEEE T-RO 38, 2022.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotation_kernel import (
    bend,
    exp,
    inverse_right_jacobian,
    inverse_terms,
    product,
    put,
    right_jacobian,
    skew,
    times,
    transposed,
    turn,
)
from fgnav.graph.inertial.galilean_kernel import (
    BIAS,
    BY_BIAS,
    FRAME,
    GRAVITY_POSITION,
    GRAVITY_VELOCITY,
    POSITION,
    ROTATION,
    SPAN,
    VELOCITY,
    WHITE,
)
from fgnav.graph.types.motion import LinearisedMotion
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import inlined, inner, kernel

WIDTH = 15  # rotation, position, velocity, both biases


@kernel
def linearise(
    sums: FloatArray,
    before: States,
    after: States,
    earth_rate: FloatArray,
    out: LinearisedMotion,
) -> None:
    """Fill whitened residuals and derivatives of intervals between states, j of each.

    Parameters
    ----------
    sums : ndarray, shape (j, 316)
        What intervals sum up.
    before, after : States
    earth_rate : ndarray, shape (3,)
        rad/s, in n.
    out : LinearisedMotion
    """
    by_before, by_after = np.zeros((WIDTH, WIDTH)), np.zeros((WIDTH, WIDTH))
    for i in range(9, WIDTH):
        by_before[i, i], by_after[i, i] = 1.0, -1.0
    moved = np.zeros((3, WIDTH)), np.zeros((3, WIDTH)), np.zeros((3, WIDTH))
    end = np.zeros((3, 9)), np.zeros((3, 9)), np.zeros((3, 9))
    value = np.empty(WIDTH)
    for row in range(len(sums)):
        R, p, v = _predicted(sums[row], before, row, earth_rate, moved)
        R_t = transposed(after.R_nb[row])
        e_p = times(R_t, _sum(p, -1.0, after.p_n_m[row]))
        e_v = times(R_t, _sum(v, -1.0, after.v_n_mps[row]))
        phi = turn(after.R_nb[row], R)
        J = inverse_right_jacobian(phi)
        J_t = transposed(J)
        rho, nu = times(J_t, e_p), times(J_t, e_v)
        for i in range(3):
            value[i], value[3 + i], value[6 + i] = phi[i], rho[i], nu[i]
        for i in range(6):
            value[9 + i] = before.aux[row, i] - after.aux[row, i]
        bends = _bent(phi, e_p), _bent(phi, e_v)
        _through(J, bends, moved, by_before)
        _ended(R_t, e_p, e_v, end)
        _through(J_t, bends, end, by_after)
        white = _matrix(sums[row], WHITE, WIDTH, WIDTH)
        whitened = times(white, value)
        for i in range(WIDTH):
            out.value[row, i] = whitened[i]
        _whiten(white, by_before, out.before[row])
        _whiten(white, by_after, out.after[row])


@kernel
def predict(sums: FloatArray, before: States, earth_rate: FloatArray, after: States) -> None:
    """Fill rotations, positions and velocities that intervals lead to from states, j of each."""
    moved = np.zeros((3, WIDTH)), np.zeros((3, WIDTH)), np.zeros((3, WIDTH))
    for row in range(len(sums)):
        R, p, v = _predicted(sums[row], before, row, earth_rate, moved)
        put(R, after.R_nb[row])
        for i in range(3):
            after.p_n_m[row, i], after.v_n_mps[row, i] = p[i], v[i]


@inner
def _vector(row: FloatArray, first: int, n: int) -> FloatArray:
    out = np.empty(n)
    for i in range(n):
        out[i] = row[first + i]
    return out


@inner
def _matrix(row: FloatArray, first: int, n: int, m: int) -> FloatArray:
    out = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            out[i, j] = row[first + i * m + j]
    return out


@inner
def _sum(a: FloatArray, factor: float, b: FloatArray) -> FloatArray:
    """Return a vector and another times a number."""
    out = np.empty(len(a))
    for i in range(len(a)):
        out[i] = a[i] + factor * b[i]
    return out


@inner
def _add(out: FloatArray, factor: float, a: FloatArray, column: int) -> None:
    """Add a matrix times a number to another one, from a column on."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            out[i, column + j] += factor * a[i, j]


@inner
def _predicted(
    sums: FloatArray,
    before: States,
    row: int,
    earth_rate: FloatArray,
    moved: tuple[FloatArray, FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the state that an interval leads to; fill how that moves by the one before."""
    for one in moved:
        one[:] = 0.0
    T, R_i, p_i = sums[SPAN], before.R_nb[row], before.p_n_m[row]
    dR, dp, dv = _increment(sums, before.aux[row], moved)
    w = skew(earth_rate)
    u = _sum(before.v_n_mps[row], 1.0, times(w, p_i))
    G = _matrix(sums, FRAME, 3, 3)
    R = product(product(G, R_i), dR)
    p = times(G, _sum(_sum(p_i, T, u), 1.0, times(R_i, dp)))
    p = _sum(p, 1.0, _vector(sums, GRAVITY_POSITION, 3))
    v = times(G, _sum(u, 1.0, times(R_i, dv)))
    v = _sum(_sum(v, 1.0, _vector(sums, GRAVITY_VELOCITY, 3)), -1.0, times(w, p))
    dR_t, R_it = transposed(dR), transposed(R_i)
    turned, back = product(dR_t, product(R_it, product(w, R_i))), product(dR_t, R_it)
    _add(moved[0], 1.0, dR_t, 0)
    _add(moved[1], -1.0, product(dR_t, skew(dp)), 0)
    _add(moved[1], 1.0, dR_t, 3)
    _add(moved[1], T, turned, 3)
    _add(moved[1], T, back, 6)
    _add(moved[2], -1.0, product(dR_t, skew(dv)), 0)
    _add(moved[2], 1.0, turned, 3)
    _add(moved[2], 1.0, back, 6)
    _add(moved[2], -1.0, product(skew(times(transposed(R), earth_rate)), moved[1]), 0)
    return R, p, v


@inlined
def _increment(
    sums: FloatArray, bias: FloatArray, moved: tuple[FloatArray, FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return rotation, position and velocity summed up about biases; fill how these move them."""
    change = _sum(bias, -1.0, _vector(sums, BIAS, 6))
    by_turn = _matrix(sums, BY_BIAS[0], 3, 6)
    theta = times(by_turn, change)
    C, J, dR = exp(theta), right_jacobian(theta), _matrix(sums, ROTATION, 3, 3)
    C_t, J_t = transposed(C), transposed(J)
    _add(moved[0], 1.0, product(J, by_turn), 9)
    by_position, by_velocity = (
        _matrix(sums, BY_BIAS[1], 3, 6),
        _matrix(sums, BY_BIAS[2], 3, 6),
    )
    rho, nu = times(by_position, change), times(by_velocity, change)
    _add(moved[1], 1.0, product(J, by_position), 9)
    _add(moved[1], 1.0, product(product(C_t, _bent_ahead(theta, rho)), by_turn), 9)
    _add(moved[2], 1.0, product(J, by_velocity), 9)
    _add(moved[2], 1.0, product(product(C_t, _bent_ahead(theta, nu)), by_turn), 9)
    dp = _sum(_vector(sums, POSITION, 3), 1.0, times(dR, times(J_t, rho)))
    dv = _sum(_vector(sums, VELOCITY, 3), 1.0, times(dR, times(J_t, nu)))
    return product(dR, C), dp, dv


@inner
def _bent_ahead(v: FloatArray, x: FloatArray) -> FloatArray:
    """Return how ``J_l(v) x`` moves by a small v: ``x + a K x + b K^2 x``, a and b by series."""
    square = v[0] ** 2 + v[1] ** 2 + v[2] ** 2
    once, twice = 0.5 - square / 24 + square**2 / 720, 1 / 6 - square / 120 + square**2 / 5040
    return bend(v, x, once, twice, -1 / 12 + square / 180, -1 / 60 + square / 1260)


@inner
def _bent(v: FloatArray, x: FloatArray) -> FloatArray:
    """Return how ``x - K x / 2 + b K^2 x``, by the inverse of ``J_l(v)``, moves by v."""
    twice, slope = inverse_terms(v)
    return bend(v, x, -0.5, twice, 0.0, slope)


@inlined
def _ended(
    R_t: FloatArray,
    e_p: FloatArray,
    e_v: FloatArray,
    end: tuple[FloatArray, FloatArray, FloatArray],
) -> None:
    """Fill how what leads to the prediction moves, in axes of the next state, by that state."""
    for one in end:
        one[:] = 0.0
    for i in range(3):
        end[0][i, i], end[1][i, 3 + i] = -1.0, -1.0
    _add(end[1], 1.0, skew(e_p), 0)
    _add(end[2], 1.0, skew(e_v), 0)
    _add(end[2], -1.0, R_t, 6)


@inner
def _through(
    J: FloatArray,
    bends: tuple[FloatArray, FloatArray],
    moved: tuple[FloatArray, FloatArray, FloatArray],
    out: FloatArray,
) -> None:
    """Fill derivatives of the logarithm by those of what it is taken of."""
    turned = product(J, moved[0])
    position, velocity = product(J, moved[1]), product(J, moved[2])
    _add(position, 1.0, product(bends[0], turned), 0)
    _add(velocity, 1.0, product(bends[1], turned), 0)
    for i in range(3):
        for j in range(turned.shape[1]):
            out[i, j], out[3 + i, j], out[6 + i, j] = turned[i, j], position[i, j], velocity[i, j]


@inner
def _whiten(white: FloatArray, by: FloatArray, out: FloatArray) -> None:
    """Fill an upper triangular matrix times another."""
    out[:] = 0.0
    for i in range(WIDTH):
        for m in range(i, WIDTH):
            for j in range(WIDTH):
                out[i, j] += white[i, m] * by[m, j]
