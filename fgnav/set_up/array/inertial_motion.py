"""Equations of velocity: specific force, turned and integrated, against the velocity by Doppler."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, RotationSpline

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.geometry.interpolation import integral, interpolate
from fgnav.geometry.rotations import log, skew, transpose
from fgnav.set_up.array.quick import Quick
from fgnav.set_up.array.regression import Regression
from fgnav.types.flight import Flight, Imu

BIAS, CLOCK, ARM = slice(9, 12), 12, slice(13, 16)  # unknowns, after the nine of the matrix
VELOCITY_MPS = 0.05  # noise against which the bias is weighed

_WINDOW_S, _WINDOW_EPOCHS = 4.0, 8  # over which errors of the attitude have not yet added up
_BIASES = 5.0  # a bias may be so many times the stated
_RATE_SPAN_S = 0.4


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Motion:
    """What does not change between hypotheses."""

    quick: Quick  # of n epochs
    imu: Imu
    grid_s: FloatArray  # (m,); times at the accelerometer's rate
    R_nb: FloatArray  # (m, 3, 3); on the grid
    # (n, 3); velocity less what gravity and Coriolis gave since the first epoch
    gained_mps: FloatArray
    turning: FloatArray  # (n, 3, 3); derivative of the attitude, 1/s
    rate_covariance: FloatArray  # (n, 3, 3); of the body rates in it, (rad/s)^2
    window: IntArray  # (n,); stretch of each epoch, over which velocities are compared
    arm_b_m: FloatArray  # (3,); from the accelerometer to the first antenna, as stated


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Equations:
    """Linear equations of velocity, each window's mean taken off: its first one is unknown."""

    A: FloatArray  # (k, 3, q)
    y_mps: FloatArray  # (k, 3)
    ridge: FloatArray  # (q,); what holds unknowns near 0
    epochs: IntArray  # (k,); of the motion

    def regression(self) -> Regression:
        """Return their normal equations."""
        return Regression.of(self.A.reshape(-1, self.A.shape[2]), self.y_mps.ravel(), self.ridge)


def motion_of(flight: Flight, imu: Imu, quick: Quick) -> Motion:
    """Return what a flight's array and code say of its motion."""
    t_s = quick.t_s
    grid_s = np.arange(t_s[0], t_s[-1], float(np.median(np.diff(imu.t_s))))
    apparent = quick.gravity_n_mps2 - 2 * np.cross(
        flight.origin.earth_rate_n_radps[None], quick.v_n_mps
    )
    fallen_mps = integral(t_s, apparent)
    spacing_s = float(np.median(np.diff(t_s)))
    length_s = max(_WINDOW_S, _WINDOW_EPOCHS * spacing_s)
    gap = np.concatenate([[0], np.cumsum(np.diff(t_s) > 3 * spacing_s)])
    _, window = np.unique(np.floor((t_s - t_s[0]) / length_s) + 1e6 * gap, return_inverse=True)
    rates_b_radps, rate_covariance = _rates(quick, max(1, round(_RATE_SPAN_S / 2 / spacing_s)))
    return Motion(
        quick=quick,
        imu=imu,
        grid_s=grid_s,
        R_nb=RotationSpline(t_s, Rotation.from_matrix(quick.R_nb))(grid_s).as_matrix(),
        gained_mps=quick.v_n_mps - fallen_mps,
        turning=quick.R_nb @ skew(rates_b_radps),
        rate_covariance=rate_covariance,
        window=window,
        arm_b_m=flight.antennas[0].position_b_m - imu.position_b_m,
    )


def _rates(quick: Quick, reach: int) -> tuple[FloatArray, FloatArray]:
    """Return body rates, (n, 3), rad/s, means over some epochs each way, and their covariance."""
    between = log(transpose(quick.R_nb[:-1]) @ quick.R_nb[1:])
    total = np.vstack([np.zeros(3), np.cumsum(between, axis=0)])
    k = np.arange(len(total))
    first, last = np.maximum(k - reach, 0), np.minimum(k + reach, len(total) - 1)
    span_s = (quick.t_s[last] - quick.t_s[first])[:, None]
    P = quick.covariance_rad2
    return (total[last] - total[first]) / span_s, (P[last] + P[first]) / span_s[..., None] ** 2


def equations(motion: Motion) -> Equations:
    """Return equations of all unknowns.

    Raises
    ------
    NoSolutionError
        If the accelerometer does not overlap the epochs.
    """
    at_s, R_nb, f_b = _forces(motion, 0.0)
    by_element = (R_nb[:, :, :, None] * f_b[:, None, None, :]).reshape(-1, 3, 9)
    jerk = np.einsum("nij,nj->ni", R_nb, np.gradient(f_b, at_s, axis=0))[:, :, None]
    A, epochs = _integrated(motion, at_s, np.concatenate([by_element, R_nb, jerk], axis=2))
    A = np.concatenate([A, motion.turning[epochs]], axis=2)
    return _centred(motion, A, motion.gained_mps[epochs], epochs, BIAS)


def scale_equations(motion: Motion, late_s: float) -> Equations:
    """Return equations of the specific force's scale and bias alone; raises as ``equations`` does.

    As if the accelerometer's times were to be raised by so much.
    """
    at_s, R_nb, f_b = _forces(motion, late_s)
    scale = np.einsum("nij,nj->ni", R_nb, f_b)[:, :, None]
    A, epochs = _integrated(motion, at_s, np.concatenate([scale, R_nb], axis=2))
    y_mps = motion.gained_mps[epochs] - motion.turning[epochs] @ motion.arm_b_m
    return _centred(motion, A, y_mps, epochs, slice(1, 4))


def _forces(motion: Motion, late_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times on the grid, (m,), attitudes and specific forces there."""
    sampled_s = motion.imu.t_s + late_s
    inside = (motion.grid_s >= sampled_s[0]) & (motion.grid_s <= sampled_s[-1])
    if inside.sum() < 2 * _WINDOW_EPOCHS:
        raise NoSolutionError("the accelerometer does not overlap the epochs of GNSS")
    at_s = motion.grid_s[inside]
    f_b = interpolate(at_s, sampled_s, motion.imu.f_b_mps2)
    return at_s, motion.R_nb[inside], f_b


def _integrated(
    motion: Motion, at_s: FloatArray, integrand: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Return integrals from the first of times, (m,), to each epoch within them; and which."""
    t_s = motion.quick.t_s
    middles = (integrand[1:] + integrand[:-1]) / 2 * (at_s[1] - at_s[0])
    total = np.concatenate([np.zeros((1, *integrand.shape[1:])), np.cumsum(middles, axis=0)])
    epochs = np.flatnonzero((t_s >= at_s[0]) & (t_s <= at_s[-1]))
    place = np.searchsorted(at_s, t_s[epochs]).clip(1, len(at_s) - 1)
    share = ((t_s[epochs] - at_s[place - 1]) / (at_s[place] - at_s[place - 1]))[:, None, None]
    return total[place - 1] + share * (total[place] - total[place - 1]), epochs


def _centred(
    motion: Motion, A: FloatArray, y_mps: FloatArray, epochs: IntArray, bias: slice
) -> Equations:
    window, ridge = motion.window[epochs], np.zeros(A.shape[2])
    ridge[bias] = (VELOCITY_MPS / (_BIASES * motion.imu.accelerometer_bias_mps2)) ** 2
    return Equations(
        A=_less_mean(A, window), y_mps=_less_mean(y_mps, window), ridge=ridge, epochs=epochs
    )


def _less_mean(x: FloatArray, window: IntArray) -> FloatArray:
    """Take each window's mean off (k, ...)."""
    count = np.bincount(window).clip(1)
    flat = x.reshape(len(x), -1)
    mean = np.stack([np.bincount(window, c) / count for c in flat.T], axis=1)
    return np.asarray((flat - mean[window]).reshape(x.shape))
