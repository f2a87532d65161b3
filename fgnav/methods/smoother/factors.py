"""Measurements as GTSAM factors, all of them native.

A custom factor in Python costs 25 times a native one, and takes the process with it if its Jacobian
has the wrong shape; nothing here needs one. The body point of the states is the accelerometer.
"""

from typing import Any

import gtsam
import numpy as np

from fgnav.checks import FloatArray

# Where the elements of R.ravel() stand in the column-major vector of a 4 by 4 pose matrix.
_IN_POSE = [4 * column + row for row in range(3) for column in range(3)]


def rotation_form(key: int, root: FloatArray, minimum: FloatArray) -> gtsam.NonlinearFactor:
    """Return the factor of one epoch's quadratic form of the rotation, loss-free.

    Parameters
    ----------
    key : int
        The pose.
    root, minimum : ndarray, shape (9, 9) and (3, 3)
        One epoch of ``RotationQuadratic.square_root``.
    """
    whitening = np.zeros((16, 16))
    whitening[:9, _IN_POSE] = root
    M = np.zeros((4, 4))
    M[:3, :3] = minimum
    noise = gtsam.noiseModel.Gaussian.SqrtInformation(whitening, False)
    return gtsam.FrobeniusPriorPose3(key, M, noise)


def antenna_position(
    key: int, p_n_m: FloatArray, white: FloatArray, arm_b_m: FloatArray
) -> gtsam.NonlinearFactor:
    """Return the factor of an antenna's position, (3,), with what whitens it, and lever arm."""
    noise = gtsam.noiseModel.Gaussian.SqrtInformation(white, False)
    return gtsam.GPSFactorArm(key, p_n_m, arm_b_m, noise)


def velocity(key: int, v_n_mps: FloatArray, white: FloatArray) -> gtsam.NonlinearFactor:
    """Return the factor of the accelerometer's velocity, (3,), with what whitens it, (3, 3)."""
    noise = gtsam.noiseModel.Gaussian.SqrtInformation(white, False)
    return gtsam.PriorFactorVector(key, v_n_mps, noise)


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
