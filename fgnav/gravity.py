"""Gravity seen from the body: its direction at low dynamics, specific force as a pair.

Third parties add estimators through the entry-point group ``fgnav.gravity``: a callable without
arguments that returns a ``GravityEstimator``.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from fgnav import plugins
from fgnav.checks import BadInputError, FloatArray, Unused, freeze, freeze_times, positive
from fgnav.geometry.earth import Origin
from fgnav.geometry.interpolation import integral, interpolate
from fgnav.geometry.rotations import skew
from fgnav.types.flight import Flight, Imu

GROUP = "fgnav.gravity"
ESTIMATORS = {"low-dynamics": "fgnav.gravity:LowDynamics"}

_HELD_INTERVALS = 1.5  # of the accelerometer: its last sample holds as long


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class GravityDirection:
    """The direction of gravity in body axes, where it is known.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    g_b : ndarray, shape (k, 3)
        Unit vectors; level, they point along +z_b.
    covariance : ndarray, shape (k, 3, 3)
        Of the unit vectors.
    unused : tuple of Unused
        Stretches of the flight without an answer.
    """

    t_s: FloatArray
    g_b: FloatArray
    covariance: FloatArray
    unused: tuple[Unused, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = freeze_times("gravity direction", self)
        freeze("gravity direction", self, {"g_b": (k, 3), "covariance": (k, 3, 3)})


class GravityEstimator(Protocol):
    """Anything that finds the direction of gravity in body axes."""

    @property
    def name(self) -> str:
        """Short label, as the reports know it."""
        ...

    # ``looks_ahead``, where it has it: whether an answer may depend on what comes after its time.

    def __call__(self, flight: Flight) -> GravityDirection:
        """Estimate; what has no answer is left out and counted as a loss."""
        ...


def gravity_named(name: str) -> GravityEstimator:
    """Return the gravity estimator of that name.

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.
    """
    factory = plugins.named(GROUP, ESTIMATORS, name, kind="gravity estimator")
    estimator: GravityEstimator = factory()
    return estimator


@dataclass(frozen=True, slots=True, kw_only=True)
class LowDynamics:
    """Averages the accelerometer where it feels little but gravity.

    A window counts when the mean specific force is close to gravity in size and its samples agree
    with the mean. Acceleration across gravity barely changes the size, so what may remain of it is
    stated as noise. A steady turn with the lift of level flight is not told from a slope.

    Attributes
    ----------
    window_s : float
        Length of one average.
    size_tolerance_mps2 : float
        How far the mean's size may be from gravity.
    steadiness_mps2 : float
        Root mean square of the samples about their mean that still counts as steady.
    acceleration_mps2 : float
        Standard deviation, per axis, of acceleration that passes both tests.
    causal : bool
        An answer stands at the first sample after its window, when all of it is known, instead of
        at its middle; what may have turned since is stated as noise.
    """

    window_s: float = 0.5
    size_tolerance_mps2: float = 0.3
    steadiness_mps2: float = 0.3
    acceleration_mps2: float = 0.5  # 3 degrees
    causal: bool = False
    name: str = "low-dynamics"

    def __post_init__(self) -> None:
        """Reject settings that are zero or negative."""
        for name in ("window_s", "size_tolerance_mps2", "steadiness_mps2", "acceleration_mps2"):
            positive(f"low dynamics {name}", getattr(self, name))

    @property
    def looks_ahead(self) -> bool:
        """Return True if an answer stands before the end of the samples that it is made of."""
        return not self.causal

    def __call__(self, flight: Flight) -> GravityDirection:
        """Estimate at the middle of each window, or after it.

        Raises
        ------
        BadInputError
            If the flight has no accelerometer.
        """
        imu = flight.imu
        if imu is None:
            raise BadInputError(f"flight {flight.name}: {self.name} gravity needs an [imu]")
        _, start, count = np.unique(
            np.floor((imu.t_s - imu.t_s[0]) / self.window_s), return_index=True, return_counts=True
        )
        total = np.add.reduceat(imu.f_b_mps2, start, axis=0)
        square = np.add.reduceat((imu.f_b_mps2**2).sum(axis=1), start)
        mean = total / count[:, None]
        size = np.linalg.norm(mean, axis=1)
        spread = np.sqrt((square / count - size**2).clip(0))
        # Two rows, because pymap3d drops the axis of a single height.
        g_mps2 = np.linalg.norm(flight.origin.gravity_n_mps2(np.zeros((2, 3)))[0])
        wrong_size = np.abs(size - g_mps2) > self.size_tolerance_mps2
        restless = ~wrong_size & (spread > self.steadiness_mps2)
        reasons = {"size is not that of gravity": wrong_size, "samples are not steady": restless}
        unused = tuple(
            Unused(
                what=f"gravity window of {self.window_s:g} s", reason=reason, count=int(lost.sum())
            )
            for reason, lost in reasons.items()
            if lost.any()
        )
        keep = ~(wrong_size | restless)
        if self.causal:
            keep[-1] = False  # nothing says that the last window is complete
        g_b = -mean[keep] / size[keep, None]
        white = imu.accelerometer_noise_mps2_per_sqrt_hz**2 / self.window_s
        constant = imu.accelerometer_bias_mps2**2 + self.acceleration_mps2**2
        variance = np.full(len(g_b), (white + constant) / g_mps2**2)
        t_s = np.add.reduceat(imu.t_s, start) / count
        if self.causal:
            t_s = imu.t_s[np.append(start[1:], 0)]
            # steady turning that spreads samples by s about their mean is sqrt(3) s off at the end
            variance += 3 * spread[keep] ** 2 / g_mps2**2
        across = np.eye(3) - g_b[:, :, None] * g_b[:, None, :]
        return GravityDirection(
            t_s=t_s[keep], g_b=g_b, covariance=variance[:, None, None] * across, unused=unused
        )


def causal_gravity(estimator: GravityEstimator) -> GravityEstimator:
    """Return an estimator whose answers are made of what came before them.

    Raises
    ------
    BadInputError
        If there is none, naming what to take instead.
    """
    if not getattr(estimator, "looks_ahead", True):
        return estimator
    if isinstance(estimator, LowDynamics):
        return replace(estimator, causal=True)
    raise BadInputError(
        f"gravity {estimator.name!r}: its answers depend on what comes after them; for causal "
        "estimates take 'low-dynamics', or state looks_ahead = False where they do not"
    )


def specific_force_pair(
    imu: Imu,
    origin: Origin,
    t_s: FloatArray,
    p_n_m: FloatArray,
    v_n_mps: FloatArray,
    *,
    causal: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Return specific force in local and in body axes, m/s2, (n, 3) each: one vector, two frames.

    In local axes it is what the velocities say: their central difference over the neighbouring
    epochs, plus the Coriolis acceleration of the Earth-fixed frame, minus gravity. In body axes it
    is the accelerometer's mean over the same span. At rest this is the gravity pair (Eq. 23), and
    unlike it stays right in a turn. It takes velocities as those of the accelerometer, and the
    attitude as constant over the span: turns within it blur the body vector.

    Parameters
    ----------
    t_s : ndarray, shape (n,)
        Epochs of positions and velocities, strictly increasing.
    p_n_m, v_n_mps : ndarray, shape (n, 3)
    causal : bool
        Each epoch by what is known by then: the span is that from the epoch before, and the
        accelerometer's last sample holds until the epoch. The pair is that of the span's middle.

    Returns
    -------
    f_n_mps2, f_b_mps2 : ndarray, shape (n, 3)
        NaN at the first and last epoch, and where the accelerometer does not cover the span.
    """
    f_n_mps2, f_b_mps2 = np.full((2, len(t_s), 3), np.nan)
    if len(t_s) < 3:
        return f_n_mps2, f_b_mps2
    total = integral(imu.t_s, imu.f_b_mps2)
    coriolis = 2 * v_n_mps @ skew(origin.earth_rate_n_radps[None])[0].T
    against_n_mps2 = coriolis - origin.gravity_n_mps2(p_n_m)
    if causal:
        span_s = np.diff(t_s)[:, None]
        f_n_mps2[1:] = np.diff(v_n_mps, axis=0) / span_s
        f_n_mps2[1:] += (against_n_mps2[1:] + against_n_mps2[:-1]) / 2
        f_b_mps2[1:] = np.diff(_integral_so_far(imu, total, t_s), axis=0) / span_s
        return f_n_mps2, f_b_mps2
    first, last = t_s[:-2], t_s[2:]
    span_s = (last - first)[:, None]
    f_n_mps2[1:-1] = (v_n_mps[2:] - v_n_mps[:-2]) / span_s + against_n_mps2[1:-1]
    gained = interpolate(last, imu.t_s, total) - interpolate(first, imu.t_s, total)
    covered = (first >= imu.t_s[0]) & (last <= imu.t_s[-1])
    f_b_mps2[1:-1] = np.where(covered[:, None], gained / span_s, np.nan)
    return f_n_mps2, f_b_mps2


def _integral_so_far(imu: Imu, integral: FloatArray, t_s: FloatArray) -> FloatArray:
    """Return specific force integrated up to times, (n, 3), by the samples before each.

    NaN before the first sample, and later than one and a half intervals after the last.
    """
    last = np.searchsorted(imu.t_s, t_s, side="right") - 1
    at = last.clip(1)
    held_s = (t_s - imu.t_s[at])[:, None]
    usual_s = (imu.t_s[at] - imu.t_s[at - 1])[:, None]
    recent = (last >= 1)[:, None] & (held_s <= _HELD_INTERVALS * usual_s)
    return np.where(recent, integral[at] + imu.f_b_mps2[at] * held_s, np.nan)
