"""The rate prior of a flight without a gyroscope, identified from its attitudes.

Poles and variances of its process have the greatest posterior density: the product of the
densities of each attitude given those before it (a Kalman filter's innovations) and their prior.
"""

from collections.abc import Callable

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray, increasing
from fgnav.process import matern
from fgnav.process.attitude_series import MOST, AttitudeSeries, attitude_series, spread
from fgnav.process.evidence_kernel import tape
from fgnav.process.hyperparameters import (
    DEFAULT_LENGTH_S,
    DEFAULT_SIGMA_RADPS,
    LEAST_RADPS,
    LONGEST_S,
    SHORTEST_S,
    RatePrior,
    climbed,
)
from fgnav.process.posterior import (
    SIGMA,
    bounds,
    hyperparameters,
    log_posterior,
    log_prior,
    poles,
    prior_of,
)

_FEWEST = 5  # attitudes: four turns about each axis; what they do not tell the prior does
# Searches start with rates too large and memories too short: towards too little motion the filter
# loses the attitudes and the likelihood has no slope.
_STARTS_SPACINGS = (1.0, 3.0, 10.0, 30.0)
_FREQUENCIES = 5  # from one swing in the record to one in two attitudes
# Third pole over the pair's magnitude, and damping ratio: noise that drives a swing, a swing about
# a rate that wanders, one that goes on for many periods.
_SWINGS = ((3.0, 0.3), (0.3, 0.05), (3.0, 0.02))
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
    swings: bool = True,
) -> RatePrior:
    """Return the rate prior under which attitudes are most likely.

    The rate is that against ``n``; it may be about inertial space as well: Earth's rate is a part
    of the mean. What attitudes do not tell is as by default; see ``posterior``. Wrong attitudes are
    told from motion by a mixture; see ``evidence_kernel``. Of more than 600, blocks spread over the
    flight are looked at.

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
    swings : bool
        Whether poles may differ; else it is Matern 5/2. Never where an axis is not observed: a body
        may turn about it such that the others seem to swing.

    Raises
    ------
    BadInputError
        If there are fewer than five attitudes, or times do not increase.
    """
    n = len(t_s)
    if n < _FEWEST:
        raise BadInputError(
            f"attitudes: {n} are too few to identify the motion, {_FEWEST} are needed; "
            "state the rate prior"
        )
    increasing("attitudes t_s", t_s)
    attitudes = attitude_series(t_s, R_nb, covariance_rad2, spread(n), past=n)
    swings = swings and not attitudes.epochs.open_axis.any()
    spacing_s = float(np.median(np.diff(t_s)))
    limits = bounds(min(max(spacing_s, SHORTEST_S), LONGEST_S / 2), swings=swings)
    room = tape(len(attitudes.epochs.t_s))

    memory_s = min(attitudes.record_s, LONGEST_S)

    def value(x: FloatArray) -> float:
        return _log_likelihood(attitudes, x) + log_prior(x, memory_s)[0]

    starts = [max((np.clip(x, *limits) for x in _starts(attitudes, spacing_s)), key=value)]
    if swings:
        starts.append(_swung(attitudes, starts[0], value, limits))
    if start is not None:
        starts.append(np.clip(hyperparameters(start), *limits))
    ends = [
        climbed(lambda x: log_posterior(attitudes, x, room, memory_s), x, *limits) for x in starts
    ]
    best = max(ends, key=value)
    return prior_of(best, _log_likelihood(attitudes, best))


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
    of_intervals = np.tile(matern.poles(DEFAULT_LENGTH_S), (max(n - 1, 0), 3, 1))
    variance = np.full((max(n - 1, 0), 3), DEFAULT_SIGMA_RADPS**2)
    prior, count, latest = None, _SCHEDULE[0], MOST
    while count < n:
        following = _scheduled_after(count)
        rows = slice(max(0, count - MOST), min(following, n - 1))  # n - 1 leads nowhere
        series = (t_s[rows], R_nb[rows], covariance_rad2[rows])
        past = count - rows.start
        recent = slice(max(0, past - latest), past)
        prior = rate_prior(*(values[recent] for values in series), start=prior, swings=swings)
        alternatives = _alternatives(prior)
        attitudes = attitude_series(*series, np.arange(len(series[0])), past)
        chosen = _best_of(alternatives, attitudes)[past - 1 :]
        of_intervals[count - 1 : rows.stop] = np.array([x[0] for x in alternatives])[chosen]
        variance[count - 1 : rows.stop] = np.array([x[1] for x in alternatives])[chosen]
        changed = _changed_after(chosen[1:])
        latest = MOST if changed is None else _RECENT
        count = following if changed is None else count + changed
    return of_intervals, variance


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
    """Find the prior with the greatest score up to each of n attitudes, (n,)."""
    scores = np.stack([attitudes.log_densities(*prior) for prior in alternatives], axis=1)
    for k in range(1, len(scores)):
        scores[k] += _FORGETTING * scores[k - 1]
    return np.asarray(np.argmax(scores, axis=1))


def _starts(attitudes: AttitudeSeries, spacing_s: float) -> list[FloatArray]:
    """Return candidates of Matern 5/2, (12,) each, where the search may start."""
    usual, overall = (
        turn_deviation.clip(10 * LEAST_RADPS) for turn_deviation in attitudes.turn_deviations()
    )
    large = np.maximum(usual, DEFAULT_SIGMA_RADPS)
    return [
        np.concatenate([np.full(3, np.log(n * spacing_s)), np.zeros(6), np.log(sigma)])
        for n in _STARTS_SPACINGS
        for sigma in (usual, overall, large)
    ]


def _swung(
    attitudes: AttitudeSeries,
    start: FloatArray,
    value: Callable[[FloatArray], float],
    limits: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """Return a start that swings about each axis about which one is likelier, (12,)."""
    span_s = attitudes.epochs.t_s[-1] - attitudes.epochs.t_s[0]
    slowest, fastest = 2 * np.pi / span_s, np.pi / np.median(np.diff(attitudes.epochs.t_s))
    usual, overall = (
        np.log(turn_deviation.clip(LEAST_RADPS)) for turn_deviation in attitudes.turn_deviations()
    )
    best = start
    for axis in range(3):
        candidates = [best]
        for w in np.geomspace(slowest, fastest, _FREQUENCIES + 2)[1:-1]:
            for third, damping in _SWINGS:
                ratio = 1 / third
                length = np.log(np.sqrt(5.0) / w) + np.log(ratio) / 3
                for sigma in (usual[axis], overall[axis]):
                    x = best.copy()
                    x[axis::3] = length, np.log(ratio), -np.log(damping), sigma
                    candidates.append(np.clip(x, *limits))
        best = max(candidates, key=value)
    return best


def _log_likelihood(attitudes: AttitudeSeries, x: FloatArray) -> float:
    return float(attitudes.log_densities(poles(x), np.exp(2 * x[SIGMA])).sum())
