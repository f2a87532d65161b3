"""Measurements as GTSAM factors; the only door to ``gtsam.CustomFactor``, and a guarded one.

The body point of the states is the accelerometer: lever arms are counted from it. The bias slot
holds the accelerometer's bias and, without a gyroscope, minus the body's angular rate.
"""

from collections.abc import Callable, Sequence
from typing import Any

import gtsam
import numpy as np
from numpy.typing import NDArray

from fgnav.checks import FgnavError, FloatArray
from fgnav.rotations import skew

# Where the elements of R.ravel() stand in the column-major vector of a 4 by 4 pose matrix.
_IN_POSE = [4 * column + row for row in range(3) for column in range(3)]

Residual = Callable[..., tuple[FloatArray, Sequence[FloatArray]]]


def rotation_form(key: int, information: FloatArray, vector: FloatArray) -> gtsam.NonlinearFactor:
    """Return the factor of one epoch's quadratic form of the rotation, loss-free.

    Parameters
    ----------
    key : int
        The pose.
    information, vector : ndarray, shape (9, 9) and (9,)
        One epoch of ``RotationQuadratic``.
    """
    values, vectors = np.linalg.eigh(information)
    known = values > 1e-12 * values[-1]
    root = np.sqrt(values[known])[:, None] * vectors[:, known].T
    minimum = vectors[:, known] @ (vectors[:, known].T @ vector / values[known])
    whitening = np.zeros((16, 16))
    whitening[: len(root), _IN_POSE] = root
    M = np.zeros((4, 4))
    M[:3, :3] = minimum.reshape(3, 3)
    noise = gtsam.noiseModel.Gaussian.SqrtInformation(whitening, False)
    return gtsam.FrobeniusPriorPose3(key, M, noise)


def antenna_position(
    key: int, p_n_m: FloatArray, covariance_m2: FloatArray, arm_b_m: FloatArray
) -> gtsam.NonlinearFactor:
    """Return the factor of an antenna's position, (3,), with its covariance and lever arm."""
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance_m2)
    return gtsam.GPSFactorArm(key, p_n_m, arm_b_m, noise)


def antenna_velocity(
    keys: tuple[int, int, int],
    v_n_mps: FloatArray,
    covariance_m2ps2: FloatArray,
    arm_b_m: FloatArray,
    w_b_radps: FloatArray | None,
) -> gtsam.NonlinearFactor:
    """Return the factor of an antenna's velocity, (3,).

    Parameters
    ----------
    keys : tuple of int
        Pose, velocity, bias.
    v_n_mps, covariance_m2ps2, arm_b_m : ndarray
        Measured velocity, its covariance, the lever arm.
    w_b_radps : ndarray, shape (3,), or None
        What the gyroscope says, its bias in the bias slot; None without one: the slot holds the
        rate itself, with the opposite sign. Earth rotation times the arm (0.1 mm/s) is left out.
    """
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance_m2ps2)
    if not arm_b_m.any():
        return gtsam.PriorFactorVector(keys[1], v_n_mps, noise)
    measured_b_radps = np.zeros(3) if w_b_radps is None else w_b_radps
    arm_cross = skew(arm_b_m[None])[0]

    def residual(
        pose: gtsam.Pose3, velocity: FloatArray, bias: gtsam.imuBias.ConstantBias
    ) -> tuple[FloatArray, Sequence[FloatArray]]:
        R_nb = pose.rotation().matrix()
        turning_b_mps = np.cross(measured_b_radps - bias.gyroscope(), arm_b_m)
        by_pose = np.hstack([-R_nb @ skew(turning_b_mps[None])[0], np.zeros((3, 3))])
        by_bias = np.hstack([np.zeros((3, 3)), R_nb @ arm_cross])
        return velocity + R_nb @ turning_b_mps - v_n_mps, [by_pose, np.eye(3), by_bias]

    return custom(noise, keys, (6, 3, 6), ("atPose3", "atVector", "atConstantBias"), residual)


def direction(
    key: int, known_n: FloatArray, measured_b: FloatArray, sigma_rad: float
) -> gtsam.NonlinearFactor:
    """Return the factor of a direction known in ``n`` and measured in body axes (gravity)."""
    noise = gtsam.noiseModel.Isotropic.Sigma(2, sigma_rad)
    return gtsam.AttitudeFactorPose3(key, gtsam.Unit3(known_n), noise, gtsam.Unit3(measured_b))


def bearing(key: int, landmark: int, measured_b: FloatArray, sigma_rad: float) -> Any:  # noqa: ANN401
    """Return the factor of the direction from the body point to the landmark, body axes."""
    noise = gtsam.noiseModel.Isotropic.Sigma(2, sigma_rad)
    return gtsam.BearingFactor3D(key, landmark, gtsam.Unit3(measured_b), noise)


def custom(
    noise: gtsam.noiseModel.Base,
    keys: Sequence[int],
    dimensions: Sequence[int],
    getters: Sequence[str],
    residual: Residual,
) -> gtsam.CustomFactor:
    """Return a factor from a pure function of the variables.

    Parameters
    ----------
    noise : gtsam.noiseModel.Base
        Noise of the residual.
    keys, dimensions, getters : sequence
        Variables, their tangent dimensions, and the method of ``gtsam.Values`` that reads each, in
        the order in which ``residual`` takes them.
    residual : callable
        ``residual(*values) -> (r, jacobians)``, r of shape (m,), one (m, d) per key.

    Raises
    ------
    FgnavError
        When called with a result of the wrong shape: gtsam itself would read past the array's end
        and take the process with it.
    """
    rows = noise.dim()
    shapes = [(rows, d) for d in dimensions]

    def error(
        _this: gtsam.CustomFactor,
        values: gtsam.Values,
        jacobians: Any,  # noqa: ANN401
    ) -> NDArray[np.float64]:
        r, found = residual(
            *(getattr(values, get)(k) for get, k in zip(getters, keys, strict=True))
        )
        if r.shape != (rows,) or [H.shape for H in found] != shapes:
            raise FgnavError(
                f"factor on {list(keys)}: bad shapes {r.shape}, {[H.shape for H in found]}"
            )
        if jacobians is not None:
            for i, H in enumerate(found):
                jacobians[i] = np.asfortranarray(H, dtype=np.float64)
        return np.asarray(r, dtype=np.float64)

    return gtsam.CustomFactor(noise, list(keys), error)
