"""Accelerometer samples between keyframes, cut for integration, with or without a gyroscope.

Without one, the rate is taken as zero and the gyro-bias slot carries minus the body's angular rate,
a random walk: white angular acceleration. With one, the slot is its bias.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.cubic_spline import cubic_spline
from fgnav.flight import Imu
from fgnav.rotations import log, transpose

# Sub-steps of one accelerometer sample: GTSAM discretises the covariance per call. On the joint
# chi-square of rotation, velocity and rate (9 expected): one step 25, three 10.7, ten 9.1.
SUB_STEPS = 5
_PSEUDO_GYROSCOPE_RADPS_PER_SQRT_HZ = 1e-6  # of the rate of zero: the slot does all the work
RATE_SPAN_S = 0.5  # angular rates are told from attitudes this far apart


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Foretold:
    """Body rates that are expected in gaps, and that the slot is counted from.

    Beside and between gaps on straight lines, which a random walk that measurements hold hardly
    minds.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
        Increasing.
    w_b_radps : ndarray, shape (k, 3)
    """

    t_s: FloatArray
    w_b_radps: FloatArray

    def at(self, t_s: FloatArray) -> FloatArray:
        """Return rates at times, (n,), as (n, 3)."""
        return np.stack([np.interp(t_s, self.t_s, x) for x in self.w_b_radps.T], axis=1)

    def after(self, other: "Foretold | None") -> "Foretold":
        """Return these rates with those of earlier gaps, as far as these leave room for them."""
        if other is None:
            return self
        before = other.t_s < self.t_s[0]
        return Foretold(
            t_s=np.concatenate([other.t_s[before], self.t_s]),
            w_b_radps=np.concatenate([other.w_b_radps[before], self.w_b_radps]),
        )


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
        At the middle of each sub-step. Rates are 0 without a gyroscope.
    """

    step_s: FloatArray
    first: IntArray
    f_b_mps2: FloatArray
    w_b_radps: FloatArray

    def told(self, t_s: FloatArray, foretold: Foretold) -> "Increments":
        """Return them with rates that are expected between keyframes, (n,)."""
        return replace(self, w_b_radps=foretold.at(_middle_s(t_s, self.first, self.step_s)))


def increments(imu: Imu, t_s: FloatArray, sub_steps: int = SUB_STEPS) -> Increments:
    """Cut the time between keyframes, (n,), into equal sub-steps of samples."""
    if sub_steps < 1:
        raise BadInputError(f"sub_steps: must be 1 or more, got {sub_steps}")
    span_s = np.diff(t_s)
    sample_s = float(np.median(np.diff(imu.t_s)))
    counts = np.maximum(1, np.rint(span_s / sample_s * sub_steps)).astype(np.int64)
    first = np.concatenate([[0], np.cumsum(counts)])
    step_s = span_s / counts
    middle_s = _middle_s(t_s, first, step_s)
    # A straight line between samples would cut the corners of a spin: 3 mm/s2 at 1 Hz.
    no_rate = np.zeros((len(middle_s), 3))
    return Increments(
        step_s=step_s,
        first=first,
        f_b_mps2=cubic_spline(imu.t_s, imu.f_b_mps2, middle_s),
        w_b_radps=no_rate
        if imu.w_b_radps is None
        else cubic_spline(imu.t_s, imu.w_b_radps, middle_s),
    )


def _middle_s(t_s: FloatArray, first: IntArray, step_s: FloatArray) -> FloatArray:
    """Return the middles of sub-steps."""
    counts = np.diff(first)
    within = np.arange(first[-1]) - np.repeat(first[:-1], counts)
    return np.asarray(np.repeat(t_s[:-1], counts) + (within + 0.5) * np.repeat(step_s, counts))


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Preintegrator:
    """What the motion between keyframes is integrated from; see ``links`` and ``motion_factor``.

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
    foretold : Foretold or None
        Rates that the slot is counted from, as from a gyroscope's; only without one.
    rate_density : ndarray, shape (3,)
        Intensity of the part of the rate that is white, (rad/s)2/Hz, beside the part that walks;
        only without a gyroscope, whose own noise stands in its place.
    """

    imu: Imu
    increments: Increments
    gravity_n_mps2: FloatArray
    earth_rate_n_radps: FloatArray
    angular_acceleration_density: FloatArray
    foretold: Foretold | None = None
    rate_density: FloatArray = field(default_factory=lambda: np.zeros(3))

    @property
    def noise(self) -> FloatArray:
        """Return the noise of each interval, (n - 1, 8), for ``motion_kernel``.

        Densities of the accelerometer's noise, of the walk of its bias, and about the three axes
        those of the rate's noise, then of the walk of the slot's second half.
        """
        imu, n = self.imu, len(self.increments.step_s)
        walk = imu.gyroscope_bias_walk_radps_per_sqrt_s
        density = self.angular_acceleration_density if walk is None else np.full(3, walk**2)
        return np.tile(np.concatenate([self._densities(imu), density]), (n, 1))

    def _densities(self, imu: Imu) -> FloatArray:
        felt = imu.accelerometer_noise_mps2_per_sqrt_hz
        walk = imu.accelerometer_bias_walk_mps2_per_sqrt_s
        noise = imu.gyroscope_noise_radps_per_sqrt_hz or _PSEUDO_GYROSCOPE_RADPS_PER_SQRT_HZ
        return np.array([felt**2, walk**2, *(noise**2 + self.rate_density)])

    def told_radps(self, t_s: FloatArray) -> FloatArray:
        """Return rates at times, (n,), that less the slot are the body's: (n, 3)."""
        if self.imu.w_b_radps is None:
            return np.zeros((len(t_s), 3)) if self.foretold is None else self.foretold.at(t_s)
        return np.stack([np.interp(t_s, self.imu.t_s, x) for x in self.imu.w_b_radps.T], axis=1)


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
