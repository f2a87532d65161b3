"""Residuals of the measurements at keyframes and their Jacobians, for judging a solution.

Whitened by the stated noise. Columns of a Jacobian: rotation tangent, position in body axes,
velocity, as in ``Solution``, then what all keyframes share. The search for the solution has its
own, in ``link_kernel``.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.attitude.quadratic import tangent_jacobian
from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother.array_shape import BaselineForm
from fgnav.methods.smoother.constants import (
    ANTENNAS,
    BORESIGHT,
    GRAVITY,
    HEIGHT,
    IRON,
    LANDMARK,
    LEVER,
    PIECE,
)
from fgnav.methods.smoother.directions import Directions
from fgnav.methods.smoother.keyframes import Keyframes, Timed
from fgnav.methods.smoother.solution import Solution
from fgnav.methods.smoother.surroundings import Heights, MagneticField
from fgnav.rotation_kernel import right_jacobian
from fgnav.rotations import exp, skew, transpose

_STATE = 9  # rotation, position, velocity


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Residuals:
    """Whitened residuals of one kind of measurement.

    Attributes
    ----------
    what : str
    row : ndarray of int, shape (k,)
        Keyframes that have one.
    value : ndarray, shape (k, m)
    jacobian : ndarray, shape (k, m, 9 + b)
    freedom : ndarray of int, shape (k,)
        How many of the m the measurement tells.
    """

    what: str
    row: IntArray
    value: FloatArray
    jacobian: FloatArray
    freedom: IntArray


@dataclass(frozen=True, eq=False, slots=True)
class _Shared:
    """What all keyframes share, as a solution has it: values, (b,), and columns by kind."""

    value: FloatArray
    columns: IntArray

    @classmethod
    def of(cls, keyframes: Keyframes, solution: Solution) -> "_Shared":
        found = solution.shared
        value = keyframes.shared_mean if found is None else found.value
        return cls(value, keyframes.columns)

    @property
    def width(self) -> int:
        """Columns of a Jacobian."""
        return _STATE + len(self.value)

    def __getitem__(self, kind: tuple[int, int]) -> FloatArray:
        """Return the values of a kind, by place and size; zeros where it is not estimated."""
        first = self.columns[kind[0]]
        return np.zeros(kind[1]) if first < 0 else self.value[first : first + kind[1]]

    def put(self, jacobian: FloatArray, place: int, block: FloatArray) -> None:
        """Set the derivative by a kind, (k, m, d), if it is estimated."""
        if self.columns[place] >= 0:
            first = _STATE + self.columns[place]
            jacobian[:, :, first : first + block.shape[2]] = block


def residuals(keyframes: Keyframes, solution: Solution) -> tuple[Residuals, ...]:
    """Return the residuals of every kind of measurement that the keyframes have."""
    shared = _Shared.of(keyframes, solution)
    found = [_array(keyframes, solution, shared)]
    if keyframes.baselines is not None:
        found.append(_shape(keyframes.baselines, solution, shared))
    if keyframes.position is not None:
        found.append(_position(keyframes.position, solution, shared))
    if keyframes.velocity is not None:
        found.append(_velocity(keyframes, keyframes.velocity, solution, shared))
    if keyframes.gravity is not None:
        found.append(_gravity(keyframes, keyframes.gravity, solution, shared))
    if keyframes.sight is not None and keyframes.landmark_n_m is not None:
        found.append(_sight(keyframes.sight, solution, shared))
    if keyframes.heights is not None:
        found.append(_heights(keyframes.heights, solution, shared))
    if keyframes.field is not None:
        found.append(_field(keyframes.field, solution, shared))
    return tuple(part for part in found if len(part.row))


def _array(keyframes: Keyframes, solution: Solution, shared: _Shared) -> Residuals:
    floating = keyframes.array.floating
    row = np.flatnonzero(keyframes.rigid & (True if floating is None else floating < 0))
    root, R_nb = keyframes.array.root[row], solution.R_nb[row]
    apart = (R_nb - keyframes.array.minimum[row]).reshape(-1, 9)
    jacobian = np.zeros((len(row), 9, shared.width))
    jacobian[:, :, :3] = root @ tangent_jacobian(R_nb)
    return Residuals(
        what="array phases",
        row=row,
        value=np.einsum("nij,nj->ni", root, apart),
        jacobian=jacobian,
        freedom=root.any(axis=2).sum(axis=1),
    )


def _shape(shape: BaselineForm, solution: Solution, shared: _Shared) -> Residuals:
    row = np.flatnonzero(shape.there)
    R_nb, root, arms_b_m = solution.R_nb[row], shape.root[row], shape.baselines_b_m.copy()
    apart, jacobian = (
        np.zeros((len(row), *arms_b_m.shape)),
        np.zeros((*root.shape[:2], shared.width)),
    )
    for i in range(len(arms_b_m)):
        arms_b_m[i] += shared[ANTENNAS + i, 3]
        shared.put(jacobian, ANTENNAS + i, root[:, :, 3 * i : 3 * i + 3] @ R_nb)
        by_turn = -R_nb @ skew(arms_b_m[i : i + 1])
        jacobian[:, :, :3] += root[:, :, 3 * i : 3 * i + 3] @ by_turn
        apart[:, i] = R_nb @ arms_b_m[i] - shape.minimum[row, i]
    return Residuals(
        what="array phases",
        row=row,
        value=np.einsum("nij,nj->ni", root, apart.reshape(len(row), -1)),
        jacobian=jacobian,
        freedom=root.any(axis=2).sum(axis=1),
    )


def _position(position: Timed, solution: Solution, shared: _Shared) -> Residuals:
    row = np.flatnonzero(np.isfinite(position.value[:, 0]))
    R_nb, arm_b_m = solution.R_nb[row], position.arm_b_m + shared[LEVER, 3]
    jacobian = np.zeros((len(row), 3, shared.width))
    jacobian[:, :, :3] = -R_nb @ skew(arm_b_m[None])
    jacobian[:, :, 3:6] = R_nb
    shared.put(jacobian, LEVER, R_nb)
    apart = solution.p_n_m[row] + R_nb @ arm_b_m - position.value[row]
    if position.piece is not None and shared.columns[PIECE] >= 0:
        own = np.flatnonzero(position.piece[row] >= 0)
        first = shared.columns[PIECE] + 3 * position.piece[row[own], None] + np.arange(3)
        apart[own] += shared.value[first]
        jacobian[own[:, None], np.arange(3), _STATE + first] = 1.0
    return _whitened("position", row, apart, jacobian, position.white(row))


def _velocity(
    keyframes: Keyframes, velocity: Timed, solution: Solution, shared: _Shared
) -> Residuals:
    row = np.flatnonzero(np.isfinite(velocity.value[:, 0]))
    R_nb, spin = solution.R_nb[row], skew(keyframes.rate_b_radps[row])
    swing_b_mps = spin @ shared[LEVER, 3]
    jacobian = np.zeros((len(row), 3, shared.width))
    jacobian[:, :, 6:9] = np.eye(3)
    jacobian[:, :, :3] = -R_nb @ skew(swing_b_mps)
    shared.put(jacobian, LEVER, R_nb @ spin)
    swing_n_mps = np.einsum("nij,nj->ni", R_nb, swing_b_mps)
    apart = solution.v_n_mps[row] + swing_n_mps - velocity.value[row]
    return _whitened("velocity", row, apart, jacobian, velocity.white(row))


def _gravity(
    keyframes: Keyframes, gravity: Directions, solution: Solution, shared: _Shared
) -> Residuals:
    v_n = keyframes.gravity_n_mps2[gravity.row]
    return _direction("gravity", v_n, gravity, solution, shared, GRAVITY)


def _sight(sight: Directions, solution: Solution, shared: _Shared) -> Residuals:
    """Return residuals of directions to a near point: they turn when the body moves, or it."""
    row = sight.row
    v_n = shared[LANDMARK, 3] - solution.p_n_m[row]
    part = _direction("line of sight", v_n, sight, solution, shared, BORESIGHT)
    R_bn = transpose(solution.R_nb[row])
    distance = np.linalg.norm(v_n, axis=1)[:, None, None]
    u_b = (R_bn @ v_n[:, :, None]) / distance
    flat = (u_b * u_b.swapaxes(1, 2) - np.eye(3)) / distance
    tilted = _across(sight, shared, BORESIGHT)
    part.jacobian[:, :, 3:6] = tilted @ flat
    shared.put(part.jacobian, LANDMARK, -tilted @ flat @ R_bn)
    return part


def _heights(heights: Heights, solution: Solution, shared: _Shared) -> Residuals:
    row = np.flatnonzero(np.isfinite(heights.down_n_m))
    R_nb, times = solution.R_nb[row], len(heights.offset.start)
    hat = (1 - np.abs(heights.place[row, None] - np.arange(times))).clip(0)
    jacobian = np.zeros((len(row), 1, shared.width))
    jacobian[:, 0, :3] = -(R_nb @ skew(heights.arm_b_m[None]))[:, 2]
    jacobian[:, 0, 3:6] = R_nb[:, 2]
    shared.put(jacobian, HEIGHT, -hat[:, None])
    apart = solution.p_n_m[row, 2] + R_nb[:, 2] @ heights.arm_b_m - heights.down_n_m[row]
    apart -= hat @ shared[HEIGHT, times]
    return Residuals(
        what="barometric height",
        row=row,
        value=apart[:, None] / heights.sigma_m,
        jacobian=jacobian / heights.sigma_m,
        freedom=np.ones(len(row), dtype=np.int64),
    )


def _field(field: MagneticField, solution: Solution, shared: _Shared) -> Residuals:
    row = field.directions.row
    earth_b = transpose(solution.R_nb[row]) @ field.field_n_ut
    size = np.linalg.norm(earth_b + shared[IRON, 3], axis=1)[:, None, None]
    u_b = (earth_b + shared[IRON, 3])[:, :, None] / size
    whitened = field.directions.across_b[row]
    by_field = whitened @ (np.eye(3) - u_b * u_b.swapaxes(1, 2)) / size
    jacobian = np.zeros((len(row), 2, shared.width))
    jacobian[:, :, :3] = by_field @ skew(earth_b)
    shared.put(jacobian, IRON, by_field)
    return Residuals(
        what="magnetic field",
        row=row,
        value=(whitened @ u_b)[:, :, 0],
        jacobian=jacobian,
        freedom=np.full(len(row), 2),
    )


_FIRST_AXIS = {GRAVITY: 0, BORESIGHT: 1}  # of the two that an instrument may be turned about


def _across(directions: Directions, shared: _Shared, place: int) -> FloatArray:
    """Return what takes a unit vector to its residual, (k, 2, 3), as the instrument is turned."""
    return np.asarray(directions.across_b[directions.row] @ exp(_tilt(shared, place)[None])[0])


def _tilt(shared: _Shared, place: int) -> FloatArray:
    """Return the rotation vector back from how an instrument is turned, (3,)."""
    tilt_b, first = np.zeros(3), _FIRST_AXIS[place]
    tilt_b[first : first + 2] = -shared[place, 2]
    return tilt_b


def _direction(
    what: str,
    v_n: FloatArray,
    directions: Directions,
    solution: Solution,
    shared: _Shared,
    place: int,
) -> Residuals:
    """Return where known vectors, (k, 3), stand across their measured directions."""
    row, first = directions.row, _FIRST_AXIS[place]
    R_bn = transpose(solution.R_nb[row])
    u_b = np.einsum("nij,nj->ni", R_bn, v_n) / np.linalg.norm(v_n, axis=1)[:, None]
    tilted = _across(directions, shared, place)
    jacobian = np.zeros((len(row), 2, shared.width))
    jacobian[:, :, :3] = tilted @ skew(u_b)
    by_tilt = jacobian[:, :, :3] @ right_jacobian(_tilt(shared, place))
    shared.put(jacobian, place, by_tilt[:, :, first : first + 2])
    return Residuals(
        what=what,
        row=row,
        value=np.einsum("nij,nj->ni", tilted, u_b),
        jacobian=jacobian,
        freedom=np.full(len(row), 2),
    )


def _whitened(
    what: str, row: IntArray, apart: FloatArray, jacobian: FloatArray, white: FloatArray
) -> Residuals:
    return Residuals(
        what=what,
        row=row,
        value=np.einsum("nij,nj->ni", white, apart),
        jacobian=white @ jacobian,
        freedom=white.any(axis=2).sum(axis=1),
    )
