"""What outputs say of the states: residuals and Jacobians of each quantity that a network measures.

Residuals are estimate less output, in the output's tangent; Jacobians are by the tangents of
``fgnav.graph.keys``: rotation, then position, both in body axes; velocities in ``n``.
"""

from collections.abc import Callable
from typing import Any, TypeAlias

import gtsam
import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import skew
from fgnav.graph.custom import OwnFactor, residual_factor
from fgnav.graph.keys import pose, velocity
from fgnav.neural.manifest import Output

Maker: TypeAlias = Callable[[str, Output, tuple[int, int], FloatArray, FloatArray], OwnFactor]
_SLOWEST_MPS = 1e-6  # below, a speed has no direction: its Jacobian is that of the direction before


def factor_of(
    name: str, output: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    """Return the factor of one output.

    Parameters
    ----------
    name : str
        What reports call it.
    output : Output
    rows : (int, int)
        Keyframes: of the window's beginning, which displacements are from, and of its end.
    value : ndarray, shape (d,)
        In SI, as ``network.Answers``.
    covariance : ndarray, shape (f, f)
    """
    return _MAKERS[output.measures](name, output, rows, value, covariance)


def _heading(
    name: str, _: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    """``psi = atan2(R10, R00)``; turned by delta, R's first column moves by ``R (delta x e1)``."""

    def residual(x: Any) -> FloatArray:  # noqa: ANN401  # gtsam.Pose3
        R = x.rotation().matrix()
        turn = np.arctan2(R[1, 0], R[0, 0]) - value
        return np.asarray(np.arctan2(np.sin(turn), np.cos(turn)))

    def jacobian(x: Any) -> tuple[FloatArray]:  # noqa: ANN401  # as above
        R = x.rotation().matrix()
        row = (R[0, 0] * R[1] - R[1, 0] * R[0]) / (R[0, 0] ** 2 + R[1, 0] ** 2)
        return (np.array([[0.0, -row[2], row[1], 0.0, 0.0, 0.0]]),)

    return residual_factor(name, [pose(rows[1])], residual, covariance, jacobian=jacobian)


def _attitude(
    name: str, _: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    R = gtsam.Rot3(value.reshape(3, 3))
    return OwnFactor(name, gtsam.PoseRotationPrior3D(pose(rows[1]), R, noise))


def _direction(
    name: str, _: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    """``r = E' R' e3``, E two axes across the output: gravity is down in ``n``."""
    across = np.linalg.svd(value[None])[2][1:]

    def residual(x: Any) -> FloatArray:  # noqa: ANN401  # as above
        return np.asarray(across @ x.rotation().matrix()[2])

    def jacobian(x: Any) -> tuple[FloatArray]:  # noqa: ANN401  # as above
        by_turn = across @ skew(x.rotation().matrix()[2][None])[0]
        return (np.concatenate([by_turn, np.zeros((2, 3))], axis=1),)

    P = across @ covariance @ across.T
    noise = (P + P.T) / 2  # rounding
    return residual_factor(name, [pose(rows[1])], residual, noise, jacobian=jacobian)


def _velocity(
    name: str, output: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    k = rows[1]
    if output.frame == "n":
        noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
        return OwnFactor(name, gtsam.PriorFactorVector(velocity(k), value, noise))

    def residual(x: Any, v_n_mps: FloatArray) -> FloatArray:  # noqa: ANN401  # as above
        return np.asarray(x.rotation().matrix().T @ v_n_mps - value)

    def jacobian(x: Any, v_n_mps: FloatArray) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401
        R = x.rotation().matrix()
        return np.concatenate([skew((R.T @ v_n_mps)[None])[0], np.zeros((3, 3))], axis=1), R.T

    keys = [pose(k), velocity(k)]
    return residual_factor(name, keys, residual, covariance, jacobian=jacobian)


def _speed(
    name: str, _: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    def residual(v_n_mps: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(v_n_mps) - value)

    def jacobian(v_n_mps: FloatArray) -> tuple[FloatArray]:
        return (v_n_mps[None] / max(float(np.linalg.norm(v_n_mps)), _SLOWEST_MPS),)

    return residual_factor(name, [velocity(rows[1])], residual, covariance, jacobian=jacobian)


def _height(
    name: str, _: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    def residual(x: Any) -> FloatArray:  # noqa: ANN401  # as above
        return np.asarray(-x.translation()[2] - value)

    def jacobian(x: Any) -> tuple[FloatArray]:  # noqa: ANN401  # as above
        return (np.concatenate([np.zeros(3), -x.rotation().matrix()[2]])[None],)

    return residual_factor(name, [pose(rows[1])], residual, covariance, jacobian=jacobian)


def _position(
    name: str, _: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    def residual(x: Any) -> FloatArray:  # noqa: ANN401  # as above
        return np.asarray(x.translation() - value)

    def jacobian(x: Any) -> tuple[FloatArray]:  # noqa: ANN401  # as above
        return (np.concatenate([np.zeros((3, 3)), x.rotation().matrix()], axis=1),)

    return residual_factor(name, [pose(rows[1])], residual, covariance, jacobian=jacobian)


def _displacement(
    name: str, output: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    in_body = output.frame == "b"

    def residual(a: Any, b: Any) -> FloatArray:  # noqa: ANN401  # as above
        moved_n_m = b.translation() - a.translation()
        return np.asarray((a.rotation().matrix().T @ moved_n_m if in_body else moved_n_m) - value)

    def jacobian(a: Any, b: Any) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401  # as above
        R_a, R_b, none = a.rotation().matrix(), b.rotation().matrix(), np.zeros((3, 3))
        if not in_body:
            return np.concatenate([none, -R_a], axis=1), np.concatenate([none, R_b], axis=1)
        moved_b_m = R_a.T @ (b.translation() - a.translation())
        by_a = np.concatenate([skew(moved_b_m[None])[0], -np.eye(3)], axis=1)
        return by_a, np.concatenate([none, R_a.T @ R_b], axis=1)

    keys = [pose(rows[0]), pose(rows[1])]
    return residual_factor(name, keys, residual, covariance, jacobian=jacobian)


_MAKERS: dict[str, Maker] = {
    "heading": _heading,
    "attitude": _attitude,
    "direction": _direction,
    "velocity": _velocity,
    "speed": _speed,
    "height": _height,
    "position": _position,
    "displacement": _displacement,
}
