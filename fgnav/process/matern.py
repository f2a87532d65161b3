"""The process that the angular rate follows about its mean, one axis at a time.

A stationary autoregression of third order [2]_: Matern 5/2 where its poles are one, ``-k`` with
``k = sqrt(5) / length``, and a body that swings where two of them, ``-z +- i w``, are apart.
The state is the rate with its derivatives scaled, ``x = (w, T0 a, T0^2 j)``, T0 =
``DERIVATIVE_SCALE_S``. Over an interval T, about a mean rate m::

    x(T) - (m, 0, 0) = F (x(0) - (m, 0, 0)) + noise
    integral of w    = m T + H (x(0) - (m, 0, 0)) + noise

with both noises together, (4,), of covariance ``variance * L L'``. Poles are rows ``(k, z, w)``,
1/s.

References
----------
.. [1] Hartikainen and Sarkka, Kalman filtering and smoothing solutions to temporal Gaussian process
   regression models, IEEE MLSP 2010, section 3.3 (Matern as a state-space model).
.. [2] Kelly, Becker, Sobolewska, Siemiginowska and Uttley, Flexible and scalable methods for
   quantifying stochastic variability, Astrophysical Journal 788, 2014 (continuous-time ARMA).
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.process import matern_kernel

_TIME_RESOLUTION_DIGITS = 9  # s: intervals closer than this are one


class Intervals(NamedTuple):
    """The process over k intervals, about one axis or about several, for unit variance."""

    F: FloatArray  # (k, ..., 3, 3) transition of (w, T0 a, T0^2 j)
    H: FloatArray  # (k, ..., 3) integral row, s
    W: FloatArray  # (k, ..., 4, 4) lower: W @ noise of (phi, w, T0 a, T0^2 j) is white


def poles(
    length_s: FloatArray | float,
    pole_ratio: FloatArray | float = 1.0,
    damping_ratio: FloatArray | float = 1.0,
) -> FloatArray:
    """Return the poles, (..., 3), of processes with length scales, (...); see ``RatePrior``."""
    middle = np.sqrt(5.0) / np.asarray(length_s, dtype=np.float64)
    ratio, damping = np.broadcast_arrays(pole_ratio, damping_ratio)
    k, pair = middle * ratio ** (-2 / 3), middle * ratio ** (1 / 3)
    return np.stack([k, pair * damping, pair * np.sqrt(1 - damping**2)], axis=-1)


def shape(poles_per_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return length scales, pole ratios and damping ratios, (...), of poles, (..., 3)."""
    k, pair = poles_per_s[..., 0], np.hypot(poles_per_s[..., 1], poles_per_s[..., 2])
    return np.sqrt(5.0) / np.cbrt(k * pair**2), pair / k, poles_per_s[..., 1] / pair


def transition(T_s: float, poles_per_s: FloatArray) -> FloatArray:
    """Return F, (3, 3), over an interval of the process with poles, (3,)."""
    return np.asarray(matern_kernel.transition(float(T_s), np.array(poles_per_s)))


def integral(T_s: float, poles_per_s: FloatArray) -> FloatArray:
    """Return H, (3,), s: the angle turned through is ``m T + H (x - (m, 0, 0))``."""
    return np.asarray(matern_kernel.integral(float(T_s), np.array(poles_per_s)))


def noise_factor(T_s: float, poles_per_s: FloatArray) -> FloatArray:
    """Return the lower factor of the covariance of (phi, w, T0 a, T0^2 j), (4, 4), unit variance.

    Units: phi in s, the others 1. Of unit variance, that is of a rate of 1 rad/s.
    """
    return np.asarray(matern_kernel.noise_factor(float(T_s), np.array(poles_per_s)))


def stationary(poles_per_s: FloatArray) -> FloatArray:
    """Return the covariance of (w, T0 a, T0^2 j) at any time, (3, 3), for unit variance."""
    first, second = matern_kernel.stationary(np.array(poles_per_s))
    P = np.diag([1.0, first, second])
    P[0, 2] = P[2, 0] = -first
    return P


def intervals(T_s: FloatArray, poles_per_s: FloatArray) -> Intervals:
    """Return the process over intervals, each distinct duration with its poles worked out once.

    Parameters
    ----------
    T_s : ndarray, shape (k,)
        Durations.
    poles_per_s : ndarray, shape (k, ..., 3)
        Of each axis.
    """
    several = poles_per_s.shape[:-1]
    interval_s = np.repeat(np.round(T_s, _TIME_RESOLUTION_DIGITS), int(np.prod(several[1:])))
    rows = np.column_stack([interval_s, poles_per_s.reshape(-1, 3)])
    distinct, inverse = np.unique(rows, axis=0, return_inverse=True)
    m = len(distinct)
    F, H, W = np.empty((m, 3, 3)), np.empty((m, 3)), np.empty((m, 4, 4))
    durations, poles_of = distinct[:, 0].copy(), distinct[:, 1:].copy()
    matern_kernel.intervals_into(durations, poles_of, F, H, W)
    inverse = inverse.reshape(several)
    return Intervals(F=F[inverse], H=H[inverse], W=W[inverse])
