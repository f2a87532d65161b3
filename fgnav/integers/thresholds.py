"""How large a ratio or a difference must be for the geometry at hand: fixed failure rate.

A threshold that suits one geometry is unsafe in the next. Here noise of the stated covariance is
drawn for the very satellites, links and antennas, at attitudes of every direction; the threshold is
the lowest at which no larger share of what passes is wrong than asked for [1]_. Each drawn set
counts with its posterior probability to be wrong instead of 0 or 1, which needs far fewer of them.

References
----------
.. [1] P. J. G. Teunissen, S. Verhagen, "The GNSS ambiguity ratio-test revisited: a better way of
   using it", Survey Review 41, 2009.
"""

from dataclasses import replace
from typing import Literal

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotations
from fgnav.integers.array.search import PROVEN, ConstrainedSearch, search_constrained
from fgnav.integers.epochs import epochs_at
from fgnav.integers.validation import share_threshold
from fgnav.types.differences import DoubleDifferences

Test = Literal["ratio", "difference"]

_SMALLEST_COST = 1e-30  # noise-free data: the ratio stays finite


def statistic(found: ConstrainedSearch, test: Test) -> FloatArray:
    """Return how far the second-best integers are from the best, (n,).

    Parameters
    ----------
    found : ConstrainedSearch
    test : str
        ``"ratio"`` of the two costs or their ``"difference"``.

    Returns
    -------
    ndarray, shape (n,)
        Infinite where no second was within reach, minus infinity where nothing was found.
    """
    best, second = found.costs.T
    there = np.isfinite(best)
    known = np.where(there, best, 0.0)
    far = second / np.maximum(known, _SMALLEST_COST) if test == "ratio" else second - known
    return np.where(there, far, -np.inf)


def simulated(
    differences: DoubleDifferences, epochs: IntArray, rng: np.random.Generator
) -> DoubleDifferences:
    """Return observations as the stated noise would make them, all integers zero.

    Parameters
    ----------
    differences : DoubleDifferences
        Whose satellites, links and variances are used.
    epochs : ndarray of int, shape (k,)
        Each gives one set, at a random attitude.
    rng : numpy.random.Generator
    """
    d = epochs_at(differences, epochs)
    n, b, m = d.phase_m.shape
    R_nb = rotations.nearest(rng.normal(size=(n, 3, 3)))
    of_reference = d.reference[:, d.group].clip(0)[:, None, :]

    def observed(measured: FloatArray, variance: FloatArray) -> FloatArray:
        links = np.sqrt(variance)[:, None, :] * rng.normal(size=(n, b + 1, m))
        single = links[:, 1:] - links[:, :1]
        noise = single - np.take_along_axis(single, of_reference, axis=2)
        return np.asarray(np.where(np.isfinite(measured), d.array_m(R_nb) + noise, np.nan))

    return replace(
        d,
        code_m=observed(d.code_m, d.code_variance_m2),
        phase_m=observed(d.phase_m, d.phase_variance_m2),
    )


def thresholds(
    differences: DoubleDifferences,
    test: Test,
    *,
    wrong_max: float,
    sets: int,
    nodes: int,
    rng: np.random.Generator,
) -> FloatArray:
    """Return what the statistic of each epoch must reach, (n,).

    Epochs with the same links share a threshold, found over all their geometries.

    Parameters
    ----------
    differences : DoubleDifferences
    test : str
        ``"ratio"`` or ``"difference"``.
    wrong_max : float
        Share of what passes that may be wrong.
    sets : int
        How many are simulated for one pattern of links.
    nodes : int
        What a search may visit.
    rng : numpy.random.Generator

    Returns
    -------
    ndarray, shape (n,)
        NaN, which nothing passes, where no threshold is safe.
    """
    links = differences.resolvable.reshape(len(differences.t_s), -1)
    patterns, pattern = np.unique(links, axis=0, return_inverse=True)
    of_pattern = np.full(len(patterns), np.nan)
    for p in np.flatnonzero(patterns.any(axis=1)):
        members = np.flatnonzero(pattern.reshape(-1) == p)
        drawn = members[np.linspace(0, len(members) - 1, sets).astype(np.int64)]
        found = search_constrained(simulated(differences, drawn, rng), nodes)
        sound = found.status == PROVEN
        wrong = np.where(sound, found.wrong_probability, 1.0)
        of_pattern[p] = share_threshold(statistic(found, test), wrong, wrong_max)
    return np.asarray(of_pattern[pattern.reshape(-1)])
