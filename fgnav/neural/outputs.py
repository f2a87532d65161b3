"""Residuals and Jacobians of each quantity that a network measures.

Residuals are estimate less output, in the output's tangent; Jacobians are by the tangents of
``fgnav.graph.keys``: rotation, then position, both in body axes; velocities in ``n``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, cos, sin
from typing import Any, NamedTuple, TypeAlias

import gtsam
import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import log, skew
from fgnav.graph.custom import NamedFactor, residual_factor
from fgnav.graph.keys import pose, velocity
from fgnav.graph.residual_model import Jacobian, Residual
from fgnav.neural.manifest import Output

_SLOWEST_MPS = 1e-6  # below, a speed has no direction: its Jacobian is that of the direction before


class Counted(NamedTuple):
    """Weight of one output's errors beside those of others (``correlation``)."""

    inflation: float = 1.0  # of the covariance of what does not last
    lasting: float = 0.0  # share of the variance that lasts
    key: int = -1  # of the constant that lasts, (f,), in 1-sigmas; -1 where nothing does


INDEPENDENT = Counted()


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Model:
    """A quantity's residual, (m,), of the variables of ``keys``."""

    keys: list[int]
    residual: Residual
    jacobian: Jacobian | None  # None: differences
    # (m, f), or None; rows that the residual has of a tangent of which one direction does not count
    across: FloatArray | None = None
    # GTSAM's own factor of the same residual and a covariance, (m, m)
    native: Callable[[FloatArray], gtsam.NonlinearFactor] | None = None


_Maker: TypeAlias = Callable[[Output, tuple[int, int], FloatArray], _Model]


def factor_of(
    name: str,
    output: Output,
    rows: tuple[int, int],
    value: FloatArray,
    covariance: FloatArray,
    counted: Counted = INDEPENDENT,
) -> NamedFactor:
    """Return the factor of one output.

    Its error is ``P^(1/2) (sqrt(s) c + sqrt(1 - s) w)``: by the symmetric root of the covariance,
    so that the axes of c are those of the tangent, s the lasting share, w new ones.

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
    counted : Counted, optional
        Independent errors by default.

    Returns
    -------
    NamedFactor
    """
    model = _MAKERS[output.measures](output, rows, value)
    across = np.eye(len(covariance)) if model.across is None else model.across
    P = across @ covariance @ across.T
    white = counted.inflation * (1 - counted.lasting) * P
    if counted.key < 0:
        if model.native is not None:
            return NamedFactor(name, model.native(white))
        return _factor(name, model.keys, model.residual, white, model.jacobian)
    by_constant = np.sqrt(counted.lasting) * _root(P) @ across

    def residual(*variables: Any) -> FloatArray:  # noqa: ANN401  # as in gtsam.Values
        *states, lasting = variables
        return np.asarray(np.asarray(model.residual(*states)) + by_constant @ lasting)

    def jacobian(*variables: Any) -> tuple[Any, ...]:  # noqa: ANN401  # as above
        return (*model.jacobian(*variables[:-1]), by_constant)  # type: ignore[misc]

    keys = [*model.keys, counted.key]
    return _factor(name, keys, residual, white, None if model.jacobian is None else jacobian)


def _heading(_: Output, rows: tuple[int, int], value: FloatArray) -> _Model:
    """``psi = atan2(R10, R00)``; turned by delta, R's first column moves by ``R (delta x e1)``."""
    measured = float(value[0])

    def residual(x: Any) -> list[float]:  # noqa: ANN401  # gtsam.Pose3
        (north, *_), (east, *_), *_ = x.matrix().tolist()  # a third of the rotation's time
        angle = atan2(east, north) - measured
        return [atan2(sin(angle), cos(angle))]

    def jacobian(x: Any) -> tuple[list[list[float]]]:  # noqa: ANN401  # as above
        (a, b, c, _), (d, e, f, _), *_ = x.matrix().tolist()
        level = a * a + d * d
        return ([[0.0, (d * c - a * f) / level, (a * e - d * b) / level, 0.0, 0.0, 0.0]],)

    return _Model(keys=[pose(rows[1])], residual=residual, jacobian=jacobian)


def _attitude(_: Output, rows: tuple[int, int], value: FloatArray) -> _Model:
    measured, x_key = value.reshape(3, 3), pose(rows[1])

    def residual(x: Any) -> FloatArray:  # noqa: ANN401  # as above
        return np.asarray(log((measured.T @ x.rotation().matrix())[None])[0])

    def native(covariance: FloatArray) -> gtsam.NonlinearFactor:
        noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
        return gtsam.PoseRotationPrior3D(x_key, gtsam.Rot3(measured), noise)

    return _Model(keys=[x_key], residual=residual, jacobian=None, native=native)


def _direction(_: Output, rows: tuple[int, int], value: FloatArray) -> _Model:
    """``r = E' R' e3``, E two axes across the output: gravity is down in ``n``."""
    across, x_key = np.linalg.svd(value[None])[2][1:], pose(rows[1])

    def residual(x: Any) -> FloatArray:  # noqa: ANN401  # as above
        return np.asarray(across @ x.rotation().matrix()[2])

    def jacobian(x: Any) -> tuple[FloatArray]:  # noqa: ANN401  # as above
        by_rotation = across @ skew(x.rotation().matrix()[2][None])[0]
        return (np.concatenate([by_rotation, np.zeros((2, 3))], axis=1),)

    def native(covariance: FloatArray) -> gtsam.NonlinearFactor:
        # A field of size one with none across the output, as of ``factors.gravity``.
        rows_b = np.linalg.inv(np.linalg.cholesky(covariance)) @ across
        whitening = np.vstack([rows_b, np.zeros(3)])
        noise = gtsam.noiseModel.Gaussian.SqrtInformation(whitening, False)
        none, down = np.zeros(3), np.array([0.0, 0.0, 1.0])
        return gtsam.MagPoseFactorPose3(x_key, none, 1.0, down, none, noise)

    return _Model(keys=[x_key], residual=residual, jacobian=jacobian, across=across, native=native)


def _velocity(output: Output, rows: tuple[int, int], value: FloatArray) -> _Model:
    k = rows[1]
    if output.frame == "n":

        def native(covariance: FloatArray) -> gtsam.NonlinearFactor:
            noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
            return gtsam.PriorFactorVector(velocity(k), value, noise)

        return _Model(
            keys=[velocity(k)],
            residual=lambda v_n_mps: v_n_mps - value,
            jacobian=lambda _: (np.eye(3),),
            native=native,
        )

    def residual(x: Any, v_n_mps: FloatArray) -> FloatArray:  # noqa: ANN401  # as above
        return np.asarray(x.rotation().matrix().T @ v_n_mps - value)

    def jacobian(x: Any, v_n_mps: FloatArray) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401
        R = x.rotation().matrix()
        return np.concatenate([skew((R.T @ v_n_mps)[None])[0], np.zeros((3, 3))], axis=1), R.T

    return _Model(keys=[pose(k), velocity(k)], residual=residual, jacobian=jacobian)


def _speed(_: Output, rows: tuple[int, int], value: FloatArray) -> _Model:
    def residual(v_n_mps: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(v_n_mps) - value)

    def jacobian(v_n_mps: FloatArray) -> tuple[FloatArray]:
        return (v_n_mps[None] / max(float(np.linalg.norm(v_n_mps)), _SLOWEST_MPS),)

    return _Model(keys=[velocity(rows[1])], residual=residual, jacobian=jacobian)


def _height(_: Output, rows: tuple[int, int], value: FloatArray) -> _Model:
    def residual(x: Any) -> FloatArray:  # noqa: ANN401  # as above
        return np.asarray(-x.translation()[2] - value)

    def jacobian(x: Any) -> tuple[FloatArray]:  # noqa: ANN401  # as above
        return (np.concatenate([np.zeros(3), -x.rotation().matrix()[2]])[None],)

    return _Model(keys=[pose(rows[1])], residual=residual, jacobian=jacobian)


def _position(_: Output, rows: tuple[int, int], value: FloatArray) -> _Model:
    x_key = pose(rows[1])

    def residual(x: Any) -> FloatArray:  # noqa: ANN401  # as above
        return np.asarray(x.translation() - value)

    def jacobian(x: Any) -> tuple[FloatArray]:  # noqa: ANN401  # as above
        return (np.concatenate([np.zeros((3, 3)), x.rotation().matrix()], axis=1),)

    def native(covariance: FloatArray) -> gtsam.NonlinearFactor:
        return gtsam.GPSFactor(x_key, value, gtsam.noiseModel.Gaussian.Covariance(covariance))

    return _Model(keys=[x_key], residual=residual, jacobian=jacobian, native=native)


def _displacement(output: Output, rows: tuple[int, int], value: FloatArray) -> _Model:
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
    return _Model(keys=keys, residual=residual, jacobian=jacobian)


def _factor(
    name: str,
    keys: list[int],
    residual: Residual,
    covariance: FloatArray,
    jacobian: Jacobian | None,
) -> NamedFactor:
    """Return a factor of a covariance that is known to be positive."""
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    return residual_factor(name, keys, residual, noise, jacobian=jacobian)


def _root(P: FloatArray) -> FloatArray:
    """Return the symmetric root of a covariance."""
    values, axes = np.linalg.eigh(P)
    return np.asarray(axes * np.sqrt(values) @ axes.T)


_MAKERS: dict[str, _Maker] = {
    "heading": _heading,
    "attitude": _attitude,
    "direction": _direction,
    "velocity": _velocity,
    "speed": _speed,
    "height": _height,
    "position": _position,
    "displacement": _displacement,
}
