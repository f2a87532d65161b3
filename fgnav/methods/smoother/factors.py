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
    key: int, known_n: FloatArray, measured_b: FloatArray, across_b: FloatArray
) -> gtsam.NonlinearFactor:
    """Return the factor of a direction known in ``n`` and measured in body axes (gravity).

    What whitens it, (2, 3), holds in body axes. ``AttitudeFactorPose3`` errs in two axes of ``n``,
    about which a long axis in the body would turn with the estimate; a magnetic field of size one
    errs in body axes, and of its three the third weighs nothing.
    """
    whitening = np.vstack([across_b, np.zeros(3)])
    noise = gtsam.noiseModel.Gaussian.SqrtInformation(whitening, False)
    known = gtsam.Unit3(known_n)
    return gtsam.MagPoseFactorPose3(key, measured_b, 1.0, known.point3(), np.zeros(3), noise)


def bearing(key: int, landmark: int, measured_b: FloatArray, across_b: FloatArray) -> Any:  # noqa: ANN401
    """Return the factor of the direction from the body point to the landmark, body axes.

    GTSAM errs in the two axes that it lays across the expected direction, taken here as those
    across the measured one: a long axis is turned where the two choose theirs by other body axes.
    """
    whitening = across_b @ gtsam.Unit3(measured_b).basis()
    noise = gtsam.noiseModel.Gaussian.SqrtInformation(whitening, False)
    return gtsam.BearingFactor3D(key, landmark, gtsam.Unit3(measured_b), noise)
