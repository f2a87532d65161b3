"""The motion between two keyframes as GTSAM preintegrates it; ``motion_kernel`` does it faster.

Without a gyroscope it is fed a rate of zero, and its gyro-bias slot carries the rate.
"""

import gtsam
import numpy as np

from fgnav.checks import FloatArray
from fgnav.methods.smoother.motion_kernel import INTEGRATION_M2
from fgnav.methods.smoother.preintegration import Preintegrator
from fgnav.rotations import skew


def preintegrated(
    pre: Preintegrator, k: int, bias: gtsam.imuBias.ConstantBias
) -> gtsam.PreintegratedCombinedMeasurements:
    """Integrate from keyframe k to the next, about a guess of the bias slot."""
    steps = pre.increments
    pim = gtsam.PreintegratedCombinedMeasurements(_parameters(pre, k), bias)
    part, step_s = slice(steps.first[k], steps.first[k + 1]), float(steps.step_s[k])
    w_b_radps, f_b_mps2 = steps.w_b_radps[part], _turned(pre, part, step_s, bias)
    for felt_b_mps2, rate_b_radps in zip(f_b_mps2, w_b_radps, strict=True):
        pim.integrateMeasurement(felt_b_mps2, rate_b_radps, step_s)
    return pim


def _turned(
    pre: Preintegrator, part: slice, step_s: float, bias: gtsam.imuBias.ConstantBias
) -> FloatArray:
    """Return specific forces of sub-steps in the axes that the body had at their start.

    GTSAM turns them with the attitude there: half a sub-step late, velocities would be those of
    a millisecond ago. To second order in the angle, 0.06 rad at two turns a second.
    """
    w_b_radps = pre.increments.w_b_radps[part]
    if not w_b_radps.any():  # all alike
        w_b_radps = w_b_radps[:1]
    K = skew((w_b_radps - bias.gyroscope()) * (step_s / 2))
    b_b_mps2 = bias.accelerometer()
    f_b_mps2 = pre.increments.f_b_mps2[part] - b_b_mps2
    return np.asarray(((np.eye(3) + K + K @ K / 2) @ f_b_mps2[:, :, None])[:, :, 0] + b_b_mps2)


def _parameters(pre: Preintegrator, k: int) -> gtsam.PreintegrationCombinedParams:
    felt, bias_walk, *of_rate = pre.noise[k]
    parameters = gtsam.PreintegrationCombinedParams(pre.gravity_n_mps2[k])
    parameters.setOmegaCoriolis(pre.earth_rate_n_radps)
    parameters.setAccelerometerCovariance(np.eye(3) * felt)
    parameters.setBiasAccCovariance(np.eye(3) * bias_walk)
    parameters.setIntegrationCovariance(np.eye(3) * INTEGRATION_M2)
    parameters.setGyroscopeCovariance(np.diag(of_rate[:3]))
    parameters.setBiasOmegaCovariance(np.diag(of_rate[3:]))
    return parameters
