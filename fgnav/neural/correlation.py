"""Correlation of outputs' errors: of overlapping windows, or slow ones.

Of the errors' variance a share s lasts as long as a flight: a constant of the graph, in 1-sigmas,
that all outputs have in common. The rest is taken as a first-order Gauss-Markov process, correlated
by ``rho(t) = 2^(-t / h)`` at t seconds apart; the manifest states both. Outputs are taken no closer
than an interval D, and what is left of the covariance of each, 1 - s of it, is multiplied by

    c = (1 + rho(D)) / (1 - rho(D)).

Of outputs D apart that is the sum of all correlations, so that n of them, taken as independent,
know of a constant what n correlated ones do: n / (c sigma^2), for many. Of any others, and of
states that change, they claim less: by Gershgorin's theorem no eigenvalue of the correlation matrix
exceeds its largest row sum, which is c or less for outputs D apart or more, so that
``C <= c diag(C)`` and the factors' covariance is never smaller than the true one.

A flight's errors may also swing with its motion: then they are correlated at one frequency, which
is another in each flight, and the mean over flights shows nothing of it. What an attitude that
swings alike, too, knows of itself hangs on that frequency. So h is at least such that answers D
apart claim no more at any frequency of a flight than they know there (``half_life_s``).

By default D is two half-lives, c = 5/3: of what all outputs, however dense, know of a constant,
n D ln 2 / (2 h sigma^2), that keeps 2 (1 - 1/4) / ((1 + 1/4) 2 ln 2) = 87 %.
"""

from collections.abc import Sequence
from functools import cache
from typing import TypeAlias

import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph.correlation import HALF_LIVES, apart, inflation

Errors: TypeAlias = tuple[FloatArray, FloatArray]

_MOST_LASTING = 0.99  # some of every error is new: its rounding
_TRIED = 200  # intervals: a few percent apart, interpolated between
_SAME = 1e-6  # of an interval: times are rounded
_UNEVEN = 0.01  # of an interval: beyond, an answer is missing, and a flight has no periodogram
_LEAST_ANSWERS, _STARTS = 8, 8  # of a flight; first answers that are tried
_BEYOND = 40.0  # the largest of 10,000 unit exponentials is above with a probability of 4e-14


def together(
    flights: Sequence[Errors], half_life_s: float, between_s: float, lasting: float = 0.0
) -> float:
    """Return the NEES of 1 of the mean of each flight's answers, as the factor counts them.

    Of n answers ``between_s`` apart or more the mean of normalised errors has the variance
    ``lasting + (1 - lasting) inflation / n``; the mean square of what it errs by, divided by that.
    The first answer is each of the first interval in turn.

    Parameters
    ----------
    flights : sequence of (t_s, error)
        As of ``half_life_s``.
    half_life_s, between_s : float
        0 and the answers' own interval: as if all were independent.
    lasting : float
    """
    squares, weights = [], []
    new = (1 - lasting) * inflation(half_life_s, between_s)
    for t_s, error in flights:
        starts = np.flatnonzero(t_s <= t_s[0] + between_s * (1 - _SAME))
        for start in starts.tolist():
            rows = apart(t_s, between_s, start)
            expected = lasting + new / len(rows)
            squares.append((error[rows].mean(axis=0) ** 2).mean() / expected)
            weights.append(1 / len(starts))
    return float(np.average(squares, weights=weights))


def lasting_share(flights: Sequence[Errors]) -> float:
    """Return the share of the errors' variance that lasts: where the autocovariance levels off.

    The mean product of errors half of a flight's span apart, or more, over the mean square. Flights
    are independent of each other: below twice its standard error over them it is none, as it is of
    a single one.

    Parameters
    ----------
    flights : sequence of (t_s, error)
        As of ``half_life_s``, ten or more.
    """
    if len(flights) < 2:
        return 0.0
    of_flights = []
    for t_s, error in flights:
        far = t_s[None] - t_s[:, None] >= (t_s[-1] - t_s[0]) / 2
        products = (far @ error * error).sum()
        of_flights.append((products / far.sum(), (error**2).sum(axis=1).mean()))
    plateau, variance = np.array(of_flights).T
    share = plateau.mean() / variance.mean()
    spread = (plateau - share * variance).std(ddof=1) / np.sqrt(len(plateau)) / variance.mean()
    return float(share.clip(0.0, _MOST_LASTING)) if share > 2 * spread else 0.0


def half_life_s(
    flights: Sequence[Errors], lasting: float = 0.0, *, axes: int | None = None
) -> float:
    """Return the half-life of errors, less what lasts; 0 where neighbours are independent.

    That with which a flight's answers, ``HALF_LIVES`` of it apart, are as sure as they are right,
    together and at each frequency: the longer of two.

    Together: of n answers D apart the mean's variance is the single one's, times

        q(D) / n,  q(D) = 1 + 2 sum (1 - k/n) rho(k D),  k = 1 … n-1,

    by the autocorrelation of all flights together, and the half-life h is half of the D at which
    q(D) is ``inflation(h, D)``. So errors that have no single half-life, a part of which lasts as
    long as a flight, are counted right over flights as long as these. The autocorrelation ends
    where it is below its own noise, two over the square root of the pairs [1]_.

    At each frequency: the largest ordinate of a flight's periodogram of answers D apart, less their
    mean, is in the mean over the flights at most what it is of independent answers of the variance
    that the factor counts, ``(1 - lasting) inflation``. Of m ordinates in a axes that is the mean
    of the largest of m Gamma variables of shape a [2]_.

    Parameters
    ----------
    flights : sequence of (t_s, error)
        Times, (n,), multiples of an interval apart, and errors, (n, d), normalised by the stated
        1-sigmas.
    lasting : float
        Share of their variance.
    axes : int, optional
        In which there are errors at a time, a: of a direction two of three.

    References
    ----------
    .. [1] Box, Jenkins, Reinsel: Time Series Analysis, 4th edition, 2008, section 2.1.6.
    .. [2] Brockwell, Davis: Time Series: Theory and Methods, 2nd edition, 1991, section 10.3.
    """
    return max(
        _half_life_together_s(flights, lasting), _half_life_swinging_s(flights, lasting, axes)
    )


def _half_life_together_s(flights: Sequence[Errors], lasting: float) -> float:
    """Return the half-life with which means of flights are as sure as they are right."""
    step_s, rho = _autocorrelation(flights, lasting)
    span_s = float(np.mean([t_s[-1] - t_s[0] for t_s, _ in flights]))
    wanted = inflation(1.0, HALF_LIVES)
    nearest = _sum(rho, step_s, span_s, step_s)
    if nearest <= wanted:
        correlation = (nearest - 1) / (nearest + 1)
        return float(step_s * np.log(0.5) / np.log(correlation)) if correlation > 0 else 0.0
    steps = np.geomspace(step_s, span_s, _TRIED)
    sums = np.array([_sum(rho, step_s, span_s, between_s) for between_s in steps])
    above = int(np.flatnonzero(sums > wanted)[-1])  # not the last: of one answer the sum is 1
    return float(
        np.interp(-wanted, -sums[above : above + 2], steps[above : above + 2]) / HALF_LIVES
    )


def _half_life_swinging_s(flights: Sequence[Errors], lasting: float, axes: int | None) -> float:
    """Return the half-life with which no frequency is surer than it is right; 0 of even flights."""
    step_s = _step_s(flights)
    even = [error for t_s, error in flights if np.ptp(np.diff(t_s)) < _UNEVEN * step_s]
    longest = max((len(error) for error in even), default=0) // _LEAST_ANSWERS
    counted = (1 - lasting) * inflation(1.0, HALF_LIVES)
    before, above = 0.0, np.inf
    for every in np.unique(np.geomspace(1, max(longest, 1), _TRIED).astype(np.int64)).tolist():
        long = [
            series_error for series_error in even if len(series_error) >= every * _LEAST_ANSWERS
        ]
        largest = [
            _largest(series_error, every, axes or series_error.shape[1]) for series_error in long
        ]
        ratio = float(np.mean(largest)) / counted if long else 0.0
        if ratio <= 1:
            if every == 1:
                return 0.0
            return float(np.interp(-1, (-above, -ratio), (before, every)) * step_s / HALF_LIVES)
        before, above = float(every), ratio
    return before * step_s / HALF_LIVES


def _largest(error: FloatArray, every: int, axes: int) -> float:
    """Return the largest ordinate of answers so many apart over that of independent unit ones.

    The mean over where the first of them is.
    """
    ratios = []
    for first in range(0, every, -(-every // _STARTS)):
        answers = error[first::every] - error[first::every].mean(axis=0)
        ordinates = (np.abs(np.fft.rfft(answers, axis=0)) ** 2).mean(axis=1) / len(answers)
        ordinates = ordinates[1 : (len(answers) + 1) // 2]  # less the mean's and Nyquist's
        ratios.append(ordinates.max() / _largest_of_independent(len(ordinates), axes))
    return float(np.mean(ratios))


@cache
def _largest_of_independent(m: int, d: int) -> float:
    """Return the mean of the largest of m means of d unit exponential variables."""
    from scipy.special import gammainc  # noqa: PLC0415  # heavy, and of training only

    x = np.linspace(0.0, _BEYOND, 10_001)
    return float(np.trapezoid(1 - gammainc(d, d * x) ** m, x))


def _sum(rho: FloatArray, step_s: float, span_s: float, between_s: float) -> float:
    """Return q of answers so far apart over a span, the mean over where the first may be."""
    fewer, share = divmod((span_s + step_s) / between_s * (1 + 1e-9), 1.0)
    total = 0.0
    for n, weight in ((int(fewer), 1 - share), (int(fewer) + 1, share)):
        k = np.arange(1, n)
        at = np.interp(k * between_s, step_s * np.arange(len(rho)), rho, right=0.0)
        total += weight * (1 + 2 * ((1 - k / max(n, 1)) * at).sum())
    return float(total)


def _autocorrelation(flights: Sequence[Errors], lasting: float) -> tuple[float, FloatArray]:
    """Return the interval and the autocorrelation of what is new, up to where it is noise."""
    step_s = _step_s(flights)
    series = [np.rint((t_s - t_s[0]) / step_s).astype(np.int64) for t_s, _ in flights]
    n = max(int(indices[-1]) for indices in series) + 1
    size = 1 << (2 * n - 1).bit_length()
    products, pairs = np.zeros(n), np.zeros(n)
    for indices, (_, error) in zip(series, flights, strict=True):
        present, errors = np.zeros(size), np.zeros((size, error.shape[1]))
        present[indices], errors[indices] = 1.0, error
        pairs += _correlated(present[:, None], n)
        products += _correlated(errors, n) / error.shape[1]
    rho = products / np.maximum(pairs, 1.0) / (products[0] / pairs[0])
    rho = (rho - lasting) / (1 - lasting)
    noise = np.flatnonzero(rho < 2 / np.sqrt(np.maximum(pairs, 1.0)))
    return step_s, rho[: int(noise[0])] if len(noise) else rho


def _step_s(flights: Sequence[Errors]) -> float:
    return float(np.median(np.concatenate([np.diff(t_s) for t_s, _ in flights])))


def _correlated(signals: FloatArray, n: int) -> FloatArray:
    """Return the sum of products n lags apart, (n,), of padded signals, (size, d)."""
    spectrum = np.abs(np.fft.rfft(signals, axis=0)) ** 2
    return np.asarray(np.fft.irfft(spectrum, len(signals), axis=0)[:n].sum(axis=1))
