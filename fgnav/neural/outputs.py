"""What outputs say of the states: residuals and Jacobians of each quantity that a network measures.

Residuals are estimate less output, in the output's tangent; Jacobians are by the tangents of
``fgnav.graph.keys``: rotation, then position, both in body axes; velocities in ``n``.
"""

from collections.abc import Callable
from math import atan2, cos, sin
from typing import Any, TypeAlias

import gtsam
import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import skew
from fgnav.graph.custom import OwnFactor, residual_factor
from fgnav.graph.keys import pose, velocity
from fgnav.graph.residual_model import Jacobian, Residual
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
    measured = float(value[0])

    def residual(x: Any) -> list[float]:  # noqa: ANN401  # gtsam.Pose3
        (north, *_), (east, *_), *_ = x.matrix().tolist()  # a third of the rotation's time
        turn = atan2(east, north) - measured
        return [atan2(sin(turn), cos(turn))]

    def jacobian(x: Any) -> tuple[list[list[float]]]:  # noqa: ANN401  # as above
        (a, b, c, _), (d, e, f, _), *_ = x.matrix().tolist()
        level = a * a + d * d
        return ([[0.0, (d * c - a * f) / level, (a * e - d * b) / level, 0.0, 0.0, 0.0]],)

    return _factor(name, [pose(rows[1])], residual, covariance, jacobian)


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
    P = across @ covariance @ across.T
    # A field of size one that should have none across the output, as of ``factors.gravity``.
    whitening = np.vstack([np.linalg.inv(np.linalg.cholesky(P)) @ across, np.zeros(3)])
    noise = gtsam.noiseModel.Gaussian.SqrtInformation(whitening, False)
    none, down = np.zeros(3), np.array([0.0, 0.0, 1.0])
    return OwnFactor(name, gtsam.MagPoseFactorPose3(pose(rows[1]), none, 1.0, down, none, noise))


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
    return _factor(name, keys, residual, covariance, jacobian)


def _speed(
    name: str, _: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    def residual(v_n_mps: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(v_n_mps) - value)

    def jacobian(v_n_mps: FloatArray) -> tuple[FloatArray]:
        return (v_n_mps[None] / max(float(np.linalg.norm(v_n_mps)), _SLOWEST_MPS),)

    return _factor(name, [velocity(rows[1])], residual, covariance, jacobian)


def _height(
    name: str, _: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    def residual(x: Any) -> FloatArray:  # noqa: ANN401  # as above
        return np.asarray(-x.translation()[2] - value)

    def jacobian(x: Any) -> tuple[FloatArray]:  # noqa: ANN401  # as above
        return (np.concatenate([np.zeros(3), -x.rotation().matrix()[2]])[None],)

    return _factor(name, [pose(rows[1])], residual, covariance, jacobian)


def _position(
    name: str, _: Output, rows: tuple[int, int], value: FloatArray, covariance: FloatArray
) -> OwnFactor:
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    return OwnFactor(name, gtsam.GPSFactor(pose(rows[1]), value, noise))


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
    return _factor(name, keys, residual, covariance, jacobian)


def _factor(
    name: str, keys: list[int], residual: Residual, covariance: FloatArray, jacobian: Jacobian
) -> OwnFactor:
    """Return a factor of a covariance that is known to be positive."""
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    return residual_factor(name, keys, residual, noise, jacobian=jacobian)


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
