"""Keyframes as a factor graph: X pose, V velocity, B bias slot, L(0) the landmark."""

from collections.abc import Iterator
from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, L, V, X

from fgnav.checks import FloatArray
from fgnav.methods.smoother import factors
from fgnav.methods.smoother.keyframes import Keyframes, there

_LANDMARK_SIGMA_M = 0.01  # a surveyed beacon
# Next to nothing is known before the first keyframe.
_ROTATION_PRIOR_RAD = np.pi
_POSITION_PRIOR_M = 1e4
_VELOCITY_PRIOR_MPS = 1e3


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Solution:
    """States of the accelerometer at keyframes, with their marginal covariances.

    Attributes
    ----------
    R_nb, p_n_m, v_n_mps, slot : ndarray, shape (n, 3, 3), (n, 3), (n, 3), (n, 6)
    pose_covariance : ndarray, shape (n, 6, 6)
        Rotation tangent, then position, both in body axes (GTSAM's order).
    velocity_covariance_m2ps2 : ndarray, shape (n, 3, 3)
        In the frame ``n``.
    slot_covariance : ndarray, shape (n, 6, 6)
    converged : bool
    """

    R_nb: FloatArray
    p_n_m: FloatArray
    v_n_mps: FloatArray
    slot: FloatArray
    pose_covariance: FloatArray
    velocity_covariance_m2ps2: FloatArray
    slot_covariance: FloatArray
    converged: bool


def measured(keyframes: Keyframes, k: int) -> Iterator[gtsam.NonlinearFactor]:
    """Yield the factors of one keyframe's own measurements."""
    array = keyframes.array
    if array.there[k]:
        yield factors.rotation_form(X(k), array.root[k], array.minimum[k])
    p, v = keyframes.position, keyframes.velocity
    if p is not None and there(p.value, k):
        yield factors.antenna_position(X(k), p.value[k], p.covariance[k], p.arm_b_m)
    if v is not None and there(v.value, k):
        yield factors.velocity(V(k), v.value[k], v.covariance[k])
    g, sight = keyframes.gravity, keyframes.sight
    if g is not None and there(g.e_b, k):
        down_n = keyframes.gravity_n_mps2[k]
        yield factors.direction(X(k), down_n, g.e_b[k], float(g.sigma_rad[k]))
    if sight is not None and there(sight.e_b, k):
        yield factors.bearing(X(k), L(0), sight.e_b[k], float(sight.sigma_rad[k]))


def priors(keyframes: Keyframes) -> list[gtsam.NonlinearFactor]:
    """Return what is known before the flight: the slot's size, and next to nothing of the rest."""
    sigma = gtsam.noiseModel.Diagonal.Sigmas
    loose = np.repeat([_ROTATION_PRIOR_RAD, _POSITION_PRIOR_M], 3)
    # The slot's own start is told from the data and must not be used twice: its mean is zero.
    found: list[gtsam.NonlinearFactor] = [
        gtsam.PriorFactorPose3(X(0), start_pose(keyframes, 0), sigma(loose)),
        gtsam.PriorFactorVector(V(0), np.zeros(3), sigma(np.full(3, _VELOCITY_PRIOR_MPS))),
        gtsam.PriorFactorConstantBias(
            B(0), gtsam.imuBias.ConstantBias(), sigma(keyframes.slot_sigma)
        ),
    ]
    if keyframes.landmark_n_m is not None:
        near = sigma(np.full(3, _LANDMARK_SIGMA_M))
        found.append(gtsam.PriorFactorPoint3(L(0), keyframes.landmark_n_m, near))
    return found


def motion(keyframes: Keyframes, k: int, slot: FloatArray) -> gtsam.CombinedImuFactor:
    """Return the factor from keyframe k to the next, preintegrated about a slot, (6,)."""
    pim = keyframes.preintegrate(k, as_bias(slot))
    return gtsam.CombinedImuFactor(X(k), V(k), X(k + 1), V(k + 1), B(k), B(k + 1), pim)


def as_bias(slot: FloatArray) -> gtsam.imuBias.ConstantBias:
    """Return a slot, (6,), as GTSAM's type."""
    return gtsam.imuBias.ConstantBias(slot[:3], slot[3:])


def start_pose(keyframes: Keyframes, k: int) -> gtsam.Pose3:
    """Return where the search for a keyframe's pose starts."""
    return gtsam.Pose3(gtsam.Rot3(keyframes.R_nb[k]), keyframes.p_n_m[k])
