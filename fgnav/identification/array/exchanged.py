"""Two antennas that are exchanged for a while: found by epochs that fit the array only so.

An epoch fits where some integers, and the attitude that goes with them, bring its phases to agree
(``search_constrained``) by a chi-square test. Of two hypotheses for a span of epochs, exchanged or
as stated, each epoch that fits one of them alone favours it by the same odds; the span that favours
an exchange most is exchanged back if chance leaves no such span among all that could be.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.frontend.prepared import PreparedFlight
from fgnav.identification.array.places import exchanged_columns
from fgnav.integers.array.search import PROVEN, search_constrained
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Antenna, Flight

_TAIL = 1e-4  # of epochs that fit, refused by the chi-square test
# Share of epochs that fit an array of another shape by chance: of 300 under nine satellites none.
_BY_CHANCE = 1e-2
_FALSE_ALARM = 1e-4  # of a flight with epochs that do not fit
_NODES = 10**5  # of an epoch's search: one that fits takes far fewer


class Exchange(NamedTuple):
    """Two antennas whose observations are exchanged from one epoch to another."""

    pair: tuple[int, int]
    from_s: float
    until_s: float

    def undone(self, flight: Flight) -> Flight:
        """Return a flight whose antennas have their own observations again."""
        seen = flight.observations
        if seen is None:
            return flight
        rows = (seen.t_s >= self.from_s) & (seen.t_s <= self.until_s)
        return replace(flight, observations=exchanged_columns(seen, rows, self.pair))

    def sentence(self, antennas: Sequence[Antenna]) -> str:
        """Return what is to be said of it."""
        first, second = (antennas[i].name for i in self.pair)
        return (
            f"Antennas {first} and {second} are exchanged from {self.from_s:.1f} to "
            f"{self.until_s:.1f} s: their phases fit the array only so; exchanged back."
        )


def exchange_of(prepared: PreparedFlight) -> Exchange | None:
    """Return the antennas that phases say to be exchanged; None where they say nothing.

    Asked only of epochs of which phases take no part.
    """
    if prepared.array is None:
        return None
    differences, ranges_m = prepared.array
    if len(differences.baselines_b_m) < 2:
        return None
    out = np.flatnonzero(_unused(differences, ranges_m, prepared))
    out = out[~_fitting(differences.resampled(out))]
    if not len(out):
        return None
    part, score = differences.resampled(out), np.full(len(differences.t_s), -1)
    places_b_m = np.vstack([np.zeros(3), differences.baselines_b_m])
    best, most = None, _fewest(len(score), len(places_b_m))
    for pair, shape in exchanges(places_b_m, part):
        score[out] = _fitting(shape)
        first, last, total = _span(score)
        if total >= most:
            from_s, until_s = differences.t_s[[first, last]].tolist()
            best, most = Exchange(pair, from_s, until_s), total + 1
    return best


def _unused(
    differences: DoubleDifferences, ranges_m: FloatArray, prepared: PreparedFlight
) -> BoolArray:
    """Return the epochs, (n,), of which phases that could have integers take no part."""
    t_s = prepared.problem.t_s
    used_s = [t_s[one.row] for one in prepared.problem.measurements if one.name == "array phases"]
    is_out = ~np.isin(differences.t_s, np.concatenate([np.zeros(0), *used_s]))
    links = differences.resolvable & (np.isnan(ranges_m) | is_out[:, None, None])
    return np.asarray(links.any(axis=(1, 2)))


def _fewest(epochs: int, antennas: int) -> int:
    """Return how many epochs more must fit an exchange, by all spans and pairs there are."""
    count = epochs**2 / 2 * antennas * (antennas - 1) / 2
    return int(np.ceil(np.log(count / _FALSE_ALARM) / np.log(1 / _BY_CHANCE)))


def _fitting(differences: DoubleDifferences) -> BoolArray:
    """Return which epochs, (k,), some integers bring to agree."""
    search = search_constrained(differences, _NODES)
    limit = chdtri(np.maximum(search.degrees, 1), _TAIL)
    return np.asarray((search.status == PROVEN) & (search.costs[:, 0] <= limit))


def exchanges(
    places_b_m: FloatArray, part: DoubleDifferences
) -> Iterator[tuple[tuple[int, int], DoubleDifferences]]:
    """Yield each pair of antennas, and the differences of an array with it exchanged."""
    for i, j in combinations(range(len(places_b_m)), 2):
        order = list(range(len(places_b_m)))
        order[i], order[j] = j, i
        places = places_b_m[order]
        yield (i, j), replace(part, baselines_b_m=places[1:] - places[0])


def _span(score: IntArray) -> tuple[int, int, int]:
    """Return first and last of the epochs, (n,), whose scores have the greatest sum, and that."""
    before = np.append(0, np.cumsum(score))
    lowest = np.minimum.accumulate(before[:-1])
    gain = before[1:] - lowest
    last = int(gain.argmax())
    first = int(np.flatnonzero(before[: last + 1] == lowest[last])[-1])
    return first, last, int(gain[last])
