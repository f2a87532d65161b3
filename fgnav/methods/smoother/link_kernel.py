"""Links of a chain linearised where the states stand: motion, measurements, prior.

What GTSAM's factors say, at a fifth of the time; the tests hold one against the other.
"""

import numpy as np
from numba import njit

from fgnav import rotation_kernel as rot
from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother.block_kernel import (
    NEXT,
    POSITION,
    ROTATION,
    SLOT,
    VELOCITY,
    add_square,
    put,
    whitened,
)
from fgnav.methods.smoother.chain_kernel import STATE
from fgnav.methods.smoother.link_types import Motions, Prior, Senses, States
from fgnav.methods.smoother.sense_kernel import (
    array,
    directions,
    field,
    fixes,
    height,
    shape,
)


@njit(cache=True)
def linearise(
    link: FloatArray,
    states: States,
    motions: Motions,
    senses: Senses,
    prior: Prior,
    rows: IntArray,
    start: int,
) -> float:
    """Fill links of a chain, each between its keyframe and the one before; return twice their cost.

    Parameters
    ----------
    link : ndarray, shape (n, 31 + b, 31 + b)
        As in ``Chain``.
    states, motions, senses, prior
    rows : ndarray of int, shape (m,)
    start : int
        The keyframe that nothing comes before: it has the prior for a motion.
    """
    cost, width = 0.0, link.shape[1]
    before, after = np.zeros((STATE, width)), np.zeros((width - STATE - 1, width - STATE))
    rest = np.zeros((9, width - STATE))
    for row in rows:
        out = link[row]
        out[:] = 0.0
        if row == start:
            _prior(after, prior, states, row)
            add_square(out, after)
        else:
            _motion(before, states, motions, row)
            add_square(out, whitened(motions.white[row], before))
        array(rest, states, senses, row)
        add_square(out, rest)
        shape(out, states, senses, row)
        fixes(rest, out, states, senses, row)
        directions(rest, out, states, senses, row)
        height(rest, out, states, senses, row)
        field(rest, out, states, senses, row)
        cost += out[width - 1, width - 1]
    return cost


@njit(cache=True)
def predict(states: States, motions: Motions, row: int) -> None:
    """Set the state of a keyframe to where the motion leads from the one before."""
    R, p, v, _ = _predicted(states, motions, row)
    put_state(states, row, R, p, v, states.slot[row - 1])


@njit(cache=True)
def put_state(
    states: States, row: int, R: FloatArray, p: FloatArray, v: FloatArray, slot: FloatArray
) -> None:
    """Set the state of a keyframe."""
    for i in range(3):
        states.p_n_m[row, i], states.v_n_mps[row, i] = p[i], v[i]
        for j in range(3):
            states.R_nb[row, i, j] = R[i, j]
    for i in range(6):
        states.slot[row, i] = slot[i]


@njit(cache=True)
def move(
    states: States, steps: FloatArray, first: int, moved: States, into: int, wholly: bool
) -> None:
    """Fill states with others a step away, constants excepted; else poses alone are moved.

    Parameters
    ----------
    states : States
    steps : ndarray, shape (m, 15 + b)
        Of states ``first`` to ``first + m``.
    moved : States
        Filled from ``into`` on; it may be ``states`` itself.
    wholly : bool
    """
    turn, shift = np.empty(3), np.empty(3)
    for m in range(len(steps)):
        k, to, step = first + m, into + m, steps[m]
        for i in range(3):
            turn[i], shift[i] = step[i], step[3 + i]
        apart = rot.times(states.R_nb[k], shift)
        turned = rot.product(states.R_nb[k], rot.exp(turn))
        for i in range(3):
            moved.p_n_m[to, i] = states.p_n_m[k, i] + apart[i]
            for j in range(3):
                moved.R_nb[to, i, j] = turned[i, j]
        if wholly:
            for i in range(3):
                moved.v_n_mps[to, i] = states.v_n_mps[k, i] + step[6 + i]
            for i in range(6):
                moved.slot[to, i] = states.slot[k, i] + step[9 + i]


@njit(cache=True)
def _predicted(
    states: States, motions: Motions, row: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return rotation, position and velocity that a motion leads to, and what it gained, (9,)."""
    k, dt = row - 1, motions.span_s[row]
    R, v, earth, g = (
        states.R_nb[k],
        states.v_n_mps[k],
        motions.earth_rate_n_radps[row],
        motions.gravity_n_mps2[row],
    )
    z, change = motions.gained[row].copy(), states.slot[k] - motions.about[row]
    more = rot.times(motions.correction[row], change)
    turn, p_b, v_b = np.empty(3), np.empty(3), np.empty(3)
    for i in range(9):
        z[i] += more[i]
    for i in range(3):
        turn[i], p_b[i], v_b[i] = z[i], z[3 + i], z[6 + i]
    p, w = rot.times(R, p_b), rot.times(R, v_b)
    swing = rot.times(rot.skew(earth), v)
    for i in range(3):
        p[i] += states.p_n_m[k, i] + v[i] * dt + (g[i] / 2 - swing[i]) * dt**2
        w[i] += v[i] + (g[i] - 2 * swing[i]) * dt
    under = rot.exp(rot.scaled(earth, -dt))  # the frame n turns away beneath the body
    return rot.product(under, rot.product(R, rot.exp(turn))), p, w, z


@njit(cache=True)
def _motion(E: FloatArray, states: States, motions: Motions, row: int) -> None:
    """Fill the motion's residual, negative, and its derivatives by both states, (15, 31 + b).

    Predicted less actual, in the axes of the later keyframe: rotation vector, position, velocity,
    then the slot's earlier value less its later one.
    """
    k, dt, end = row - 1, motions.span_s[row], E.shape[1] - 1
    R_pred, p, v, z = _predicted(states, motions, row)
    R, to_b = states.R_nb[k], rot.transposed(states.R_nb[row])
    between, off = rot.product(to_b, R), rot.turn(states.R_nb[row], R_pred)
    p, v = rot.times(to_b, p - states.p_n_m[row]), rot.times(to_b, v - states.v_n_mps[row])
    turn, p_b, v_b = z[:3].copy(), z[3:6].copy(), z[6:].copy()
    by_end, by_turn = rot.inverse_right_jacobian(off), rot.right_jacobian(turn)
    by_gain = rot.product(by_end, by_turn)
    swung = rot.product(to_b, rot.skew(motions.earth_rate_n_radps[row]))
    E[:] = 0.0
    put(E, ROTATION, ROTATION, rot.product(by_end, rot.transposed(rot.exp(turn))), 1.0)
    put(E, ROTATION, NEXT, rot.product(by_end, rot.transposed(rot.exp(off))), -1.0)
    put(E, POSITION, ROTATION, rot.product(between, rot.skew(p_b)), -1.0)
    put(E, POSITION, POSITION, between, 1.0)
    put(E, POSITION, VELOCITY, to_b, dt)
    put(E, POSITION, VELOCITY, swung, -(dt**2))
    put(E, POSITION, NEXT, rot.skew(p), 1.0)
    put(E, VELOCITY, ROTATION, rot.product(between, rot.skew(v_b)), -1.0)
    put(E, VELOCITY, VELOCITY, to_b, 1.0)
    put(E, VELOCITY, VELOCITY, swung, -2 * dt)
    put(E, VELOCITY, NEXT, rot.skew(v), 1.0)
    put(E, VELOCITY, NEXT + VELOCITY, to_b, -1.0)
    by_slot = motions.correction[row]
    put(E, ROTATION, SLOT, rot.product(by_gain, by_slot[:3]), 1.0)
    put(E, POSITION, SLOT, rot.product(between, by_slot[3:6]), 1.0)
    put(E, VELOCITY, SLOT, rot.product(between, by_slot[6:]), 1.0)
    for i in range(3):
        E[3 + i, STATE + 3 + i] = -1.0
        E[i, end], E[3 + i, end], E[6 + i, end] = -off[i], -p[i], -v[i]
    for i in range(6):
        E[9 + i, 9 + i], E[9 + i, STATE + 9 + i] = 1.0, -1.0
        E[9 + i, end] = states.slot[row, i] - states.slot[k, i]


@njit(cache=True)
def _prior(E: FloatArray, prior: Prior, states: States, row: int) -> None:
    """Fill what is known before the first keyframe, whitened, (15 + b, 16 + b)."""
    E[:] = 0.0
    R_0, end = rot.transposed(prior.R_nb), E.shape[1] - 1
    off = rot.turn(prior.R_nb, states.R_nb[row])
    moved = rot.times(R_0, states.p_n_m[row] - prior.p_n_m)
    put(E, ROTATION, ROTATION, rot.inverse_right_jacobian(off), 1.0)
    put(E, POSITION, POSITION, rot.product(R_0, states.R_nb[row]), 1.0)
    for i in range(3):
        E[i, end], E[3 + i, end], E[6 + i, end] = -off[i], -moved[i], -states.v_n_mps[row, i]
        E[6 + i, 6 + i] = 1.0
    for i in range(6):
        E[9 + i, 9 + i], E[9 + i, end] = 1.0, -states.slot[row, i]
    for i in range(STATE):
        for j in range(end + 1):
            E[i, j] /= prior.sigma[i]
    for i in range(end - STATE):
        for j in range(i + 1):
            white = prior.constants_white[i, j]
            E[STATE + i, STATE + j] = white
            E[STATE + i, end] -= white * (states.constants[j] - prior.constants[j])
