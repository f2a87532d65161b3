"""Rotation matrices, batched over the first axis; tangents are body-axes rotation vectors."""

import numpy as np

from fgnav.checks import FloatArray

_SMALL_RAD = 1e-6  # below, the series is exact to double precision


def skew(v: FloatArray) -> FloatArray:
    """Return (..., 3, 3) matrices with ``skew(a) @ b == cross(a, b)`` for (..., 3) vectors."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def exp(rotation_vector_rad: FloatArray) -> FloatArray:
    """Return (n, 3, 3) rotations of (n, 3) rotation vectors (Rodrigues' formula)."""
    angle = np.linalg.norm(rotation_vector_rad, axis=1)[:, None, None]
    K = skew(rotation_vector_rad)
    small = angle < _SMALL_RAD
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1.0 - angle**2 / 6.0, np.sin(safe) / safe)
    b = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) + a * K + b * (K @ K))


def log(R: FloatArray) -> FloatArray:
    """Return (n, 3) rotation vectors, rad, with angle in [0, pi], of (n, 3, 3) rotations."""
    wxyz = quaternion_wxyz(R)
    wxyz = wxyz * np.where(wxyz[:, :1] < 0, -1.0, 1.0)
    sine = np.linalg.norm(wxyz[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, wxyz[:, :1])
    scale = np.where(sine < _SMALL_RAD, 2.0 / wxyz[:, :1].clip(0.5), angle / sine.clip(1e-300))
    return np.asarray(scale * wxyz[:, 1:])


def quaternion_wxyz(R: FloatArray) -> FloatArray:
    """Return (n, 4) unit quaternions of (n, 3, 3) rotations (Shepperd: by the largest element)."""
    trace = np.trace(R, axis1=1, axis2=2)
    four_squares = np.stack([1 + trace, *(1 + 2 * R[:, i, i] - trace for i in range(3))], axis=1)
    K = np.empty((len(R), 4, 4))  # outer product 4 q q^T
    K[:, range(4), range(4)] = four_squares
    for i, (j, k) in enumerate([(2, 1), (0, 2), (1, 0)]):
        K[:, 0, i + 1] = K[:, i + 1, 0] = R[:, j, k] - R[:, k, j]
    for i, j in [(0, 1), (0, 2), (1, 2)]:
        K[:, i + 1, j + 1] = K[:, j + 1, i + 1] = R[:, i, j] + R[:, j, i]
    q = K[np.arange(len(R)), four_squares.argmax(axis=1)]
    return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


def from_euler(roll_rad: FloatArray, pitch_rad: FloatArray, yaw_rad: FloatArray) -> FloatArray:
    """Return (n, 3, 3) R_nb of 3-2-1 Euler angles, each (n,)."""
    cr, sr = np.cos(roll_rad), np.sin(roll_rad)
    cp, sp = np.cos(pitch_rad), np.sin(pitch_rad)
    cy, sy = np.cos(yaw_rad), np.sin(yaw_rad)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def to_euler(R_nb: FloatArray) -> FloatArray:
    """Return (n, 3) roll, pitch, yaw, rad, of (n, 3, 3) R_nb; roll and yaw in (-pi, pi]."""
    roll = np.arctan2(R_nb[:, 2, 1], R_nb[:, 2, 2])
    pitch = np.arcsin(np.clip(-R_nb[:, 2, 0], -1.0, 1.0))
    yaw = np.arctan2(R_nb[:, 1, 0], R_nb[:, 0, 0])
    return np.stack([roll, pitch, yaw], axis=1)


def euler_jacobian(R_nb: FloatArray) -> FloatArray:
    """Return (n, 3, 3) matrices: change of (roll, pitch, yaw) per body-axes tangent.

    The covariance of Euler angles is ``J @ P_b @ J.T``. Singular at pitch +-90 degrees, where it is
    evaluated 1e-6 away.
    """
    roll, pitch, _ = to_euler(R_nb).T
    cp = np.where(np.abs(np.cos(pitch)) < 1e-6, 1e-6, np.cos(pitch))
    tp = np.sin(pitch) / cp
    J = np.zeros((len(R_nb), 3, 3))
    J[:, 0, 0] = 1.0
    J[:, 0, 1], J[:, 0, 2] = np.sin(roll) * tp, np.cos(roll) * tp
    J[:, 1, 1], J[:, 1, 2] = np.cos(roll), -np.sin(roll)
    J[:, 2, 1], J[:, 2, 2] = np.sin(roll) / cp, np.cos(roll) / cp
    return J


def euler_sigma(R_nb: FloatArray, covariance_rad2: FloatArray) -> FloatArray:
    """Return (n, 3) standard deviations of roll, pitch and yaw, rad, to second order.

    ``var = J P_b J' + sum_k e_k^2 / 3`` with e_k half of what the angles change by in all where the
    attitude turns by plus and by minus ``3^(1/2)`` of principal axis k of P_b: of angles that bend
    along an axis as ``b x^2`` the variance of a Gaussian x has ``2 b^2`` and the mean ``b`` [1]_.

    Parameters
    ----------
    R_nb : ndarray, shape (n, 3, 3)
    covariance_rad2 : ndarray, shape (n, 3, 3)
        P_b, of body-axes tangents; sigmas are not finite where it is not.

    References
    ----------
    .. [1] Julier, Uhlmann: Unscented filtering and nonlinear estimation, Proc. IEEE 92, 2004, whose
       sigma points these are.
    """
    J, middle = euler_jacobian(R_nb), to_euler(R_nb)
    variance = np.einsum("nij,njk,nik->ni", J, covariance_rad2, J)
    is_finite = np.isfinite(covariance_rad2).all(axis=(1, 2), keepdims=True)
    squares, axes = np.linalg.eigh(np.where(is_finite, covariance_rad2, 0.0))
    points = axes * np.sqrt(3.0 * squares.clip(0.0))[:, None, :]
    for k in range(3):
        both = [wrap(to_euler(R_nb @ exp(sign * points[:, :, k])) - middle) for sign in (1, -1)]
        variance += (sum(both) / 2) ** 2 / 3
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def nearest(M: FloatArray) -> FloatArray:
    """Return (n, 3, 3) rotations nearest to matrices in the Frobenius norm (Procrustes)."""
    U, _, Vt = np.linalg.svd(M)
    sign = np.linalg.det(U @ Vt)
    U[:, :, 2] *= sign[:, None]
    return np.asarray(U @ Vt)


def transpose(R: FloatArray) -> FloatArray:
    """Return R_bn of R_nb, for (n, 3, 3)."""
    return R.swapaxes(1, 2)


def wrap(angle_rad: FloatArray) -> FloatArray:
    """Return angles wrapped to [-pi, pi)."""
    return (angle_rad + np.pi) % (2 * np.pi) - np.pi
