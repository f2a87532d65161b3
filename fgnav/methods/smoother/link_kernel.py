"""Links of a chain linearised where the states stand: motion, measurements, prior.

What GTSAM's factors say, at a fifth of the time; the tests hold one against the other.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother import rotation_kernel as rot
from fgnav.methods.smoother.chain_kernel import STATE

_PRIOR_ROWS = STATE + 3


class States(NamedTuple):
    """Where keyframes are linearised; the landmark belongs to all of them."""

    R_nb: FloatArray  # (n, 3, 3)
    p_n_m: FloatArray  # (n, 3)
    v_n_mps: FloatArray  # (n, 3)
    slot: FloatArray  # (n, 6)
    landmark_n_m: FloatArray  # (3,)


class Motions(NamedTuple):
    """How the body came to each keyframe from the one before, see ``motion_kernel``."""

    span_s: FloatArray  # (n,)
    about: FloatArray  # (n, 6), the slot it is integrated about
    gained: FloatArray  # (n, 9)
    correction: FloatArray  # (n, 9, 6)
    white: FloatArray  # (n, 15, 15)
    gravity_n_mps2: FloatArray  # (n, 3), at the keyframe before
    earth_rate_n_radps: FloatArray  # (n, 3)


class Senses(NamedTuple):
    """What keyframes measured; what weighs nothing was not there.

    Any number of positions, velocities and known directions may be told at each keyframe.
    """

    root: FloatArray  # (n, 9, 9), of the array's form
    minimum: FloatArray  # (n, 3, 3)
    position_n_m: FloatArray  # (n, k, 3)
    position_white: FloatArray  # (n, k, 3, 3)
    arm_b_m: FloatArray  # (n, k, 3)
    velocity_n_mps: FloatArray  # (n, k, 3)
    velocity_white: FloatArray  # (n, k, 3, 3)
    known_n: FloatArray  # (n, k, 3), unit vectors
    known_across_b: FloatArray  # (n, k, 2, 3), across the measured ones, over sigma
    sight_across_b: FloatArray  # (n, 2, 3)


class Prior(NamedTuple):
    """What is known before the first keyframe, of its state and of the landmark."""

    R_nb: FloatArray  # (3, 3)
    p_n_m: FloatArray  # (3,)
    sigma: FloatArray  # (15,)
    landmark_n_m: FloatArray  # (3,)
    landmark_white: FloatArray  # (3, 3)


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
    before, after = np.zeros((STATE, width)), np.zeros((_PRIOR_ROWS, width - STATE))
    rest = np.zeros((9, width - STATE))
    for row in rows:
        out = link[row]
        out[:] = 0.0
        if row == start:
            _prior(after, prior, states, row)
            _add_square(out, after, STATE)
        else:
            _motion(before, states, motions, row)
            _add_square(out, _whitened(motions.white[row], before), 0)
        _array(rest, states, senses, row)
        _add_square(out, rest, STATE)
        _fixes(rest, out, states, senses, row)
        _directions(rest, out, states, senses, row)
        _mirror(out)
        cost += out[width - 1, width - 1]
    return cost


@njit(cache=True)
def predict(states: States, motions: Motions, row: int) -> None:
    """Set the state of a keyframe to where the motion leads from the one before."""
    R, p, v, _ = _predicted(states, motions, row)
    states.R_nb[row], states.p_n_m[row], states.v_n_mps[row] = R, p, v
    states.slot[row] = states.slot[row - 1]


@njit(cache=True)
def move(
    states: States, steps: FloatArray, first: int, moved: States, into: int, wholly: bool
) -> None:
    """Fill states with others a step away, the landmark excepted; else poses alone are moved.

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
        for i in range(3):
            moved.p_n_m[to, i] = states.p_n_m[k, i] + apart[i]
        moved.R_nb[to] = rot.product(states.R_nb[k], rot.exp(turn))
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
    _put(E, 0, 0, rot.product(by_end, rot.transposed(rot.exp(turn))), 1.0)
    _put(E, 0, STATE, rot.product(by_end, rot.transposed(rot.exp(off))), -1.0)
    _put(E, 3, 0, rot.product(between, rot.skew(p_b)), -1.0)
    _put(E, 3, 3, between, 1.0)
    _put(E, 3, 6, to_b, dt)
    _put(E, 3, 6, swung, -(dt**2))
    _put(E, 3, STATE, rot.skew(p), 1.0)
    _put(E, 6, 0, rot.product(between, rot.skew(v_b)), -1.0)
    _put(E, 6, 6, to_b, 1.0)
    _put(E, 6, 6, swung, -2 * dt)
    _put(E, 6, STATE, rot.skew(v), 1.0)
    _put(E, 6, STATE + 6, to_b, -1.0)
    by_slot = motions.correction[row]
    _put(E, 0, 9, rot.product(by_gain, by_slot[:3]), 1.0)
    _put(E, 3, 9, rot.product(between, by_slot[3:6]), 1.0)
    _put(E, 6, 9, rot.product(between, by_slot[6:]), 1.0)
    for i in range(3):
        E[3 + i, STATE + 3 + i] = -1.0
        E[i, end], E[3 + i, end], E[6 + i, end] = -off[i], -p[i], -v[i]
    for i in range(6):
        E[9 + i, 9 + i], E[9 + i, STATE + 9 + i] = 1.0, -1.0
        E[9 + i, end] = states.slot[row, i] - states.slot[k, i]


@njit(cache=True)
def _prior(E: FloatArray, prior: Prior, states: States, row: int) -> None:
    """Fill what is known before the first keyframe, whitened, (18, 16 + b)."""
    E[:] = 0.0
    R_0, end = rot.transposed(prior.R_nb), E.shape[1] - 1
    off = rot.turn(prior.R_nb, states.R_nb[row])
    moved = rot.times(R_0, states.p_n_m[row] - prior.p_n_m)
    _put(E, 0, 0, rot.inverse_right_jacobian(off), 1.0)
    _put(E, 3, 3, rot.product(R_0, states.R_nb[row]), 1.0)
    for i in range(3):
        E[i, end], E[3 + i, end], E[6 + i, end] = -off[i], -moved[i], -states.v_n_mps[row, i]
        E[6 + i, 6 + i] = 1.0
    for i in range(6):
        E[9 + i, 9 + i], E[9 + i, end] = 1.0, -states.slot[row, i]
    for i in range(STATE):
        for j in range(end + 1):
            E[i, j] /= prior.sigma[i]
    if end > STATE:
        apart = rot.times(prior.landmark_white, states.landmark_n_m - prior.landmark_n_m)
        _put(E, STATE, STATE, prior.landmark_white, 1.0)
        for i in range(3):
            E[STATE + i, end] = -apart[i]


@njit(cache=True)
def _array(E: FloatArray, states: States, senses: Senses, row: int) -> None:
    """Fill the residual of the array's form and its derivative, (9, 16 + b)."""
    E[:] = 0.0
    R, root, apart = states.R_nb[row], senses.root[row], np.empty(9)
    by_turn = np.zeros((9, 3))  # of R by row: the axes' own turns
    for i in range(3):
        for j in range(3):
            apart[3 * i + j] = R[i, j] - senses.minimum[row, i, j]
            by_turn[3 * i + (j + 1) % 3, j] = R[i, (j + 2) % 3]
            by_turn[3 * i + (j + 2) % 3, j] = -R[i, (j + 1) % 3]
    _fill(E, 0, rot.product(root, by_turn), rot.times(root, apart))


@njit(cache=True)
def _fixes(E: FloatArray, out: FloatArray, states: States, senses: Senses, row: int) -> None:
    """Add positions and velocities to a link; E, (9, 16 + b), is room to work in."""
    R = states.R_nb[row]
    for k in range(senses.position_n_m.shape[1]):
        white, arm = senses.position_white[row, k], senses.arm_b_m[row, k]
        E[:] = 0.0
        apart = states.p_n_m[row] + rot.times(R, arm) - senses.position_n_m[row, k]
        turned = rot.product(white, R)
        _fill(E, 3, turned, rot.times(white, apart))
        _put(E, 0, 0, rot.product(turned, rot.skew(arm)), -1.0)
        _add_square(out, E[:3], STATE)
    for k in range(senses.velocity_n_mps.shape[1]):
        white = senses.velocity_white[row, k]
        E[:] = 0.0
        apart = states.v_n_mps[row] - senses.velocity_n_mps[row, k]
        _fill(E, 6, white, rot.times(white, apart))
        _add_square(out, E[:3], STATE)


@njit(cache=True)
def _directions(E: FloatArray, out: FloatArray, states: States, senses: Senses, row: int) -> None:
    """Add known directions and the line of sight to a link; E, (9, 16 + b), is room to work in."""
    to_b = rot.transposed(states.R_nb[row])
    for k in range(senses.known_n.shape[1]):
        across = senses.known_across_b[row, k]
        E[:] = 0.0
        u_b = rot.times(to_b, senses.known_n[row, k])
        _fill(E, 0, rot.product(across, rot.skew(u_b)), rot.times(across, u_b))
        _add_square(out, E[:2], STATE)
    if E.shape[1] == STATE + 1:  # no landmark
        return
    across = senses.sight_across_b[row]
    E[:] = 0.0
    u_b = rot.times(to_b, states.landmark_n_m - states.p_n_m[row])
    distance_m = np.sqrt(u_b[0] ** 2 + u_b[1] ** 2 + u_b[2] ** 2)
    u_b = rot.scaled(u_b, 1 / distance_m)
    flat = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            flat[i, j] = -u_b[i] * u_b[j] / distance_m
        flat[i, i] += 1 / distance_m
    by_place = rot.product(across, flat)
    _fill(E, 0, rot.product(across, rot.skew(u_b)), rot.times(across, u_b))
    _put(E, 0, 3, by_place, -1.0)
    _put(E, 0, STATE, rot.product(by_place, to_b), 1.0)
    _add_square(out, E[:2], STATE)


@njit(cache=True)
def _fill(E: FloatArray, column: int, J: FloatArray, r: FloatArray) -> None:
    """Set a residual, negative, and its derivative by three columns."""
    end = E.shape[1] - 1
    for i in range(len(r)):
        E[i, end] = -r[i]
        for j in range(3):
            E[i, column + j] = J[i, j]


@njit(cache=True)
def _put(E: FloatArray, row: int, column: int, block: FloatArray, factor: float) -> None:
    """Add a block times a factor."""
    for i in range(block.shape[0]):
        for j in range(block.shape[1]):
            E[row + i, column + j] += factor * block[i, j]


@njit(cache=True)
def _whitened(white: FloatArray, E: FloatArray) -> FloatArray:
    """Return a lower triangle times a matrix."""
    out = np.zeros_like(E)
    for i in range(len(E)):
        for k in range(i + 1):
            scale = white[i, k]
            if scale != 0.0:
                for j in range(E.shape[1]):
                    out[i, j] += scale * E[k, j]
    return out


@njit(cache=True)
def _add_square(out: FloatArray, E: FloatArray, first: int) -> None:
    """Add E'E to the upper triangle of a matrix, from a row and column on.

    Rows are summed up beside it: the compiler then knows that they are not E's.
    """
    n = E.shape[1]
    total = np.empty(n)
    for i in range(n):
        total[:] = 0.0
        for k in range(E.shape[0]):
            scale = E[k, i]
            if scale != 0.0:
                for j in range(n):
                    total[j] += scale * E[k, j]
        for j in range(i, n):
            out[first + i, first + j] += total[j]


@njit(cache=True)
def _mirror(out: FloatArray) -> None:
    """Copy the upper triangle to the lower."""
    for i in range(len(out)):
        for j in range(i):
            out[i, j] = out[j, i]
