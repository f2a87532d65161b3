"""Body rates as good as they are before smoothing: from the gyroscope, or from attitudes."""

import numpy as np

from fgnav.attitude.own_rotation import OwnRotation, despun
from fgnav.checks import FloatArray
from fgnav.flight import Imu
from fgnav.rotations import log, transpose

RATE_SPAN_S = 0.5  # rates are differences of attitudes this far apart


def rough_rates(
    imu: Imu, t_s: FloatArray, R_nb: FloatArray, own: OwnRotation | None = None
) -> FloatArray:
    """Return body rates at keyframes, rad/s, (n, 3): the gyroscope's, or from attitudes.

    A spin may be half a turn from one attitude to the next: what is known of it is taken out.
    """
    if imu.w_b_radps is not None:
        return np.stack([np.interp(t_s, imu.t_s, column) for column in imu.w_b_radps.T], axis=1)
    rest_radps = angular_rates(t_s, despun(own, t_s, R_nb))
    if own is not None:
        rest_radps = np.einsum("nji,nj->ni", own.at(t_s), rest_radps) + own.rates(t_s)
    return np.asarray(rest_radps)


def swing_n_mps(R_nb: FloatArray, w_b_radps: FloatArray, arm_b_m: FloatArray) -> FloatArray:
    """Return velocities of a point beside the accelerometer against it, (n, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", R_nb, np.cross(w_b_radps, arm_b_m)))


def angular_rates(t_s: FloatArray, R_nb: FloatArray) -> FloatArray:
    """Return angular rates at keyframes, rad/s, body axes, (n, 3), from noisy attitudes.

    Means of the rates between neighbouring keyframes over ``RATE_SPAN_S``.
    """
    if len(t_s) < 2:
        return np.zeros((len(t_s), 3))
    between = log(transpose(R_nb[:-1]) @ R_nb[1:])
    total = np.vstack([np.zeros(3), np.cumsum(between, axis=0)])
    ahead = np.searchsorted(t_s, t_s + RATE_SPAN_S / 2 + 1e-9, side="right") - 1
    behind = np.searchsorted(t_s, t_s - RATE_SPAN_S / 2 - 1e-9)
    ahead = np.maximum(ahead, np.minimum(np.arange(len(t_s)) + 1, len(t_s) - 1))
    behind = np.minimum(behind, np.maximum(np.arange(len(t_s)) - 1, 0))
    return np.asarray((total[ahead] - total[behind]) / (t_s[ahead] - t_s[behind])[:, None])
