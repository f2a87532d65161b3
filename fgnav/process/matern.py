"""The Matern-5/2 process that the angular rate follows about its mean, one axis at a time.

The state is the rate with its derivatives scaled, ``x = (w, T0 a, T0^2 j)``, T0 =
``DERIVATIVE_SCALE_S``. Over an interval T, about a mean rate m::

    x(T) - (m, 0, 0) = F (x(0) - (m, 0, 0)) + noise
    integral of w    = m T + H (x(0) - (m, 0, 0)) + noise

with both noises together, (4,), of covariance ``variance * L L'``.

References
----------
.. [1] Hartikainen and Sarkka, Kalman filtering and smoothing solutions to temporal Gaussian process
   regression models, IEEE MLSP 2010, section 3.3 (Matern as a state-space model).
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.process import matern_kernel
from fgnav.process.matern_kernel import DERIVATIVE_SCALE_S

_TIME_RESOLUTION_DIGITS = 9  # s: intervals closer than this are one


class Intervals(NamedTuple):
    """The process over k intervals, for unit variance."""

    F: FloatArray  # (k, 3, 3) transition of (w, T0 a, T0^2 j)
    H: FloatArray  # (k, 3) integral row, s
    W: FloatArray  # (k, 4, 4) lower: W @ noise of (phi, w, T0 a, T0^2 j) is white


def transition(T_s: float, length_s: float) -> FloatArray:
    """Return F, (3, 3), over an interval of the process of that length scale."""
    return np.asarray(matern_kernel.transition(float(T_s), float(length_s)))


def integral(T_s: float, length_s: float) -> FloatArray:
    """Return H, (3,), s: the angle turned through is ``m T + H (x - (m, 0, 0))``."""
    return np.asarray(matern_kernel.integral(float(T_s), float(length_s)))


def noise_factor(T_s: float, length_s: float) -> FloatArray:
    """Return the lower factor of the covariance of (phi, w, T0 a, T0^2 j), (4, 4), unit variance.

    Units: phi in s, the others 1. Of unit variance, that is of a rate of 1 rad/s.
    """
    return np.asarray(matern_kernel.noise_factor(float(T_s), float(length_s)))


def stationary(length_s: float) -> FloatArray:
    """Return the covariance of (w, T0 a, T0^2 j) at any time, (3, 3), for unit variance."""
    square = (matern_kernel.rate_constant(float(length_s)) * DERIVATIVE_SCALE_S) ** 2
    P = np.diag([1.0, square / 3, square**2])
    P[0, 2] = P[2, 0] = -square / 3
    return P


def intervals(T_s: FloatArray, length_s: FloatArray) -> Intervals:
    """Return the process over intervals, each distinct pair of duration and length worked out once.

    Parameters
    ----------
    T_s : ndarray, shape (k,)
        Durations.
    length_s : ndarray, shape (k,)
        Length scales.
    """
    pairs = np.stack([np.round(T_s, _TIME_RESOLUTION_DIGITS), length_s], axis=1)
    distinct, which = np.unique(pairs, axis=0, return_inverse=True)
    m = len(distinct)
    F, H, W = np.empty((m, 3, 3)), np.empty((m, 3)), np.empty((m, 4, 4))
    durations, lengths = np.ascontiguousarray(distinct.T)
    matern_kernel.intervals_into(durations, lengths, F, H, W)
    which = which.reshape(-1)
    return Intervals(F=F[which], H=H[which], W=W[which])
