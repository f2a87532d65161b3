"""A rate that swings: two poles of its prior leave the third where the evidence asks for it.

A body on a spring, be it of air, turns back and forth at a frequency of its own; Matern 5/2 knows
of none and lets go of it within its length. The pair's decay and frequency are identified like the
length, and believed where attitudes are likelier by them than Schwarz's criterion [1]_ asks of two
parameters more, very strongly.

References
----------
.. [1] Schwarz, Estimating the dimension of a model, Annals of Statistics 6, 1978.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.process.attitude_series import AttitudeSeries
from fgnav.process.evidence_kernel import UPDATE
from fgnav.process.hyperparameters import (
    LEAST_RADPS,
    LONGEST_S,
    MOST_RADPS,
    SHORTEST_S,
    VERY_STRONG_NATS,
    RatePrior,
    likeliest,
    log_prior,
)

_FREQUENCIES = 5  # where searches may start, from one swing in the record to one in two attitudes
# Decays of the third pole and of the pair, over the frequency: noise that drives a swing, a swing
# about a rate that wanders, one that goes on for many periods.
_DECAYS = ((3.0, 0.3), (0.3, 0.05), (3.0, 0.02))


def swinging(
    attitudes: AttitudeSeries, still: RatePrior, start: RatePrior | None = None
) -> RatePrior | None:
    """Return the likeliest prior of a rate that swings; None where one that does not will do.

    Before attitudes are seen the third pole is as likely as that of Matern 5/2; of the others all
    orders of magnitude are alike, from those of the longest memory and one swing in the record to
    those of the shortest and one in two attitudes.

    Parameters
    ----------
    attitudes : AttitudeSeries
    still : RatePrior
        The likeliest Matern prior of them.
    start : RatePrior, optional
        Where the search may start as well.
    """
    epochs = attitudes.epochs
    span_s, n = float(epochs.t_s[-1] - epochs.t_s[0]), int((epochs.use[1:] == UPDATE).sum())
    slowest, fastest = 2 * np.pi / span_s, np.pi / float(np.median(np.diff(epochs.t_s)))
    # About an axis that attitudes do not tell a body may turn such that the others seem to swing.
    if slowest >= fastest or epochs.open_axis.any():
        return None
    decays = np.sqrt(5.0) / np.array([LONGEST_S, SHORTEST_S])
    lower = np.log([decays[0], decays[0], slowest, *[LEAST_RADPS] * 3])
    upper = np.log([decays[1], decays[1], fastest, *[MOST_RADPS] * 3])

    def log_likelihood(x: FloatArray) -> float:
        return float(attitudes.log_densities(np.exp(x[:3]), np.exp(2 * x[3:])).sum())

    def score(x: FloatArray) -> float:
        return log_likelihood(x) + log_prior(np.log(np.sqrt(5.0)) - x[:1], x[3:])

    usual, overall = (one.clip(LEAST_RADPS) for one in attitudes.turn_deviations())
    candidates = [
        np.log([third * w, decay * w, w, *sigma])
        for w in np.geomspace(slowest, fastest, _FREQUENCIES + 2)[1:-1]
        for third, decay in _DECAYS
        for sigma in (0.3 * usual, usual, overall)
    ]
    if start is not None and start.swing_per_s is not None:
        candidates.append(np.log([*start.poles_per_s[0], *np.sqrt(start.variance_rad2ps2)]))
    begin = max((np.clip(x, lower, upper) for x in candidates), key=score)
    x = likeliest(score, begin, lower, upper)
    evidence, poles = log_likelihood(x), np.exp(x[:3])
    if evidence - still.evidence < VERY_STRONG_NATS + np.log(n):
        return None
    return RatePrior(
        length_s=float(np.sqrt(5.0) / poles[0]),
        variance_rad2ps2=np.exp(2 * x[3:]),
        evidence=evidence,
        swing_per_s=(float(poles[1]), float(poles[2])),
    )
