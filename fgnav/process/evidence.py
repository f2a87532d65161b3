"""The rate prior of a flight without a gyroscope, identified from its attitudes.

Length scale and variances of the Matern process are those with the greatest marginal likelihood:
the product of the densities of each attitude given those before it (a Kalman filter's innovations).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from fgnav.checks import BadInputError, FloatArray, IntArray, freeze, increasing, positive
from fgnav.process.attitude_series import AttitudeSeries, attitude_series, turn_rates
from fgnav.process.evidence_kernel import UPDATE

# Before anything is identified. Standard deviations of measured rates about their means, rad/s: two
# quadrotor paths .08-.78, correlated over .1-.3 s; a car .03-.16 over seconds (Hurwitz and Klein,
# arXiv 2310.13452; i2Nav car data). Whoever turns faster, about a steady axis, has it in the mean.
DEFAULT_LENGTH_S = 0.5
DEFAULT_SIGMA_RADPS = 1.0
# 1-sigma of the logarithm of length scales about the default's: 95 % of .03 to 9 s.
_LOG_LENGTH_SIGMA = 1.5
_FEWEST = 5  # attitudes: four turns, for four hyperparameters
_MOST, _BLOCK = 600, 60  # of a longer flight, blocks spread evenly
# The longest memory worth telling from a constant rate; the shortest that the numerics are for.
LONGEST_S, SHORTEST_S = 60.0, 0.05
# Earth's rate, which the model leaves out, and the range of common MEMS gyroscopes, 2000 deg/s.
LEAST_RADPS, MOST_RADPS = 7.3e-5, 35.0
# Searches start with rates too large and memories too short: towards too little motion the filter
# loses the attitudes and the likelihood has no slope.
_STARTS_SPACINGS = (1.0, 3.0, 10.0, 30.0)
_STEP = 1e-4  # of log hyperparameters, for differences
_TOLERANCE_NATS, _USUAL_NATS = 0.02, 1e4
_MOST_GRADIENTS, _LINE_SEARCH = 20, 8  # of five likelihoods each
# Of scores, per attitude: half is forgotten in 14, so one wrong attitude does not decide. Usual are
# .95 to .99 [2 of causal_rate_priors]; RMSE of a rocket and a tumble differ by 2 % from .9 to .99.
_FORGETTING = 0.95
_CHECKED, _RECENT = 100, 200  # attitudes; default rates cost a third of accuracy, so not for long
_SCHEDULE = (10, 20, 40, 80, 160, 320, 600)  # counts of attitudes; then each 600 more


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class RatePrior:
    """The Matern-5/2 prior of a body rate about its mean.

    Attributes
    ----------
    length_s : float
        Length scale l, of all axes.
    variance_rad2ps2 : ndarray, shape (3,)
        About the body axes.
    evidence : float
        Log marginal likelihood of the attitudes it was identified from, nats.
    """

    length_s: float
    variance_rad2ps2: FloatArray
    evidence: float

    def __post_init__(self) -> None:
        """Check and freeze the variances."""
        positive("rate prior length_s", self.length_s)
        freeze("rate prior", self, {"variance_rad2ps2": (3,)})


def rate_prior(
    t_s: FloatArray,
    R_nb: FloatArray,
    covariance_rad2: FloatArray,
    *,
    start: RatePrior | None = None,
) -> RatePrior:
    """Return the rate prior under which attitudes are most likely.

    The rate is that against ``n``; it may be about inertial space as well: Earth's rate is a part
    of the mean. What attitudes do not tell is as by default: each standard deviation has the prior
    density of a gamma distribution of shape 2 with its mode at ``DEFAULT_SIGMA_RADPS``, which keeps
    it off zero where the likelihood is flat towards it [1]_ and finite about an axis that no
    attitude tells; the length scale has a log-normal one about ``DEFAULT_LENGTH_S``. Wrong
    attitudes are told from motion by a mixture; see ``evidence_kernel``. Of more than 600, blocks
    spread over the flight are looked at.

    Parameters
    ----------
    t_s : ndarray, shape (n,)
        Strictly increasing.
    R_nb : ndarray, shape (n, 3, 3)
        Attitudes of single epochs, their errors independent. A body turns less than half a turn
        between two.
    covariance_rad2 : ndarray, shape (n, 3, 3)
        Of their errors, body axes; ``pi^2 / 3`` about an axis that is not observed.
    start : RatePrior, optional
        Where the search starts as well.

    Raises
    ------
    BadInputError
        If there are fewer than five attitudes, or times do not increase.

    References
    ----------
    .. [1] Chung, Rabe-Hesketh, Dorie, Gelman and Liu, A nondegenerate penalized likelihood
       estimator for variance parameters in multilevel models, Psychometrika 78, 2013.
    """
    if len(t_s) < _FEWEST:
        raise BadInputError(
            f"attitudes: {len(t_s)} are too few to identify the motion, {_FEWEST} are needed; "
            "state the rate prior"
        )
    increasing("attitudes t_s", t_s)
    n = len(t_s)
    attitudes = attitude_series(t_s, R_nb, covariance_rad2, _spread(n), past=n)
    spacing_s = float(np.median(np.diff(t_s)))
    lower = np.log([min(max(spacing_s, SHORTEST_S), LONGEST_S / 2), *[LEAST_RADPS] * 3])
    upper = np.log([LONGEST_S, *[MOST_RADPS] * 3])
    candidates = [np.clip(x, lower, upper) for x in _starts(attitudes, spacing_s, start)]
    scores = [_score(attitudes, x) for x in candidates]
    search = minimize(
        lambda x: _descent(attitudes, x),
        candidates[int(np.argmax(scores))],
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
    x = np.clip(search.x, lower, upper)
    return RatePrior(
        length_s=float(np.exp(x[0])),
        variance_rad2ps2=np.exp(2 * x[1:]),
        evidence=_log_likelihood(attitudes, x),
    )


def causal_rate_priors(
    t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return length scale, (n - 1,), and variance, (n - 1, 3), for each interval from its past.

    The prior of interval k to k + 1 depends on attitudes up to k alone. One is identified when 10,
    20, 40, 80, 160, 320, 600 have come and after each 600 more, from the latest 600 of them;
    before, it is the default. A body may start to move otherwise than it did until then: beside the
    identified prior stand the default and what is half-way between them in the logarithms, and the
    prior of an interval is that under which the latest attitudes were most likely (dynamic model
    selection, [1]_, [2]_: the score of each is ``score = 0.95 score + log density``). Where the
    identified one is not the best for most of 100 attitudes, another is identified from the latest
    200. Nothing before a time changes when the attitudes after it are cut off.

    Parameters
    ----------
    t_s, R_nb, covariance_rad2 : ndarray, shape (n,), (n, 3, 3), (n, 3, 3)
        As in ``rate_prior``.

    References
    ----------
    .. [1] Raftery, Karny and Ettler, Online prediction under model uncertainty via dynamic model
       averaging, Technometrics 52, 2010.
    .. [2] Koop and Korobilis, Forecasting inflation using dynamic model averaging, International
       Economic Review 53, 2012.
    """
    n = len(t_s)
    length_s = np.full(max(n - 1, 0), DEFAULT_LENGTH_S)
    variance = np.full((max(n - 1, 0), 3), DEFAULT_SIGMA_RADPS**2)
    prior, count, latest = None, _SCHEDULE[0], _MOST
    while count < n:
        following = _scheduled_after(count)
        rows = slice(max(0, count - _MOST), min(following, n - 1))  # n - 1 leads nowhere
        part = (t_s[rows], R_nb[rows], covariance_rad2[rows])
        past = count - rows.start
        recent = slice(max(0, past - latest), past)
        prior = rate_prior(*(values[recent] for values in part), start=prior)
        alternatives = _alternatives(prior)
        attitudes = attitude_series(*part, np.arange(len(part[0])), past)
        chosen = _best_of(alternatives, attitudes)[past - 1 :]
        length_s[count - 1 : rows.stop] = np.array([x[0] for x in alternatives])[chosen]
        variance[count - 1 : rows.stop] = np.array([x[1] for x in alternatives])[chosen]
        changed = _changed_after(chosen[1:])
        latest = _MOST if changed is None else _RECENT
        count = following if changed is None else count + changed
    return length_s, variance


def _scheduled_after(count: int) -> int:
    """Return the count of attitudes at which the prior is identified next, whatever happens."""
    if count >= _MOST:
        return (count // _MOST + 1) * _MOST
    return next(scheduled for scheduled in _SCHEDULE if scheduled > count)


def _changed_after(chosen: IntArray) -> int | None:
    """Return after how many attitudes, (n,), the identified prior has lost; None: it has not."""
    lost = chosen[: len(chosen) // _CHECKED * _CHECKED].reshape(-1, _CHECKED) != 0
    blocks = np.flatnonzero(lost.mean(axis=1) > 0.5)
    return int(_CHECKED * (blocks[0] + 1)) if len(blocks) else None


def _alternatives(prior: RatePrior) -> list[tuple[float, FloatArray]]:
    """Return length scales and variances, (3,): the identified ones, half-way, the default."""
    default = np.full(3, DEFAULT_SIGMA_RADPS**2)
    between = np.sqrt(prior.variance_rad2ps2 * default)
    return [
        (prior.length_s, np.array(prior.variance_rad2ps2)),
        (float(np.sqrt(prior.length_s * DEFAULT_LENGTH_S)), between),
        (DEFAULT_LENGTH_S, default),
    ]


def _best_of(alternatives: list[tuple[float, FloatArray]], attitudes: AttitudeSeries) -> IntArray:
    """Return which prior has the greatest score by each of n attitudes and those before, (n,)."""
    scores = np.stack([attitudes.log_densities(*prior) for prior in alternatives], axis=1)
    for k in range(1, len(scores)):
        scores[k] += _FORGETTING * scores[k - 1]
    return np.asarray(np.argmax(scores, axis=1))


def _spread(n: int) -> IntArray:
    """Return which of n attitudes to look at: all, or blocks of them."""
    if n <= _MOST:
        return np.arange(n)
    starts = np.linspace(0, n - _BLOCK, _MOST // _BLOCK).astype(np.int64)
    return np.unique(starts[:, None] + np.arange(_BLOCK))


def _starts(
    attitudes: AttitudeSeries, spacing_s: float, start: RatePrior | None
) -> list[FloatArray]:
    """Return candidates (log length, log standard deviations) where the search may start."""
    epochs = attitudes.epochs
    rates = turn_rates(epochs.t_s, epochs.R_nb)[epochs.use[1:] == UPDATE]
    deviations = np.abs(rates - np.median(rates, axis=0))
    least = 10 * LEAST_RADPS
    usual = np.maximum(1.5 * np.median(deviations, axis=0), least)  # of a normal one: 1.48
    overall = np.maximum(np.sqrt((deviations**2).mean(axis=0)), least)  # of bursts, or wrong ones
    large = np.maximum(usual, DEFAULT_SIGMA_RADPS)
    pairs = [(n * spacing_s, s) for n in _STARTS_SPACINGS for s in (usual, overall, large)]
    if start is not None:
        pairs.append((start.length_s, np.sqrt(start.variance_rad2ps2)))
    return [np.log([length_s, *sigma]) for length_s, sigma in pairs]


def _descent(attitudes: AttitudeSeries, x: FloatArray) -> tuple[float, FloatArray]:
    """Return minus the score and its gradient, (4,), by differences."""
    value = -_score(attitudes, x)
    ahead = np.array([-_score(attitudes, x + _STEP * axis) for axis in np.eye(len(x))])
    return value, (ahead - value) / _STEP


def log_prior(x: FloatArray) -> float:
    """Return the log prior of (log length, log standard deviations), (4,); see ``rate_prior``."""
    gamma = x[1:] - np.exp(x[1:]) / DEFAULT_SIGMA_RADPS
    normal = (x[0] - np.log(DEFAULT_LENGTH_S)) / _LOG_LENGTH_SIGMA
    return float(gamma.sum() - normal**2 / 2)


def _score(attitudes: AttitudeSeries, x: FloatArray) -> float:
    """Return the log posterior of (log length, log standard deviations), (4,)."""
    return _log_likelihood(attitudes, x) + log_prior(x)


def _log_likelihood(attitudes: AttitudeSeries, x: FloatArray) -> float:
    return float(attitudes.log_densities(float(np.exp(x[0])), np.exp(2 * x[1:])).sum())
