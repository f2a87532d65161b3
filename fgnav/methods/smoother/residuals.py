"""Residuals of the measurements at keyframes and their Jacobians, for judging a solution.

Whitened by the stated noise. Columns of a Jacobian: rotation tangent, position in body axes,
velocity, as in ``Solution``. The search for the solution has its
own, in ``link_kernel``.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.attitude.quadratic import tangent_jacobian
from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother.graph import Solution
from fgnav.methods.smoother.keyframes import Keyframes, Timed
from fgnav.methods.smoother.links import across
from fgnav.rotations import skew, transpose

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
    jacobian : ndarray, shape (k, m, 9)
    freedom : ndarray of int, shape (k,)
        How many of the m the measurement tells.
    """

    what: str
    row: IntArray
    value: FloatArray
    jacobian: FloatArray
    freedom: IntArray


def residuals(keyframes: Keyframes, solution: Solution) -> tuple[Residuals, ...]:
    """Return the residuals of every kind of measurement that the keyframes have."""
    found = [_array(keyframes, solution)]
    if keyframes.position is not None:
        found.append(_position(keyframes.position, solution))
    if keyframes.velocity is not None:
        found.append(_velocity(keyframes.velocity, solution))
    if keyframes.gravity is not None:
        down_n = keyframes.gravity_n_mps2
        e_b, sigma_rad = keyframes.gravity.e_b, keyframes.gravity.sigma_rad
        found.append(_direction("gravity", down_n, e_b, sigma_rad, solution, near=False))
    if keyframes.sight is not None and keyframes.landmark_n_m is not None:
        to_n_m = keyframes.landmark_n_m - solution.p_n_m
        e_b, sigma_rad = keyframes.sight.e_b, keyframes.sight.sigma_rad
        found.append(_direction("line of sight", to_n_m, e_b, sigma_rad, solution, near=True))
    return tuple(part for part in found if len(part.row))


def _array(keyframes: Keyframes, solution: Solution) -> Residuals:
    row = np.flatnonzero(keyframes.array.there)
    root, R_nb = keyframes.array.root[row], solution.R_nb[row]
    apart = (R_nb - keyframes.array.minimum[row]).reshape(-1, 9)
    jacobian = np.zeros((len(row), 9, _STATE))
    jacobian[:, :, :3] = root @ tangent_jacobian(R_nb)
    return Residuals(
        what="array phases",
        row=row,
        value=np.einsum("nij,nj->ni", root, apart),
        jacobian=jacobian,
        freedom=root.any(axis=2).sum(axis=1),
    )


def _position(position: Timed, solution: Solution) -> Residuals:
    row = np.flatnonzero(np.isfinite(position.value[:, 0]))
    R_nb = solution.R_nb[row]
    jacobian = np.zeros((len(row), 3, _STATE))
    jacobian[:, :, :3] = -R_nb @ skew(position.arm_b_m[None])
    jacobian[:, :, 3:6] = R_nb
    apart = solution.p_n_m[row] + R_nb @ position.arm_b_m - position.value[row]
    return _whitened("position", row, apart, jacobian, position.covariance[row])


def _velocity(velocity: Timed, solution: Solution) -> Residuals:
    row = np.flatnonzero(np.isfinite(velocity.value[:, 0]))
    jacobian = np.zeros((len(row), 3, _STATE))
    jacobian[:, :, 6:9] = np.eye(3)
    apart = solution.v_n_mps[row] - velocity.value[row]
    return _whitened("velocity", row, apart, jacobian, velocity.covariance[row])


def _direction(
    what: str,
    v_n: FloatArray,
    e_b: FloatArray,
    sigma_rad: FloatArray,
    solution: Solution,
    *,
    near: bool,
) -> Residuals:
    """Return where a known vector, (n, 3), stands across its measured direction.

    One to a near point turns when the body moves.
    """
    row = np.flatnonzero(np.isfinite(e_b[:, 0]))
    R_bn = transpose(solution.R_nb[row])
    distance = np.linalg.norm(v_n[row], axis=1)[:, None, None]
    u_b = np.einsum("nij,nj->ni", R_bn, v_n[row]) / distance[:, :, 0]
    whitened = across(e_b[row]) / sigma_rad[row, None, None]
    jacobian = np.zeros((len(row), 2, _STATE))
    jacobian[:, :, :3] = whitened @ skew(u_b)
    if near:
        flat = u_b[:, :, None] * u_b[:, None, :] - np.eye(3)
        jacobian[:, :, 3:6] = whitened @ flat / distance
    return Residuals(
        what=what,
        row=row,
        value=np.einsum("nij,nj->ni", whitened, u_b),
        jacobian=jacobian,
        freedom=np.full(len(row), 2),
    )


def _whitened(
    what: str, row: IntArray, apart: FloatArray, jacobian: FloatArray, covariance: FloatArray
) -> Residuals:
    white = np.linalg.inv(np.linalg.cholesky(covariance))
    return Residuals(
        what=what,
        row=row,
        value=np.einsum("nij,nj->ni", white, apart),
        jacobian=white @ jacobian,
        freedom=np.full(len(row), len(white[0]) if len(row) else 0),
    )
