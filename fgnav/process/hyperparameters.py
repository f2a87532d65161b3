"""Hyperparameters of the rate's prior: what they are, what is known before, the likeliest."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from fgnav.checks import BadInputError, FloatArray, freeze, positive
from fgnav.kernels.one_thread import one_thread
from fgnav.process import matern

# Before anything is identified. Standard deviations of measured rates about their means, rad/s: two
# quadrotor paths .08-.78, correlated over .1-.3 s; a car .03-.16 over seconds (Hurwitz and Klein,
# arXiv 2310.13452; i2Nav car data). Whoever turns faster, about a steady axis, has it in the mean.
DEFAULT_LENGTH_S = 0.5
DEFAULT_SIGMA_RADPS = 1.0
# 1-sigma of the logarithm of length scales about the default's: 95 % of .03 to 9 s.
_LOG_LENGTH_SIGMA = 1.5
# 1-sigma of the logarithm of each axis' own about their mean. Of gyroscopes over a minute: eight of
# a car 1.4 (it yaws for two seconds, and rocks on its springs), of two quadrotor paths 0.4.
_AXIS_LENGTH_SIGMA = 1.0
# The longest memory worth telling from a constant rate; the shortest that the numerics are for.
LONGEST_S, SHORTEST_S = 60.0, 0.05
# Earth's rate, which the model leaves out, and the range of common MEMS gyroscopes, 2000 deg/s.
LEAST_RADPS, MOST_RADPS = 7.3e-5, 35.0
# Nats beyond which what has more parameters is believed: "very strong", Kass and Raftery, Bayes
# factors, JASA 90, 1995, section 3.2.
VERY_STRONG_NATS = 5.0
_STEP = 1e-4  # of log hyperparameters, for differences
_TOLERANCE_NATS, _USUAL_NATS = 0.02, 1e4
_MOST_GRADIENTS, _LINE_SEARCH = 20, 8


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class RatePrior:
    """The prior of a body rate about its mean: Matern 5/2, or its relative that swings.

    Attributes
    ----------
    length_s : ndarray, shape (3,)
        Length scales l about the body axes: poles at ``-sqrt(5) / l``. A float: of all axes.
    variance_rad2ps2 : ndarray, shape (3,)
        About the body axes.
    evidence : float
        Log marginal likelihood of the attitudes it was identified from, nats.
    swing_per_s : tuple of float, optional
        Decay, 1/s, and angular frequency, rad/s, of the two other poles; None: those of Matern 5/2.
    """

    length_s: FloatArray | float
    variance_rad2ps2: FloatArray
    evidence: float
    swing_per_s: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Check and freeze lengths and variances."""
        if np.ndim(self.length_s) == 0:
            object.__setattr__(self, "length_s", np.full(3, self.length_s))
        freeze("rate prior", self, {"length_s": (3,), "variance_rad2ps2": (3,)})
        positive("rate prior length_s", float(np.min(self.length_s)))
        if self.swing_per_s is not None:
            decay_per_s, frequency_radps = self.swing_per_s
            positive("rate prior swing_per_s: decay", decay_per_s)
            if not 0.0 <= frequency_radps < np.inf:
                raise BadInputError(
                    f"rate prior swing_per_s: a frequency of {frequency_radps} rad/s is none"
                )

    @property
    def poles_per_s(self) -> FloatArray:
        """Poles of the process about each axis, (3, 3); see ``matern``."""
        poles = matern.poles(self.length_s)
        if self.swing_per_s is not None:
            poles[:, 1:] = self.swing_per_s
        return poles


def bounds(shortest_s: float = SHORTEST_S) -> tuple[FloatArray, FloatArray]:
    """Return the least and the most of (log lengths, log standard deviations), (6,)."""
    least, most = np.log([shortest_s, LEAST_RADPS]), np.log([LONGEST_S, MOST_RADPS])
    return np.repeat(least, 3), np.repeat(most, 3)


def log_prior(log_length: FloatArray, log_sigma: FloatArray) -> float:
    """Return the log prior of log lengths, (m,), and log deviations, (3,); see ``rate_prior``."""
    gamma = log_sigma - np.exp(log_sigma) / DEFAULT_SIGMA_RADPS
    common = log_length.mean()
    normal = (common - np.log(DEFAULT_LENGTH_S)) / _LOG_LENGTH_SIGMA
    apart = (log_length - common) / _AXIS_LENGTH_SIGMA
    return float(gamma.sum() - (normal**2 + (apart**2).sum()) / 2)


def likeliest(
    score: Callable[[FloatArray], float], start: FloatArray, lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """Return where a score is greatest between bounds, (k,), from a start, by differences."""

    def descent(x: FloatArray) -> tuple[float, FloatArray]:
        value = -score(x)
        ahead = np.array([-score(x + _STEP * axis) for axis in np.eye(len(x))])
        return value, (ahead - value) / _STEP

    with one_thread():
        search = minimize(
            descent,
            start,
            method="L-BFGS-B",
            jac=True,
            bounds=np.stack([lower, upper], axis=1),
            options={
                "ftol": _TOLERANCE_NATS / _USUAL_NATS,
                "gtol": 0.0,
                "maxfun": _MOST_GRADIENTS,
                "maxls": _LINE_SEARCH,
            },
        )
    return np.asarray(np.clip(search.x, lower, upper))
