"""The rate prior of a flight without a gyroscope, identified from its attitudes.

Length scale and variances of the Matern process are those with the greatest marginal likelihood:
the product of the densities of each attitude given those before it (a Kalman filter's innovations).
"""

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray, increasing
from fgnav.process import matern
from fgnav.process.attitude_series import MOST, AttitudeSeries, attitude_series, spread
from fgnav.process.hyperparameters import (
    DEFAULT_LENGTH_S,
    DEFAULT_SIGMA_RADPS,
    LEAST_RADPS,
    LONGEST_S,
    SHORTEST_S,
    RatePrior,
    bounds,
    likeliest,
    log_prior,
)
from fgnav.process.oscillation import swinging

_FEWEST = 5  # attitudes: four turns, each of three hyperparameters
# Searches start with rates too large and memories too short: towards too little motion the filter
# loses the attitudes and the likelihood has no slope.
_STARTS_SPACINGS = (1.0, 3.0, 10.0, 30.0)
# Of scores, per attitude: half is forgotten in 14, so one wrong attitude does not decide. Usual are
# .95 to .99 [2 of causal_rate_priors]; RMSE of a rocket and a tumble differ by 2 % from .9 to .99.
_FORGETTING = 0.95
_CHECKED, _RECENT = 100, 200  # attitudes; default rates cost a third of accuracy, so not for long
_SCHEDULE = (10, 20, 40, 80, 160, 320, 600)  # counts of attitudes; then each 600 more


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

    Matern 5/2, or of a rate that swings where attitudes ask for it; see ``oscillation``.

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
    still = matern_prior(t_s, R_nb, covariance_rad2, start=start)
    return swinging_prior(t_s, R_nb, covariance_rad2, still, start=start) or still


def matern_prior(
    t_s: FloatArray,
    R_nb: FloatArray,
    covariance_rad2: FloatArray,
    *,
    start: RatePrior | None = None,
) -> RatePrior:
    """Return the Matern prior under which attitudes are most likely; see ``rate_prior``."""
    if len(t_s) < _FEWEST:
        raise BadInputError(
            f"attitudes: {len(t_s)} are too few to identify the motion, {_FEWEST} are needed; "
            "state the rate prior"
        )
    increasing("attitudes t_s", t_s)
    attitudes = _series(t_s, R_nb, covariance_rad2)
    spacing_s = float(np.median(np.diff(t_s)))
    lower, upper = bounds(min(max(spacing_s, SHORTEST_S), LONGEST_S / 2))
    candidates = [np.clip(x, lower, upper) for x in _starts(attitudes, spacing_s, start)]
    scores = [_score(attitudes, x) for x in candidates]
    begin = candidates[int(np.argmax(scores))]
    x = likeliest(lambda x: _score(attitudes, x), begin, lower, upper)
    return RatePrior(
        length_s=np.exp(x[:3]),
        variance_rad2ps2=np.exp(2 * x[3:]),
        evidence=_log_likelihood(attitudes, x),
    )


def swinging_prior(
    t_s: FloatArray,
    R_nb: FloatArray,
    covariance_rad2: FloatArray,
    still: RatePrior,
    *,
    start: RatePrior | None = None,
) -> RatePrior | None:
    """Return the prior of a rate that swings; None where the likeliest Matern one will do."""
    return swinging(_series(t_s, R_nb, covariance_rad2), still, start)


def _series(t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray) -> AttitudeSeries:
    """Return the attitudes that are looked at."""
    n = len(t_s)
    return attitude_series(t_s, R_nb, covariance_rad2, spread(n), past=n)


def causal_rate_priors(
    t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray, *, swings: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Return poles, (n - 1, 3, 3), and variances, (n - 1, 3), for each interval from its past.

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
    swings : bool
        Whether the rate may swing.

    References
    ----------
    .. [1] Raftery, Karny and Ettler, Online prediction under model uncertainty via dynamic model
       averaging, Technometrics 52, 2010.
    .. [2] Koop and Korobilis, Forecasting inflation using dynamic model averaging, International
       Economic Review 53, 2012.
    """
    n = len(t_s)
    poles = np.tile(matern.poles(DEFAULT_LENGTH_S), (max(n - 1, 0), 3, 1))
    variance = np.full((max(n - 1, 0), 3), DEFAULT_SIGMA_RADPS**2)
    prior, count, latest = None, _SCHEDULE[0], MOST
    while count < n:
        following = _scheduled_after(count)
        rows = slice(max(0, count - MOST), min(following, n - 1))  # n - 1 leads nowhere
        part = (t_s[rows], R_nb[rows], covariance_rad2[rows])
        past = count - rows.start
        recent = slice(max(0, past - latest), past)
        identified = rate_prior if swings else matern_prior
        prior = identified(*(values[recent] for values in part), start=prior)
        alternatives = _alternatives(prior)
        attitudes = attitude_series(*part, np.arange(len(part[0])), past)
        chosen = _best_of(alternatives, attitudes)[past - 1 :]
        poles[count - 1 : rows.stop] = np.array([x[0] for x in alternatives])[chosen]
        variance[count - 1 : rows.stop] = np.array([x[1] for x in alternatives])[chosen]
        changed = _changed_after(chosen[1:])
        latest = MOST if changed is None else _RECENT
        count = following if changed is None else count + changed
    return poles, variance


def _scheduled_after(count: int) -> int:
    """Return the count of attitudes at which the prior is identified next, whatever happens."""
    if count >= MOST:
        return (count // MOST + 1) * MOST
    return next(scheduled for scheduled in _SCHEDULE if scheduled > count)


def _changed_after(chosen: IntArray) -> int | None:
    """Return after how many attitudes, (n,), the identified prior has lost; None: it has not."""
    lost = chosen[: len(chosen) // _CHECKED * _CHECKED].reshape(-1, _CHECKED) != 0
    blocks = np.flatnonzero(lost.mean(axis=1) > 0.5)
    return int(_CHECKED * (blocks[0] + 1)) if len(blocks) else None


def _alternatives(prior: RatePrior) -> list[tuple[FloatArray, FloatArray]]:
    """Return poles, (3, 3), and variances, (3,): the identified ones, half-way, the default.

    Half-way nothing swings any more.
    """
    default = np.full(3, DEFAULT_SIGMA_RADPS**2)
    between = np.sqrt(prior.variance_rad2ps2 * default)
    return [
        (prior.poles_per_s, np.array(prior.variance_rad2ps2)),
        (matern.poles(np.sqrt(prior.length_s * DEFAULT_LENGTH_S)), between),
        (matern.poles(np.full(3, DEFAULT_LENGTH_S)), default),
    ]


def _best_of(
    alternatives: list[tuple[FloatArray, FloatArray]], attitudes: AttitudeSeries
) -> IntArray:
    """Return which prior has the greatest score by each of n attitudes and those before, (n,)."""
    scores = np.stack([attitudes.log_densities(*prior) for prior in alternatives], axis=1)
    for k in range(1, len(scores)):
        scores[k] += _FORGETTING * scores[k - 1]
    return np.asarray(np.argmax(scores, axis=1))


def _starts(
    attitudes: AttitudeSeries, spacing_s: float, start: RatePrior | None
) -> list[FloatArray]:
    """Return candidates (log lengths, log standard deviations) where the search may start."""
    usual, overall = (one.clip(10 * LEAST_RADPS) for one in attitudes.turn_deviations())
    large = np.maximum(usual, DEFAULT_SIGMA_RADPS)
    lengths = [np.full(3, n * spacing_s) for n in _STARTS_SPACINGS]
    pairs = [(length_s, sigma) for length_s in lengths for sigma in (usual, overall, large)]
    if start is not None:
        pairs.append((np.array(start.length_s), np.sqrt(start.variance_rad2ps2)))
    return [np.log(np.concatenate(pair)) for pair in pairs]


def _score(attitudes: AttitudeSeries, x: FloatArray) -> float:
    """Return the log posterior of (log lengths, log standard deviations), (6,)."""
    return _log_likelihood(attitudes, x) + log_prior(x[:3], x[3:])


def _log_likelihood(attitudes: AttitudeSeries, x: FloatArray) -> float:
    return float(attitudes.log_densities(matern.poles(np.exp(x[:3])), np.exp(2 * x[3:])).sum())
