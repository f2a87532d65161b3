"""What keyframes measured, linearised where the states stand: residuals, whitened, and derivatives.

What GTSAM's factors say, at a fifth of the time; the tests hold one against the other.
"""

import numpy as np
from numba import njit

from fgnav import rotation_kernel as rot
from fgnav.checks import FloatArray
from fgnav.methods.smoother.block_kernel import (
    NEXT,
    POSITION,
    ROTATION,
    TOP,
    VELOCITY,
    Place,
    add_square,
    fill,
    put,
)
from fgnav.methods.smoother.chain_kernel import STATE
from fgnav.methods.smoother.constants import (
    ANTENNAS,
    BORESIGHT,
    FLOAT,
    GRAVITY,
    HEIGHT,
    IRON,
    LANDMARK,
    LEVER,
    PIECE,
)
from fgnav.methods.smoother.link_types import Senses, States

_X, _Y = np.int64(0), np.int64(1)  # axes of the body; see ``block_kernel`` on why not 0 and 1


@njit(cache=True)
def array(E: FloatArray, states: States, senses: Senses, row: int) -> None:
    """Fill the residual of the array's form and its derivative, (9, 16 + b)."""
    E[:] = 0.0
    R, root, apart = states.R_nb[row], senses.root[row], np.empty(9)
    by_turn = np.zeros((9, 3))  # of R by row: the axes' own turns
    for i in range(3):
        for j in range(3):
            apart[3 * i + j] = R[i, j] - senses.minimum[row, i, j]
            by_turn[3 * i + (j + 1) % 3, j] = R[i, (j + 2) % 3]
            by_turn[3 * i + (j + 2) % 3, j] = -R[i, (j + 1) % 3]
    if states.columns[FLOAT] >= 0 and senses.floating[row] >= 0.0:  # beside unknown elements
        first = states.columns[FLOAT] + 9 * int(senses.floating[row])
        apart += states.constants[first : first + 9]
        put(E, TOP, NEXT + first, root, 1.0)
    fill(E, ROTATION, rot.product(root, by_turn), rot.times(root, apart))


@njit(cache=True)
def shape(out: FloatArray, states: States, senses: Senses, row: int) -> None:
    """Add phases that tell the array's shape beside its attitude to a link."""
    count = len(states.baselines_b_m)
    if count == 0 or not senses.shape_root[row].any():
        return
    R, D = states.R_nb[row], np.zeros((3 * count, out.shape[1] - STATE))
    end = D.shape[1] - 1
    for i in range(count):
        place, arm = states.columns[ANTENNAS + i], states.baselines_b_m[i].copy()
        if place >= 0:
            arm += states.constants[place : place + 3]
            put(D, 3 * i, NEXT + place, R, 1.0)
        put(D, 3 * i, ROTATION, rot.product(R, rot.skew(arm)), -1.0)
        apart = rot.times(R, arm) - senses.shape_minimum_n_m[row, i]
        for c in range(3):
            D[3 * i + c, end] = -apart[c]
    add_square(out, rot.product(senses.shape_root[row], D))


@njit(cache=True)
def fixes(E: FloatArray, out: FloatArray, states: States, senses: Senses, row: int) -> None:
    """Add positions and velocities to a link; E, (9, 16 + b), is room to work in.

    An unknown lever arm is one from the accelerometer to all antennas; an unknown offset one of all
    positions of a stretch.
    """
    R, lever, rate = states.R_nb[row], states.columns[LEVER], senses.rate_b_radps[row]
    more = np.zeros(3)
    if lever >= 0:
        for i in range(3):
            more[i] = states.constants[lever + i]
    for k in range(senses.position_n_m.shape[1]):
        white, arm = senses.position_white[row, k], senses.arm_b_m[row, k] + more
        E[:] = 0.0
        apart = states.p_n_m[row] + rot.times(R, arm) - senses.position_n_m[row, k]
        turned = rot.product(white, R)
        put(E, TOP, ROTATION, rot.product(turned, rot.skew(arm)), -1.0)
        if lever >= 0:
            put(E, TOP, NEXT + lever, turned, 1.0)
        if states.columns[PIECE] >= 0 and senses.position_piece[row, k] >= 0.0:
            first = states.columns[PIECE] + 3 * int(senses.position_piece[row, k])
            apart += states.constants[first : first + 3]
            put(E, TOP, NEXT + first, white, 1.0)
        fill(E, POSITION, turned, rot.times(white, apart))
        add_square(out, E[:3])
    for k in range(senses.velocity_n_mps.shape[1]):
        white = senses.velocity_white[row, k]
        E[:] = 0.0
        apart = states.v_n_mps[row] - senses.velocity_n_mps[row, k]
        if lever >= 0:
            turned, spin = rot.product(white, R), rot.skew(rate)
            swing = rot.times(spin, more)
            apart += rot.times(R, swing)
            put(E, TOP, ROTATION, rot.product(turned, rot.skew(swing)), -1.0)
            put(E, TOP, NEXT + lever, rot.product(turned, spin), 1.0)
        fill(E, VELOCITY, white, rot.times(white, apart))
        add_square(out, E[:3])


@njit(cache=True)
def height(E: FloatArray, out: FloatArray, states: States, senses: Senses, row: int) -> None:
    """Add a barometric height to a link; E, (9, 16 + b), is room to work in."""
    weight, arm = senses.height_weight[row], senses.height_arm_b_m[row]
    if weight == 0.0:
        return
    R, first, share = states.R_nb[row], int(senses.height_at[row, 0]), senses.height_at[row, 1]
    column, E[:] = states.columns[HEIGHT] + first, 0.0
    apart = states.p_n_m[row, 2] - senses.height_down_n_m[row]
    turned = rot.product(R, rot.skew(arm))
    for j in range(3):
        apart += R[2, j] * arm[j]
        E[0, j], E[0, 3 + j] = -weight * turned[2, j], weight * R[2, j]
    apart -= (1.0 - share) * states.constants[column]
    E[0, STATE + column] = -weight * (1.0 - share)
    if share > 0.0:
        apart -= share * states.constants[column + 1]
        E[0, STATE + column + 1] = -weight * share
    E[0, E.shape[1] - 1] = -weight * apart
    add_square(out, E[:1])


@njit(cache=True)
def field(E: FloatArray, out: FloatArray, states: States, senses: Senses, row: int) -> None:
    """Add a direction of the magnetic field to a link; E, (9, 16 + b), is room to work in.

    That of the Earth's field and the vehicle's own together: its size must not count, or a field
    of the vehicle that takes some of the Earth's away would make all residuals smaller.
    """
    across, iron = senses.field_across_b[row], states.columns[IRON]
    if iron < 0 or not across.any():
        return
    E[:] = 0.0
    earth = rot.times(rot.transposed(states.R_nb[row]), senses.field_n_ut[row])
    own = states.constants[iron : iron + 3]
    size, flat = np.sqrt(((earth + own) ** 2).sum()), np.empty((3, 3))
    u_b = (earth + own) / size
    for i in range(3):
        for j in range(3):
            flat[i, j] = ((i == j) - u_b[i] * u_b[j]) / size
    by_field = rot.product(across, flat)
    fill(E, ROTATION, rot.product(by_field, rot.skew(earth)), rot.times(across, u_b))
    put(E, TOP, NEXT + iron, by_field, 1.0)
    add_square(out, E[:2])


@njit(cache=True)
def directions(E: FloatArray, out: FloatArray, states: States, senses: Senses, row: int) -> None:
    """Add known directions and the line of sight to a link; E, (9, 16 + b), is room to work in."""
    to_b = rot.transposed(states.R_nb[row])
    for k in range(senses.known_n.shape[1]):
        across = senses.known_across_b[row, k]
        if not across.any():
            continue
        E[:] = 0.0
        u_b = rot.times(to_b, senses.known_n[row, k])
        _tilted(E, across, u_b, states, states.columns[GRAVITY], _X)
        add_square(out, E[:2])
    landmark = states.columns[LANDMARK]
    if landmark < 0:
        return
    E[:] = 0.0
    place_n_m = states.constants[landmark : landmark + 3]
    u_b = rot.times(to_b, place_n_m - states.p_n_m[row])
    distance_m = np.sqrt(u_b[0] ** 2 + u_b[1] ** 2 + u_b[2] ** 2)
    u_b = rot.scaled(u_b, 1 / distance_m)
    flat = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            flat[i, j] = -u_b[i] * u_b[j] / distance_m
        flat[i, i] += 1 / distance_m
    across = _tilted(E, senses.sight_across_b[row], u_b, states, states.columns[BORESIGHT], _Y)
    by_place = rot.product(across, flat)
    put(E, TOP, POSITION, by_place, -1.0)
    put(E, TOP, NEXT + landmark, rot.product(by_place, to_b), 1.0)
    add_square(out, E[:2])


@njit(cache=True)
def _tilted(
    E: FloatArray, across: FloatArray, u_b: FloatArray, states: States, column: int, axis: Place
) -> FloatArray:
    """Fill the residual of a unit vector, and its derivative by rotation and instrument's tilt.

    An instrument that is turned by the vector t in the body sees ``Exp(-t) u``; two neighbouring
    elements of t, from ``axis`` on, are constants. Returns ``across Exp(-t)``.
    """
    tilt = np.zeros(3)
    if column >= 0:
        tilt[axis], tilt[axis + 1] = -states.constants[column], -states.constants[column + 1]
        across = rot.product(across, rot.exp(tilt))
    by_turn = rot.product(across, rot.skew(u_b))
    fill(E, ROTATION, by_turn, rot.times(across, u_b))
    if column >= 0:
        by_tilt = rot.product(by_turn, rot.right_jacobian(tilt))
        for i in range(2):
            for j in range(2):
                E[i, STATE + column + j] = by_tilt[i, axis + j]
    return across
