"""Unit vectors that the body sees, each with the covariance of its two angles."""

from dataclasses import dataclass
from typing import NamedTuple

import gtsam
import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav.geometry.rotation_kernel import right_jacobian
from fgnav.geometry.rotations import exp, skew
from fgnav.graph import keys

_SINGULAR = 1e-12  # of two variances' ratio: of smaller ones rounding leaves no three digits


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Directions:
    """Unit vectors at keyframes, body axes; NaN rows where there is none."""

    e_b: FloatArray  # (n, 3)
    # What whitens them, the root of their information: ``across_b @ u_b`` is by how many sigmas a
    # unit vector u_b lies beside e_b, whose own is zero. Zeros where there is none.
    across_b: FloatArray  # (n, 2, 3)

    @classmethod
    def of(cls, what: str, e_b: FloatArray, covariance: FloatArray) -> "Directions":
        """Return directions with covariances, (n, 3, 3), of which the part across e_b counts.

        Raises
        ------
        BadInputError
            If a direction has no variance about an axis; names ``what`` and the row.
        """
        measured, across_b = np.isfinite(e_b[:, 0]), np.zeros((len(e_b), 2, 3))
        axes = across(e_b[measured])
        tangent = axes @ covariance[measured] @ axes.swapaxes(1, 2)
        least, most = np.linalg.eigvalsh(tangent).T
        singular = np.flatnonzero(~(least > _SINGULAR * most))
        if len(singular):
            k = singular[0]
            raise BadInputError(
                f"{what} covariance: must be positive definite across the direction, row "
                f"{np.flatnonzero(measured)[k]} has variances {least[k]:.3g} and {most[k]:.3g} rad2"
            )
        across_b[measured] = np.linalg.inv(np.linalg.cholesky(tangent)) @ axes
        return cls(e_b=e_b, across_b=across_b)

    @classmethod
    def isotropic(cls, e_b: FloatArray, sigma_rad: FloatArray | float) -> "Directions":
        """Return directions as well known about either axis, by standard deviations, (n,)."""
        measured, across_b = np.isfinite(e_b[:, 0]), np.zeros((len(e_b), 2, 3))
        sigma = np.broadcast_to(sigma_rad, len(e_b))[measured]
        across_b[measured] = across(e_b[measured]) / sigma[:, None, None]
        return cls(e_b=e_b, across_b=across_b)

    @property
    def row(self) -> IntArray:
        """Keyframes that have one, (k,)."""
        return np.flatnonzero(np.isfinite(self.e_b[:, 0]))

    def __getitem__(self, rows: IntArray | BoolArray) -> "Directions":
        """Select directions."""
        return Directions(e_b=self.e_b[rows], across_b=self.across_b[rows])

    def scatter(self, rows: IntArray, n: int) -> "Directions":
        """Spread the directions over n keyframes, of which ``rows`` have one."""
        e_b, across_b = np.full((n, 3), np.nan), np.zeros((n, 2, 3))
        e_b[rows], across_b[rows] = self.e_b, self.across_b
        return Directions(e_b=e_b, across_b=across_b)


def across(e: FloatArray) -> FloatArray:
    """Return two unit vectors across each unit vector, (n, 2, 3)."""
    least = np.eye(3)[np.abs(e).argmin(axis=1)]
    first = np.cross(e, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(e, first)], axis=1)


class Projection(NamedTuple):
    """Unit vectors, (k,), as measured by an instrument with a small misalignment."""

    value: FloatArray  # (k, 2): whitened, across the measured directions
    across_b: FloatArray  # (k, 2, 3): whitening rows in axes of the body
    by_rotation: FloatArray  # (k, 2, 3): derivative by the turn of the body
    by_tilt: FloatArray  # (k, 2, 3): by the rotation vector of the instrument's turn


def projected(across_b: FloatArray, u_b: FloatArray, tilt_rad: FloatArray) -> Projection:
    """Return ``A Exp(-t) u_b`` of whitening rows A, (k, 2, 3), a turn t, (3,), and vectors, (k, 3).

    The derivative by t has the right Jacobian of the rotation group in it [1]_.

    References
    ----------
    .. [1] Forster, Carlone, Dellaert, Scaramuzza: On-Manifold Preintegration for Real-Time
       Visual-Inertial Odometry, IEEE Transactions on Robotics 33, 2017, section III.
    """
    across_b = across_b @ exp(-tilt_rad[None])[0]
    by_rotation = across_b @ skew(u_b)
    value = np.einsum("kmc,kc->km", across_b, u_b)
    return Projection(value, across_b, by_rotation, by_rotation @ right_jacobian(-tilt_rad))


def flattened(v_b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors along others, (k, 3), and their derivatives by these, (k, 3, 3)."""
    size = np.linalg.norm(v_b, axis=1)
    u_b = v_b / size[:, None]
    along = u_b[:, :, None] * u_b[:, None, :]
    return u_b, (np.eye(3) - along) / size[:, None, None]


def native(key: int, across_b: FloatArray, reference_n: FloatArray) -> gtsam.NonlinearFactor:
    """Return the sight of a unit vector known in ``n``, (3,), from keyframe ``key``, by GTSAM.

    ``AttitudeFactorPose3`` errs in two axes of ``n``, about which a long axis in the body would
    turn with the estimate. A magnetic field of size one errs in body axes; against a measured
    field of zero its whitened residual is ours, as the measured direction's own is zero.
    """
    whitening = np.vstack([across_b, np.zeros(3)])
    noise = gtsam.noiseModel.Gaussian.SqrtInformation(whitening, False)
    none = np.zeros(3)
    return gtsam.MagPoseFactorPose3(keys.pose(key), none, 1.0, reference_n, none, noise)
