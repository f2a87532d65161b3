"""Hyperparameters of the rate's prior: what they are, what is known before, the likeliest."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

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
# The longest memory worth telling from a constant rate; the shortest that the numerics are for.
LONGEST_S, SHORTEST_S = 60.0, 0.05
# Earth's rate, which the model leaves out, and the range of common MEMS gyroscopes, 2000 deg/s.
LEAST_RADPS, MOST_RADPS = 7.3e-5, 35.0
# Log Bayes factor beyond which what has more parameters is believed: "very strong", Kass and
# Raftery, Bayes factors, JASA 90, 1995, section 3.2.
VERY_STRONG_EVIDENCE = 5.0
_STEP = 1e-4  # of log hyperparameters, for differences
_TOLERANCE, _USUAL_SCORE = 0.02, 1e4
_MOST_GRADIENTS, _LINE_SEARCH = 20, 8


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class RatePrior:
    """The prior of a body rate about its mean: an autoregression of third order about each axis.

    It has a pole ``-k`` and a pair of magnitude p; its length scale is ``sqrt(5) / (k p^2)^(1/3)``.
    Ratios of one, as by default, make it Matern 5/2.

    Attributes
    ----------
    length_s : ndarray, shape (3,)
        Length scales about the body axes. A float: of all axes.
    variance_rad2ps2 : ndarray, shape (3,)
        About the body axes.
    evidence : float
        Log marginal likelihood of the attitudes it was identified from.
    pole_ratio : ndarray, shape (3,)
        Of p to k. A float: of all axes.
    damping_ratio : ndarray, shape (3,)
        Of the pair: below one the rate swings. A float: of all axes.
    """

    length_s: FloatArray | float
    variance_rad2ps2: FloatArray
    evidence: float
    pole_ratio: FloatArray | float = 1.0
    damping_ratio: FloatArray | float = 1.0

    def __post_init__(self) -> None:
        """Check and freeze lengths, variances and ratios."""
        shapes = {}
        for name in ("length_s", "variance_rad2ps2", "pole_ratio", "damping_ratio"):
            if np.ndim(getattr(self, name)) == 0:
                object.__setattr__(self, name, np.full(3, getattr(self, name), dtype=np.float64))
            shapes[name] = (3,)
        freeze("rate prior", self, shapes)
        for name in ("length_s", "pole_ratio", "damping_ratio"):
            positive(f"rate prior {name}", float(np.min(getattr(self, name))))
        if np.max(self.damping_ratio) > 1:
            raise BadInputError(
                f"rate prior damping_ratio: {np.max(self.damping_ratio):.6g}, must be 1 or less"
            )

    @property
    def poles_per_s(self) -> FloatArray:
        """Poles of the process about each axis, (3, 3); see ``matern``."""
        return matern.poles(self.length_s, self.pole_ratio, self.damping_ratio)


class IntervalPriors(NamedTuple):
    """The rate's prior of each interval between n times."""

    t_s: FloatArray  # (n,)
    poles_per_s: FloatArray  # (n - 1, 3, 3), about the body axes
    variance_rad2ps2: FloatArray  # (n - 1, 3)

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return poles, (m, 3, 3), and variances, (m, 3), of the intervals that times are in."""
        latest = np.searchsorted(self.t_s, t_s, side="right") - 1
        rows = latest.clip(0, len(self.variance_rad2ps2) - 1)
        return self.poles_per_s[rows], self.variance_rad2ps2[rows]


def likeliest(
    score: Callable[[FloatArray], float], start: FloatArray, lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """Return where a score is greatest between bounds, (k,), from a start, by differences."""

    def sloped(x: FloatArray) -> tuple[float, FloatArray]:
        value = score(x)
        ahead = np.array([score(x + _STEP * axis) for axis in np.eye(len(x))])
        return value, (ahead - value) / _STEP

    return climbed(sloped, start, lower, upper)


def climbed(
    score: Callable[[FloatArray], tuple[float, FloatArray]],
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> FloatArray:
    """Return where a score, given with its slope, is greatest between bounds, (k,)."""

    def descent(x: FloatArray) -> tuple[float, FloatArray]:
        value, slope = score(x)
        return -value, -slope

    with one_thread():
        search = minimize(
            descent,
            start,
            method="L-BFGS-B",
            jac=True,
            bounds=np.stack([lower, upper], axis=1),
            options={
                "ftol": _TOLERANCE / _USUAL_SCORE,
                "gtol": 0.0,
                "maxfun": _MOST_GRADIENTS,
                "maxls": _LINE_SEARCH,
            },
        )
    return np.asarray(np.clip(search.x, lower, upper))
