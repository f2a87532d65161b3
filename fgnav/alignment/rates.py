"""Body rates as good as they are before smoothing: from the gyroscope, or from attitudes."""

import numpy as np

from fgnav.attitude.imu_rotation import ImuRotation, despun
from fgnav.checks import FloatArray
from fgnav.geometry.interpolation import integral, interpolate
from fgnav.geometry.rotations import log, transpose
from fgnav.graph.delayed import TimedMotion
from fgnav.types.flight import Imu

_SLOPE_SPAN_S = 0.1  # ten samples of a usual unit, whose noise a shorter one would multiply
FORCE_SPAN_S = 0.2  # receivers of moving vehicles give 1 to 10 fixes a second
RATE_SPAN_S = 0.5  # rates are differences of attitudes this far apart


def rough_rates(
    imu: Imu, t_s: FloatArray, R_nb: FloatArray, rotation: ImuRotation | None = None
) -> FloatArray:
    """Return body rates at keyframes, rad/s, (n, 3): the gyroscope's, or from attitudes.

    A spin may be half a turn from one attitude to the next: what is known of it is taken out.
    """
    if imu.w_b_radps is not None:
        return interpolate(t_s, imu.t_s, imu.w_b_radps)
    residual_radps = angular_rates(t_s, despun(rotation, t_s, R_nb))
    if rotation is not None:
        residual_radps = np.einsum("nji,nj->ni", rotation.at(t_s), residual_radps) + rotation.rates(
            t_s
        )
    return np.asarray(residual_radps)


def slopes_at(
    samples_s: FloatArray, w_b_radps: FloatArray, t_s: FloatArray, *, causal: bool = False
) -> FloatArray:
    """Estimate a gyroscope's angular acceleration, (n, 3), by samples about or up to times."""
    after_s = 0.0 if causal else _SLOPE_SPAN_S / 2
    after, before = (
        interpolate(t_s + shift_s, samples_s, w_b_radps, causal=causal)
        for shift_s in (after_s, after_s - _SLOPE_SPAN_S)
    )
    return np.asarray((after - before) / _SLOPE_SPAN_S)


def mean_force_b_mps2(
    imu: Imu,
    t_s: FloatArray,
    w_b_radps: FloatArray | None,
    *,
    after: bool = False,
    span_s: float = FORCE_SPAN_S,
) -> FloatArray:
    """Return mean specific forces, (n, 3), over the time just before each keyframe, or after.

    In the body axes of the keyframe, to which those before or after turn with its rate, (n, 3).

    As long as a receiver's usual interval, over which late velocities are means.
    """
    total = integral(imu.t_s, imu.f_b_mps2)
    end_s = (t_s + span_s * after).clip(imu.t_s[0] + span_s, imu.t_s[-1])
    ends, begins = (interpolate(at_s, imu.t_s, total) for at_s in (end_s, end_s - span_s))
    mean = (ends - begins) / span_s
    if w_b_radps is None:
        return np.asarray(mean)
    return np.asarray(mean + (after - 0.5) * span_s * np.cross(w_b_radps, mean))


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


def timed_motion(
    imu: Imu,
    t_s: FloatArray,
    gravity_n_mps2: FloatArray,
    earth_rate_n_radps: FloatArray,
    *,
    causal: bool = False,
    span_s: float = FORCE_SPAN_S,
) -> TimedMotion:
    """Compute the kinematics at times, (n,); a clock's offset holds in the record's middle."""
    w_b = imu.w_b_radps
    rates = None if w_b is None else interpolate(t_s, imu.t_s, w_b, causal=causal)
    before = mean_force_b_mps2(imu, t_s, rates, span_s=span_s)
    middle_s = 0.0 if causal else float(imu.t_s[[0, -1]].mean())
    return TimedMotion(
        since_s=t_s - middle_s,
        force_before_b_mps2=before,
        force_after_b_mps2=before if causal else mean_force_b_mps2(imu, t_s, rates, after=True),
        led=t_s - imu.t_s[0] > span_s - 1e-6,  # of rounding
        measured_b_radps=rates,
        slope_b_radps2=None if w_b is None else slopes_at(imu.t_s, w_b, t_s, causal=causal),
        gravity_n_mps2=gravity_n_mps2,
        earth_rate_n_radps=earth_rate_n_radps,
    )
