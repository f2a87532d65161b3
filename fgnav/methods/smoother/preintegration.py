"""Accelerometer samples between keyframes as one factor, with or without a gyroscope.

Without one, GTSAM's combined preintegration is fed a rate of zero and its gyro-bias slot carries
minus the body's angular rate, a random walk: white angular acceleration. With one, the slot is its
bias.
"""

from dataclasses import dataclass

import gtsam
import numpy as np
from scipy.interpolate import CubicSpline

from fgnav.checks import BadInputError, FloatArray, IntArray, positive
from fgnav.flight import Imu
from fgnav.rotations import log, transpose

# Sub-steps of one accelerometer sample: GTSAM discretises the covariance per call. On the joint
# chi-square of rotation, velocity and rate (9 expected): one step 25, three 10.7, ten 9.1.
SUB_STEPS = 5
_PSEUDO_GYROSCOPE_RADPS_PER_SQRT_HZ = 1e-6  # of the rate of zero: the slot does all the work
_INTEGRATION_M2 = 1e-6  # m2/s: a millimetre in a second keeps the linear systems well posed
RATE_SPAN_S = 0.5  # angular rates are told from attitudes this far apart
# (rad/s2)2/Hz: a body that held its rates so far may still change them by 2 deg/s within a second.
_LEAST_DENSITY = 1e-3


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Increments:
    """Specific force and rate at the sub-steps between keyframes.

    Attributes
    ----------
    step_s : ndarray, shape (n - 1,)
        Length of the sub-steps of each interval.
    first : ndarray of int, shape (n,)
        Index of each interval's first sub-step; the last entry is their number.
    f_b_mps2, w_b_radps : ndarray, shape (k, 3)
        At the start of each sub-step, where GTSAM takes the attitude that turns them; taken at its
        middle, a spin of 1 Hz would roll by 0.4 degree. Rates are 0 without a gyroscope.
    """

    step_s: FloatArray
    first: IntArray
    f_b_mps2: FloatArray
    w_b_radps: FloatArray


def increments(imu: Imu, t_s: FloatArray, sub_steps: int = SUB_STEPS) -> Increments:
    """Cut the time between keyframes, (n,), into equal sub-steps of samples."""
    if sub_steps < 1:
        raise BadInputError(f"sub_steps: must be 1 or more, got {sub_steps}")
    span_s = np.diff(t_s)
    sample_s = float(np.median(np.diff(imu.t_s)))
    counts = np.maximum(1, np.rint(span_s / sample_s * sub_steps)).astype(np.int64)
    first = np.concatenate([[0], np.cumsum(counts)])
    step_s = span_s / counts
    within = np.arange(first[-1]) - np.repeat(first[:-1], counts)
    start_s = np.repeat(t_s[:-1], counts) + within * np.repeat(step_s, counts)
    # A straight line between samples would cut the corners of a spin: 3 mm/s2 at 1 Hz.
    no_rate = np.zeros((len(start_s), 3))
    return Increments(
        step_s=step_s,
        first=first,
        f_b_mps2=CubicSpline(imu.t_s, imu.f_b_mps2)(start_s),
        w_b_radps=no_rate
        if imu.w_b_radps is None
        else CubicSpline(imu.t_s, imu.w_b_radps)(start_s),
    )


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Preintegrator:
    """Makes the factor of any interval between keyframes.

    Attributes
    ----------
    imu : Imu
    increments : Increments
    gravity_n_mps2 : ndarray, shape (n, 3)
        Where each keyframe is.
    earth_rate_n_radps : ndarray, shape (3,)
    angular_acceleration_density : ndarray, shape (3,)
        Intensity of white angular acceleration about the body axes, (rad/s2)2/Hz; only without a
        gyroscope.
    """

    imu: Imu
    increments: Increments
    gravity_n_mps2: FloatArray
    earth_rate_n_radps: FloatArray
    angular_acceleration_density: FloatArray

    def __call__(
        self, k: int, bias: gtsam.imuBias.ConstantBias
    ) -> gtsam.PreintegratedCombinedMeasurements:
        """Integrate from keyframe k to the next, about a guess of the bias slot."""
        steps = self.increments
        pim = gtsam.PreintegratedCombinedMeasurements(self._parameters(k), bias)
        step_s = float(steps.step_s[k])
        for i in range(steps.first[k], steps.first[k + 1]):
            pim.integrateMeasurement(steps.f_b_mps2[i], steps.w_b_radps[i], step_s)
        return pim

    def _parameters(self, k: int) -> gtsam.PreintegrationCombinedParams:
        imu = self.imu
        parameters = gtsam.PreintegrationCombinedParams(self.gravity_n_mps2[k])
        parameters.setOmegaCoriolis(self.earth_rate_n_radps)
        parameters.setAccelerometerCovariance(
            np.eye(3) * imu.accelerometer_noise_mps2_per_sqrt_hz**2
        )
        parameters.setBiasAccCovariance(np.eye(3) * imu.accelerometer_bias_walk_mps2_per_sqrt_s**2)
        parameters.setIntegrationCovariance(np.eye(3) * _INTEGRATION_M2)
        noise = imu.gyroscope_noise_radps_per_sqrt_hz or _PSEUDO_GYROSCOPE_RADPS_PER_SQRT_HZ
        walk = imu.gyroscope_bias_walk_radps_per_sqrt_s
        parameters.setGyroscopeCovariance(np.eye(3) * noise**2)
        parameters.setBiasOmegaCovariance(
            np.diag(self.angular_acceleration_density) if walk is None else np.eye(3) * walk**2
        )
        return parameters


def angular_rates(t_s: FloatArray, R_nb: FloatArray) -> FloatArray:
    """Return angular rates at keyframes, rad/s, body axes, (n, 3), told from noisy attitudes.

    Means of the rates between neighbouring keyframes over ``RATE_SPAN_S``.
    """
    between = log(transpose(R_nb[:-1]) @ R_nb[1:])
    total = np.vstack([np.zeros(3), np.cumsum(between, axis=0)])
    ahead = np.searchsorted(t_s, t_s + RATE_SPAN_S / 2 + 1e-9, side="right") - 1
    behind = np.searchsorted(t_s, t_s - RATE_SPAN_S / 2 - 1e-9)
    ahead = np.maximum(ahead, np.minimum(np.arange(len(t_s)) + 1, len(t_s) - 1))
    behind = np.minimum(behind, np.maximum(np.arange(len(t_s)) - 1, 0))
    return np.asarray((total[ahead] - total[behind]) / (t_s[ahead] - t_s[behind])[:, None])


def angular_acceleration_density(
    t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray
) -> FloatArray:
    """Return the intensity of white angular acceleration, (rad/s2)2/Hz, (3,), told from attitudes.

    Rates over neighbouring spans of length T differ by a variance of ``2/3 S T`` from the motion
    and ``6 sigma^2 / T^2`` from the attitudes' own noise.

    Parameters
    ----------
    t_s, R_nb, covariance_rad2 : ndarray, shape (n,), (n, 3, 3), (n, 3, 3)
        Attitudes of single epochs, their errors independent.
    """
    spacing_s = float(np.median(np.diff(t_s)))
    positive("keyframe spacing", spacing_s)
    span = max(1, round(RATE_SPAN_S / spacing_s))
    if len(t_s) <= 2 * span:
        raise BadInputError(
            f"keyframes: {len(t_s)} are too few to tell the angular acceleration; "
            "state angular_acceleration_density"
        )
    between = log(transpose(R_nb[:-1]) @ R_nb[1:])
    total = np.vstack([np.zeros(3), np.cumsum(between, axis=0)])
    turn = total[span:] - total[:-span]
    span_s = span * spacing_s
    regular = np.abs(t_s[2 * span :] - t_s[: -2 * span] - 2 * span_s) < 0.1 * spacing_s
    change = ((turn[span:] - turn[:-span]) / span_s)[regular]
    noise = 6 * np.einsum("nii->ni", covariance_rad2).mean(axis=0) / span_s**2
    density = ((change**2).mean(axis=0) - noise) / (2 / 3 * span_s)
    return np.asarray(np.maximum(density, _LEAST_DENSITY))
