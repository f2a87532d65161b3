"""Build the motion between keyframes: by a gyroscope, or by the prior of the body's rate."""

import numpy as np

from fgnav.alignment.alignment import Alignment
from fgnav.alignment.gaps import Bridged
from fgnav.assembly.settings import ProblemSettings
from fgnav.assembly.stages import Aligned, Tracked
from fgnav.attitude.imu_rotation import spun
from fgnav.checks import BoolArray, FloatArray, IntArray, NoSolutionError
from fgnav.geometry.interpolation import interpolate
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.multipath import Multipath
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.parameters import Parameters
from fgnav.messages import Note, note
from fgnav.process.evidence import causal_rate_priors, rate_prior
from fgnav.process.hyperparameters import RatePrior
from fgnav.process.prediction import Turning, filtered, filtered_back, smoothed
from fgnav.process.volatility import varying_rate_prior

_MINIMUM = 5  # attitudes for hyperparameters
_BY_ONE_BASELINE = 3  # rank of what it tells of a rotation's nine elements
_FIRST = 2  # attitudes that a causal prediction begins with
_UNKNOWN_RAD = 0.5  # of a direction: its cosine errs by a tenth, what is linear about it holds
# Integration steps per inertial sample. Without a gyroscope the quadrature of one step errs by .02
# sigma at most (sine of 45 degrees, spin of 2 Hz); GTSAM's integration of measured rates by 1.2 of
# velocity on that spin, with two steps by .3.
_SUB_STEPS, _SUB_STEPS_WITH_GYROSCOPE = 1, 2


def motion_of(
    stages: tuple[Aligned, Tracked],
    settings: ProblemSettings,
    constants: Parameters,
    multipath: Multipath | None = None,
) -> tuple[Motion, Turning | None, tuple[str, ...]]:
    """Build the motion between keyframes, gaps included, and notes.

    Without a gyroscope also the rotation predicted by attitudes alone.
    """
    stage, track = stages
    imu, inflated = stage.record.imu, stage.record.inflated
    holed = stage.record.overlaps(track.t_s)[:-1]
    if imu.gyroscope_noise_radps_per_sqrt_hz is not None:
        rate_noise = inflated.gyroscope_noise_radps_per_sqrt_hz or 0.0
        motion: Motion = Inertial(
            t_s=track.t_s,
            imu=imu,
            sub_steps=settings.sub_steps or _SUB_STEPS_WITH_GYROSCOPE,
            gravity_n_mps2=track.gravity_n_mps2,
            earth_rate_n_radps=stage.earth_rate_n_radps,
            accelerometer_noise=_accelerometer_noise(stage.record, holed),
            gyroscope_noise=np.where(holed, rate_noise, imu.gyroscope_noise_radps_per_sqrt_hz) ** 2,
        )
        return motion, None, ()
    poles, variance, notes = _rate_priors(stage, settings)
    start = stage.start  # attitudes of axes that do not spin: up to each, and from there on
    of = (start.t_s, start.R_nu, start.covariance_rad2, start.valid, (poles, variance))
    predictions: tuple[Turning, ...] = (
        (filtered(*of, past=_FIRST),) if stage.causal else (filtered(*of), filtered_back(*of))
    )
    lost = holed | _is_direction_unknown(stage, predictions)
    motion = GyroFree(
        t_s=track.t_s,
        imu=imu,
        sub_steps=settings.sub_steps or _SUB_STEPS,
        gravity_n_mps2=track.gravity_n_mps2,
        earth_rate_n_radps=stage.earth_rate_n_radps,
        poles_per_s=poles,
        variance_rad2ps2=variance,
        accelerometer_noise=_accelerometer_noise(stage.record, lost),
        constants=constants,
        multipath=multipath,
    )
    prediction = predictions[0] if stage.causal else smoothed(*predictions)
    return motion, _in_body(prediction, stage.start), notes


def _in_body(prediction: Turning, start: Alignment) -> Turning:
    """Return the rotations of the body itself, which may spin."""
    rotation, t_s = start.rotation, start.t_s
    if rotation is None:
        return prediction
    rate = np.einsum("nji,nj->ni", rotation.at(t_s), prediction.rate_b_radps) + rotation.rates(t_s)
    return prediction._replace(
        R_nb=spun(rotation, t_s, prediction.R_nb), rate_b_radps=np.asarray(rate)
    )


def _rate_priors(
    stage: Aligned, settings: ProblemSettings
) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Return poles, (n - 1, 3, 3), variances, (n - 1, 3), of intervals' priors; what to note.

    Stated, or identified by the evidence of attitudes with integers: by those of the whole flight,
    its scale varying where that is likelier, or, where nothing is to look ahead, by those up to
    each interval. An array's may be those with other tags or noise of the unit.
    """
    start = stage.start
    sure = start.valid & (stage.float_arcs.stretch < 0)
    n = len(start.t_s) - 1
    if settings.rate_prior is None and sure.sum() < _MINIMUM:
        raise NoSolutionError(
            f"rate: {int(sure.sum())} epochs with an attitude are too few to identify the "
            f"rate's process without a gyroscope, needs {_MINIMUM}; or state rate_prior"
        )
    if settings.causal and settings.rate_prior is None:
        poles, variance = _causal_priors(start, sure)
        return poles, variance, (note("D209"),)
    if settings.interval_priors is not None and _is_by_array(start):
        return *settings.interval_priors.at(start.t_s[:-1]), ()
    attitudes = start.t_s[sure], start.R_nu[sure], start.covariance_rad2[sure]
    if settings.rate_prior is not None:
        prior, varying = settings.rate_prior, None
    else:
        swings = _is_by_array(start)
        prior = rate_prior(*attitudes, swings=swings)
        varying = varying_rate_prior(*attitudes, prior, swings=swings)
    if varying is None:
        variance = np.tile(prior.variance_rad2ps2, (n, 1))
        return np.tile(prior.poles_per_s, (n, 1, 1)), variance, (prior_note(prior),)
    latest = _latest(attitudes[0], start.t_s[:-1]).clip(max=len(varying.variance_rad2ps2) - 1)
    return (
        np.tile(varying.poles_per_s, (n, 1, 1)),
        varying.variance_rad2ps2[latest],
        (note("D208", shape=_shape(varying.poles_per_s), gain=varying.evidence_gain),),
    )


def _causal_priors(start: Alignment, sure: BoolArray) -> tuple[FloatArray, FloatArray]:
    t_s, R_nu, P = start.t_s[sure], start.R_nu[sure], start.covariance_rad2[sure]
    # One attitude more: that after the last interval, which takes no part in its prior.
    poles, variance = causal_rate_priors(
        np.append(t_s, t_s[-1] + 1.0),
        np.concatenate([R_nu, R_nu[-1:]]),
        np.concatenate([P, P[-1:]]),
        swings=_is_by_array(start),
    )
    latest = _latest(t_s, start.t_s[:-1])
    return poles[latest], variance[latest]


def _is_by_array(start: Alignment) -> bool:
    """Return True if attitudes are an array's alone, about all axes.

    Those of vectors err alike for seconds, and as the body turns, which would seem to swing.
    """
    if start.form is None or not start.valid.any():
        return False
    information = start.form.information[np.argmax(start.valid)]  # of the first: no later one
    return bool(np.linalg.matrix_rank(information, hermitian=True) > _BY_ONE_BASELINE)


def is_predicted(prediction: Turning) -> BoolArray:
    """Return at which times, (n,), predicted rotations are good enough to linearise there."""
    return np.asarray(
        np.trace(prediction.covariance[:, :3, :3], axis1=1, axis2=2) < _UNKNOWN_RAD**2
    )


def _is_direction_unknown(stage: Aligned, predictions: tuple[Turning, ...]) -> BoolArray:
    """Return the intervals, (n - 1,), over which nobody knows where the specific force points.

    Where the rotation across it, as the prior leads on from the attitudes before, or back from
    those after, is unknown by more than half a radian, the force would determine attitude by a
    linearisation that holds no longer.
    """
    start, imu = stage.start, stage.record.imu
    f_b = interpolate(start.t_s, imu.t_s, imu.f_b_mps2)
    e_b = f_b / np.linalg.norm(f_b, axis=1, keepdims=True).clip(1e-9)
    across = np.eye(3) - e_b[:, :, None] * e_b[:, None, :]
    sigma = np.min([_largest_sigma(across, P.covariance[:, :3, :3]) for P in predictions], axis=0)
    return np.asarray(np.minimum(sigma[1:], sigma[:-1]) > _UNKNOWN_RAD)


def _largest_sigma(across: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the largest 1-sigma, (n,), of what is left of vectors after a projection."""
    finite = np.isfinite(covariance).all(axis=(1, 2))
    out = np.full(len(covariance), np.inf)
    part = across[finite] @ covariance[finite] @ across[finite]
    out[finite] = np.sqrt(np.linalg.eigvalsh(part)[:, 2].clip(0))
    return out


def _latest(past_s: FloatArray, t_s: FloatArray) -> IntArray:
    """Find the latest time up to each of other times, (m,), or else the first."""
    return np.asarray((np.searchsorted(past_s, t_s, side="right") - 1).clip(0))


def _accelerometer_noise(record: Bridged, inflated: BoolArray) -> FloatArray:
    """Return the density squared of each interval, (n - 1,): inflated where nobody knows force."""
    noise = record.imu.accelerometer_noise_mps2_per_sqrt_hz
    return np.where(inflated, record.inflated.accelerometer_noise_mps2_per_sqrt_hz, noise) ** 2


def prior_note(prior: RatePrior) -> Note:
    """Return the hyperparameters of the rate's prior as a message."""
    sigma = ", ".join(f"{value:.3g}" for value in np.degrees(np.sqrt(prior.variance_rad2ps2)))
    return note("D207", shape=_shape(prior.poles_per_s), sigma_degps=sigma)


def _shape(poles_per_s: FloatArray) -> str:
    """Return the poles of the rate's prior about the axes, (3, 3), in words."""
    k, z, w = poles_per_s.T
    lengths = ", ".join(f"{value:.3g}" for value in np.sqrt(5.0) / np.cbrt(k * (z**2 + w**2)))
    if (z == k).all() and not w.any():
        return f"Matern 5/2, correlation times {lengths} s"
    swings = ", ".join(
        f"{frequency / (2 * np.pi):.3g} Hz" if frequency > decay else "none"
        for decay, frequency in zip(z, w, strict=True)
    )
    return f"third order, correlation times {lengths} s, modes {swings}"
