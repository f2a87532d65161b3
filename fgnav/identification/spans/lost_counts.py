"""How many samples of a record were lost in each of m intervals, by a linear problem's word.

With score s and information N of the losses n, whole numbers and none negative,

    ln p(n) = s'n - n'N n / 2 - ln(m^S prod(n_k!) / S!)        S = sum(n)

the last term the probability of S losses in m intervals, in any order. The likeliest are sought by
single losses that come, go or move, as long as ln p rises; mean and covariance of all are those of
a Markov chain of such changes at the rates sqrt(p(n') / p(n)), which stays at n in proportion to
p(n) [1]_.

References
----------
.. [1] Power, Goldman: Accelerated sampling on discrete spaces with non-reversible Markov processes,
   arXiv:1912.04681, 2019: locally balanced rates in continuous time, after Zanella, Journal of the
   American Statistical Association 115, 2020.
"""

import numpy as np
from scipy.special import gammaln, logsumexp

from fgnav.checks import FloatArray, IntArray

_STEPS = 1000  # to the likeliest, and _JUMPS: bounds of cost
_JUMPS = 2000  # from one n to another
Information = tuple[FloatArray, FloatArray]  # s, (m,), and N, (m, m), about some n


def likeliest_counts(
    information: Information, before: IntArray, most: FloatArray
) -> tuple[IntArray, float]:
    """Return the likeliest losses, (m,), and the nats against so many at any time.

    Each counts at all places that are as likely. None is in the first interval: that would be a
    clock that is off all along.

    Parameters
    ----------
    information : tuple of ndarray
        About ``before``, (m,).
    before : ndarray of int, shape (m,)
    most : ndarray, shape (m,)
        That may be lost.
    """
    (g, N), m, counts = information, len(before), before
    most = np.append(0.0, most[1:])
    for _ in range(_STEPS):
        gains, of = _gains(g, N, counts, most)
        best = int(gains.argmax())
        if gains.flat[best] <= 0.0:
            break
        counts, g = _changed(counts, g, N, (int(of[best // (m + 1)]), best % (m + 1)))
    gains, of = _gains(g, N, counts, most)
    total, lost = counts.sum(), counts[of[:-1]]
    orders = gammaln(total + 1) - gammaln(counts + 1).sum()
    places = lost @ np.logaddexp(0.0, logsumexp(gains[:-1, :-1], axis=1))
    return counts, float(total * np.log(m) - orders - places)


def moments_of_counts(
    information: Information, counts: IntArray, most: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return mean, (m,), and covariance, (m, m), of losses.

    Parameters as in ``likeliest_counts``; ``counts``, near the likeliest: where the chain begins;
    ``rng``: of its jumps.
    """
    (g, N), m = information, len(counts)
    visited, log_stay = np.empty((_JUMPS, m)), np.empty(_JUMPS)
    for i in range(_JUMPS):
        visited[i] = counts
        gains, of = _gains(g, N, counts, most)
        best = gains.max()
        rates = np.exp((gains - best) / 2).cumsum()
        log_stay[i] = -best / 2 - np.log(rates[-1])
        to = int(np.searchsorted(rates, rng.random() * rates[-1]))
        counts, g = _changed(counts, g, N, (int(of[to // (m + 1)]), to % (m + 1)))
    share = np.exp(log_stay - logsumexp(log_stay))
    off = visited - share @ visited
    return share @ visited, (share[:, None] * off).T @ off


def _gains(
    g: FloatArray, N: FloatArray, counts: IntArray, most: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Return by how much ln p rises with a loss from one interval to another, (r + 1, m + 1).

    From each of r with losses, and, the last, from none; to each, and, the last, to none. And which
    these r are, (r + 1,), m the last.
    """
    m, total, cost = len(g), counts.sum(), N.diagonal() / 2
    of = np.flatnonzero(counts)
    gains = np.empty((len(of) + 1, m + 1))
    fewer, more = np.log(counts[of]) - g[of] - cost[of], g - cost - np.log(counts + 1)
    gains[:-1, :-1] = fewer[:, None] + more + N[of]
    gains[:-1, -1] = fewer + np.log(m / max(total, 1))
    gains[-1, :-1] = more - np.log(m / (total + 1))
    gains[:, np.flatnonzero(counts >= most)] = -np.inf
    gains[np.arange(len(of)), of] = gains[-1, -1] = -np.inf
    return gains, np.append(of, m)


def _changed(
    counts: IntArray, g: FloatArray, N: FloatArray, of_to: tuple[int, int]
) -> tuple[IntArray, FloatArray]:
    """Return losses and their score with one of an interval at another, m for none."""
    counts, m = counts.copy(), len(counts)
    for k, more in zip(of_to, (-1, 1), strict=True):
        if k < m:
            counts[k] += more
            g = g - more * N[k]
    return counts, g
