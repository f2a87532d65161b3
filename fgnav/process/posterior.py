"""The posterior density of a rate prior's hyperparameters, with its slope.

They stand in one vector, (12,), three axes each: logarithms of lengths, of pole ratios, of damping
ratios (negative), of standard deviations. Before attitudes are seen the mean log length is normal
about that of ``DEFAULT_LENGTH_S`` and each axis' normal about the mean; log pole ratios are normal;
damping ratios are uniform from zero to one, but a swing is remembered, sqrt(5) over its decay, for
no longer than a half-normal distribution of the record or of a part of it allows: who sees a few
periods cannot tell one that goes on for ever from one that is driven. Standard deviations follow
gamma distributions of shape 2 with their mode at ``DEFAULT_SIGMA_RADPS``, which keeps them off zero
where the likelihood is flat towards it [1]_ and finite about an axis that no attitude tells.

References
----------
.. [1] Chung, Rabe-Hesketh, Dorie, Gelman and Liu, A nondegenerate penalized likelihood estimator
   for variance parameters in multilevel models, Psychometrika 78, 2013.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.process import matern
from fgnav.process.attitude_series import AttitudeSeries
from fgnav.process.evidence_kernel import Tape
from fgnav.process.hyperparameters import (
    DEFAULT_LENGTH_S,
    DEFAULT_SIGMA_RADPS,
    LEAST_RADPS,
    LONGEST_S,
    MOST_RADPS,
    SHORTEST_S,
    RatePrior,
)
from fgnav.process.score_kernel import score

# 1-sigma of the logarithm of length scales about the default's: 95 % of .03 to 9 s.
_LOG_LENGTH_SIGMA = 1.5
# 1-sigma of the logarithm of each axis' own about their mean. Of gyroscopes over a minute: eight of
# a car 1.4 (it yaws for two seconds, and rocks on its springs), of two quadrotor paths 0.4.
_AXIS_LENGTH_SIGMA = 1.0
# Of the logarithm of pole ratios about three axes: by gyroscopes over a minute those of a car, two
# quadrotor paths and a UAV have 1.0 in the mean and a standard deviation of 2.0.
_LOG_RATIO, _LOG_RATIO_SIGMA = 1.0, 2.0
# Bounds of the numerics: a pole 400 times another; a swing of 160 periods until half is gone.
_MOST_LOG_RATIO, _MOST_LOG_DAMPING = 6.0, 7.0
LENGTH, RATIO, DAMPING, SIGMA = (slice(3 * i, 3 * i + 3) for i in range(4))


def bounds(shortest_s: float = SHORTEST_S, *, swings: bool = True) -> tuple[FloatArray, FloatArray]:
    """Return the least and the most of hyperparameters, (12,) each; without swings Matern 5/2."""
    ratio, damping = (_MOST_LOG_RATIO, _MOST_LOG_DAMPING) if swings else (0.0, 0.0)
    lower = [np.log(shortest_s), -ratio, 0.0, np.log(LEAST_RADPS)]
    most = [np.log(LONGEST_S), ratio, damping, np.log(MOST_RADPS)]
    return np.repeat(lower, 3), np.repeat(most, 3)


def hyperparameters(prior: RatePrior) -> FloatArray:
    """Return those of a prior, (12,)."""
    rest = np.log(prior.length_s), np.log(prior.pole_ratio), -np.log(prior.damping_ratio)
    return np.concatenate([*rest, np.log(prior.variance_rad2ps2) / 2])


def prior_of(x: FloatArray, evidence: float) -> RatePrior:
    """Return the prior with hyperparameters, (12,)."""
    return RatePrior(
        length_s=np.exp(x[LENGTH]),
        pole_ratio=np.exp(x[RATIO]),
        damping_ratio=np.exp(-x[DAMPING]),
        variance_rad2ps2=np.exp(2 * x[SIGMA]),
        evidence=evidence,
    )


def poles(x: FloatArray) -> FloatArray:
    """Return the poles about each axis, (3, 3), of hyperparameters, (9,) or more."""
    return matern.poles(np.exp(x[LENGTH]), np.exp(x[RATIO]), np.exp(-x[DAMPING]))


def log_prior(x: FloatArray, memory_s: float) -> tuple[float, FloatArray]:
    """Return the log prior of hyperparameters, (12,), and its slope, (12,)."""
    slope = np.empty(12)
    common = x[LENGTH].mean()
    normal = (common - np.log(DEFAULT_LENGTH_S)) / _LOG_LENGTH_SIGMA
    deviation = (x[LENGTH] - common) / _AXIS_LENGTH_SIGMA
    ratio = (x[RATIO] - _LOG_RATIO) / _LOG_RATIO_SIGMA
    sigmas = np.exp(x[SIGMA]) / DEFAULT_SIGMA_RADPS
    remembered_s = np.exp(x[LENGTH] - x[RATIO] / 3 + x[DAMPING])
    memory = (remembered_s / memory_s) ** 2
    value = -(normal**2 + (deviation**2).sum() + (ratio**2).sum() + memory.sum()) / 2
    value += (x[SIGMA] - sigmas).sum() - x[DAMPING].sum()
    slope[LENGTH] = -normal / _LOG_LENGTH_SIGMA / 3 - deviation / _AXIS_LENGTH_SIGMA
    slope[RATIO], slope[DAMPING] = -ratio / _LOG_RATIO_SIGMA, -1.0
    slope[LENGTH] -= memory
    slope[RATIO] += memory / 3
    slope[DAMPING] -= memory
    slope[SIGMA] = 1 - sigmas
    return float(value), slope


def log_posterior(
    attitudes: AttitudeSeries,
    x: FloatArray,
    room: Tape,
    memory_s: float,
    apart: FloatArray | float = 0.0,
) -> tuple[float, FloatArray]:
    """Return the log posterior of hyperparameters, (12,), and its slope, (12,).

    Parameters
    ----------
    attitudes : AttitudeSeries
    x : ndarray, shape (12,)
    room : Tape
        For as many epochs; it is that of these hyperparameters then.
    memory_s : float
        How long a swing may be remembered, 1 sigma.
    apart : ndarray, shape (n - 1, 3), optional
        Log scales of intervals beside the standard deviations.
    """
    n = len(attitudes.epochs.t_s)
    variance = np.exp(2 * np.clip(x[SIGMA] + apart, np.log(LEAST_RADPS), np.log(MOST_RADPS)))
    variance = np.broadcast_to(variance, (n - 1, 3)).copy()
    of_axes = poles(x)
    of_intervals = np.tile(of_axes, (n - 1, 1, 1))
    value, slope = log_prior(x, memory_s)
    value += float(attitudes.log_densities(of_intervals, variance, room).sum())
    by_scale, _, by_poles = score(attitudes.epochs.t_s, of_intervals, variance, room, True)
    slope[SIGMA] += by_scale.sum(axis=0)
    slope[: SIGMA.start] += _by_shape(of_axes, by_poles)
    return value, slope


def _by_shape(poles_per_s: FloatArray, by_poles: FloatArray) -> FloatArray:
    """Return the slope by lengths, ratios and dampings, (9,), from that by k, z and w^2, (3, 3)."""
    k, z, w = poles_per_s.T
    of = by_poles * np.stack([k, z, w**2], axis=1)
    by_length = -(of[:, 0] + of[:, 1] + 2 * of[:, 2])
    by_ratio = (-2 * of[:, 0] + of[:, 1] + 2 * of[:, 2]) / 3
    by_damping = -of[:, 1] + 2 * by_poles[:, 2] * z**2
    return np.concatenate([by_length, by_ratio, by_damping])
