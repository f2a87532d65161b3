"""How far the trust network's probabilities may be believed."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import beta

from fgnav.checks import BoolArray, FloatArray
from fgnav.integers.validation import share_threshold
from fgnav_models.training.trust.data import TrustSamples
from fgnav_models.trust_features import probabilities

SURE = 0.999
_BINS = 15


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Posteriors:
    """What is believed of the best candidate of each epoch, (n,).

    An epoch without candidates is believed to be right with probability 0.
    """

    trust: FloatArray
    right: BoolArray
    entropy: float


def posteriors(score: FloatArray, none: FloatArray, samples: TrustSamples) -> Posteriors:
    """Return the trust in each epoch's best candidate, and whether it is the true one."""
    n = len(samples)
    epoch = np.repeat(np.arange(n), np.diff(samples.start))
    probability, of_none, best = probabilities(score, none, epoch, n)
    some = best >= 0
    right = some & (best - samples.start[:-1] == samples.truth)
    known = samples.truth >= 0
    true = np.where(some, of_none, 1.0)
    true[known] = probability[(samples.start[:-1] + samples.truth)[known]]
    trust = np.where(some, probability[best], 0.0)
    entropy = -float(np.log(np.maximum(true[some], 1e-12)).mean())
    return Posteriors(trust=trust, right=right, entropy=entropy)


def temperature(score: FloatArray, none: FloatArray, samples: TrustSamples) -> float:
    """Return the temperature that makes the truth likeliest."""

    def entropy(logarithm: float) -> float:
        warm = np.exp(logarithm)
        return posteriors(score / warm, none / warm, samples).entropy

    found = minimize_scalar(entropy, bounds=(-1.0, 1.0), method="bounded")
    return float(np.exp(found.x))


def judged(score: FloatArray, none: FloatArray, samples: TrustSamples) -> dict[str, float]:
    """Return success, coverage, wrong among the sure ones and calibration, percent."""
    return summary(posteriors(score, none, samples))


def summary(of: Posteriors) -> dict[str, float]:
    """Return figures of trust: percent, with the Clopper-Pearson bound at 95 %.

    ``coverage_at_share_percent`` is how much can be accepted if the expected share of wrong ones
    among all accepted, not the chance of each to be wrong, is to stay below ``1 - SURE``.
    """
    sure = of.trust > SURE
    wrong, all_sure = int((sure & ~of.right).sum()), int(sure.sum())
    bound = float(beta.ppf(0.95, wrong + 1, all_sure - wrong)) if all_sure > wrong else 1.0
    return {
        "epochs": float(len(of.trust)),
        "success_percent": 100.0 * float(of.right.mean()),
        "coverage_percent": 100.0 * float(sure.mean()),
        "wrong_of_sure": float(wrong),
        "wrong_of_sure_bound_percent": 100.0 * bound,
        "coverage_at_share_percent": 100.0 * share_covered(of.trust),
        "calibration_error": calibration_error(of.trust, of.right),
        "entropy": of.entropy,
    }


def share_covered(trust: FloatArray) -> float:
    """Return the largest share of epochs of which no more than ``1 - SURE`` should be wrong."""
    limit = share_threshold(trust, 1.0 - trust, 1.0 - SURE)
    return float((trust >= limit).mean())


def calibration_error(trust: FloatArray, right: BoolArray) -> float:
    """Return the expected calibration error: mean gap of trust to success over equal bins."""
    bins = np.minimum((trust * _BINS).astype(np.int64), _BINS - 1)
    gap = np.bincount(bins, weights=trust - right, minlength=_BINS)
    return float(np.abs(gap).sum() / len(trust))
