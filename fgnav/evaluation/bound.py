"""The best possible: the Cramer-Rao bound of one epoch's carrier phase with the right integers."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.integer_counts import integers_at, true_attitudes
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.scores import Angles, degrees, rms
from fgnav.geometry import rotations
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Estimate, open_angle_variance_rad2
from fgnav.types.flight import Truth
from fgnav.types.integers import Integers

_OPEN = 1e-9  # information below this share of the largest is rounding error, not information
_TOUCHED = 1e-6  # an angle with more than this share along an open direction is open itself


def flight_bound(
    differences: DoubleDifferences, truth: Truth | None, estimates: Sequence[Estimate]
) -> Angles:
    """Return the bound at the truth, or at the most certain estimate where there is no truth."""
    if truth is not None:
        R_nb, is_covered = true_attitudes(truth, differences.t_s)
        return attitude_bound(differences, integers_at(differences, R_nb, is_covered), R_nb)
    candidates = [
        (float(np.trace(e.attitude_covariance_rad2, axis1=1, axis2=2).mean()), e, e.integers)
        for e in estimates
        if e.attitude_covariance_rad2 is not None and e.integers is not None
    ]
    if not candidates:
        return Angles()
    _, best, integers = min(candidates, key=lambda candidate: candidate[0])
    theirs, ours = common_epochs(best.t_s, differences.t_s)
    R_nb = np.tile(np.eye(3), (len(differences.t_s), 1, 1))
    R_nb[ours] = best.R_nb[theirs]
    solved = np.isin(np.arange(len(R_nb)), ours)[:, None, None]
    return attitude_bound(differences, replace(integers, fixed=integers.fixed & solved), R_nb)


def attitude_bound(differences: DoubleDifferences, integers: Integers, R_nb: FloatArray) -> Angles:
    """Return the bound on roll, pitch and yaw of any unbiased estimate from one epoch alone.

    It is the RMS over the epochs of the standard deviations that the inverse Fisher information
    leaves [1]_. An estimator that looks at more than one epoch, as the smoother does, or at other
    sensors may well be better.

    Parameters
    ----------
    integers : Integers
        The right ones; links that are not fixed carry no information.
    R_nb : ndarray, shape (n, 3, 3)
        The attitudes at which the information is taken: the true ones.

    Returns
    -------
    Angles
        None for an angle that no epoch determines, as roll with a single baseline along the body's
        x axis.

    References
    ----------
    .. [1] Kay, Fundamentals of Statistical Signal Processing: Estimation Theory,
       sections 3.7 and 3.8.
    """
    from fgnav.attitude.quadratic import RotationQuadratic  # noqa: PLC0415  # lazy: brings numba

    quadratic = RotationQuadratic.of_double_differences(differences, integers)
    sigma_rad = euler_sigma_rad(quadratic.information_at(R_nb), R_nb)
    roll, pitch, yaw = (degrees(rms(column[np.isfinite(column)])) for column in sigma_rad.T)
    return Angles(roll=roll, pitch=pitch, yaw=yaw)


def euler_sigma_rad(information: FloatArray, R_nb: FloatArray) -> FloatArray:
    """Return (n, 3) standard deviations of roll, pitch, yaw; infinite where there is no bound.

    A figure beyond that of an angle of which nothing is known counts as none: the bound is one of
    small errors.

    Parameters
    ----------
    information : ndarray, shape (n, 3, 3)
        Fisher information of the body-axes tangent, 1/rad2; may be singular.
    R_nb : ndarray, shape (n, 3, 3)
    """
    strength, axes = np.linalg.eigh(information)
    is_open = strength <= _OPEN * strength[:, -1:].clip(np.finfo(float).tiny)
    along = rotations.euler_jacobian(R_nb) @ axes  # (n, angle, eigenvector)
    gain = ~is_open / np.where(is_open, 1.0, strength)
    sigma_rad = np.sqrt(np.einsum("nai,ni->na", along**2, gain))
    length = np.linalg.norm(along, axis=2, keepdims=True)
    touched = (is_open[:, None, :] & (np.abs(along) > _TOUCHED * length)).any(axis=2)
    return np.where(touched | (sigma_rad**2 > open_angle_variance_rad2()), np.inf, sigma_rad)
