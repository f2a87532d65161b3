"""Antennas that are exchanged or displaced: integers that fit the phases need the true array.

An epoch fits a shape where some integers, and the attitude that goes with them, bring its phases to
agree to 2.4 times the nominal noise; of a wrong shape hardly any does.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from fgnav.attitude.array import maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.diagnostics.contents import Finding
from fgnav.gnss.difference import double_differences
from fgnav.integers.array.search import search_constrained
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.observations import BY_EPOCH, Observations

_FITS = 6.0  # squared residuals per degree of freedom: phase noise up to 2.4 times the nominal
_NODES = 20_000  # of a search; of a wrong shape it finds nothing
_EPOCHS = 60  # that decide between shapes
_OF_PAIRS = 20  # epochs by which the two likeliest exchanges are chosen
_WRONG, _RIGHT = 0.5, 0.75  # shares of epochs that fit
_BY_CHANCE = 1e-2  # share of epochs that fit a wrong shape, upper limit
_FALSE_ALARM = 1e-4  # of a flight
_Shapes = Iterator[tuple[tuple[int, int], DoubleDifferences]]


class Exchange(NamedTuple):
    """Two antennas whose observations are exchanged over some epochs.

    ``log_ratio``, ``runner_up_ratio``: log-likelihood ratios to antennas as given, of this pair and
    of the second-best.
    """

    pair: tuple[int, int]
    from_s: float
    until_s: float
    log_ratio: float
    runner_up_ratio: float

    def message(self, flight: Flight) -> str:
        """Return the finding with its evidence."""
        first, second = (flight.antennas[i].name for i in self.pair)
        return (
            f"{first} and {second} are exchanged from {self.from_s:.1f} to {self.until_s:.1f} s: "
            f"log-likelihood ratio {self.log_ratio:.0f}, runner-up pair {self.runner_up_ratio:.0f}"
        )

    def corrected(self, flight: Flight) -> Flight:
        """Return a flight whose antennas have their own observations."""
        observations = flight.observations
        if observations is None:
            return flight
        order = np.arange(len(flight.antennas))
        order[list(self.pair)] = self.pair[::-1]
        is_in = (observations.t_s >= self.from_s) & (observations.t_s <= self.until_s)
        changed = {name: getattr(observations, name).copy() for name in BY_EPOCH[1:]}
        for values in changed.values():
            values[is_in] = values[is_in][:, order]
        return replace(flight, observations=replace(observations, **changed))


def exchanged_antennas(
    flight: Flight, differences: DoubleDifferences, fixed: BoolArray
) -> Exchange | None:
    """Return two antennas that are exchanged over a span of epochs.

    By integers that LAMBDA finds without the shape. Each epoch that fits with an exchange alone
    favours it by the same odds, and one that fits as given opposes it. The span that favours it
    most is returned if, of all pairs and spans, chance leaves none such.

    Parameters
    ----------
    flight : Flight
    differences : DoubleDifferences
        Of n epochs.
    fixed : ndarray of bool, shape (n,)
        Epochs that fit, because their integers are fixed already.
    """
    tested, antennas = differences.resolvable.any(axis=(1, 2)), len(differences.baselines_b_m) + 1
    failing = np.flatnonzero(tested & ~fixed)
    failing = failing[~_fits_by_lambda(flight, differences[failing])]
    count = differences.t_s.size**2 / 2 * antennas * (antennas - 1) / 2
    needed = np.log(max(count, 1) / _FALSE_ALARM) / np.log(1 / _BY_CHANCE)
    if antennas < 3 or len(failing) < needed:
        return None
    shapes = _exchanges(differences[_spread(failing, _OF_PAIRS)])
    fitting = [(_fits_by_lambda(flight, shape).sum(), pair) for pair, shape in shapes]
    likely, spans = [pair for _, pair in sorted(fitting, reverse=True)[:2]], []
    for pair, shape in _exchanges(differences[failing]):
        if pair in likely:
            score = np.where(tested, -1, 0)
            score[failing] = np.where(_fits_by_lambda(flight, shape), 1, 0)
            spans.append((*_best_span(score), pair))
    (total, first, last, pair), (other, *_) = sorted(spans, reverse=True)
    if total < needed:
        return None
    ratios = (max(float(n), 0.0) * np.log(1 / _BY_CHANCE) for n in (total, other))
    return Exchange(pair, *differences.t_s[[first, last]].tolist(), *ratios)


def _fits_by_lambda(flight: Flight, differences: DoubleDifferences) -> BoolArray:
    """Select the epochs, (n,), that fit the array's shape by integers found without it."""
    if not len(differences.t_s):
        return np.zeros(0, dtype=np.bool_)
    integers = Lambda()(differences, flight)
    by_lambda = maximum_likelihood(RotationQuadratic.of_double_differences(differences, integers))
    degrees = by_lambda.degrees_of_freedom
    return np.asarray((by_lambda.chi_square <= _FITS * degrees) & (degrees > 0))


def _fits_shape(flight: Flight, differences: DoubleDifferences) -> BoolArray:
    """Select the epochs, (n,), that fit the array's shape by LAMBDA's integers or any others."""
    fits = _fits_by_lambda(flight, differences)
    (others,) = np.nonzero(~fits)
    if len(others):
        search = search_constrained(differences[others], _NODES)
        fits[others] = (search.costs[:, 0] <= _FITS * search.degrees) & (search.degrees > 0)
    return fits


def antenna_finding(flight: Flight, differences: DoubleDifferences) -> Finding | None:
    """Return antennas that are exchanged or not at their places; None if epochs fit."""
    tested = differences[_spread(np.flatnonzero(differences.resolvable.any(axis=(1, 2))), _EPOCHS)]
    fits, antennas, observations = _fits_shape(flight, tested), flight.antennas, flight.observations
    exchange = None if fits.all() else exchanged_antennas(flight, tested, fits)
    if exchange is not None:
        mend = "exchange their observations or position_b_m"
        return Finding("antennas exchanged", exchange.message(flight), mend)
    if observations is None or fits.all() or fits.mean() >= _WRONG:
        return None
    evidence = f"{100 * fits.mean():.0f} % of {len(fits)} epochs fit the given places"
    every = range(len(antennas) if len(antennas) > 2 else 0)
    shares = [
        (float(_fits_shape(flight, _without(flight, observations, tested.t_s, a)).mean()), a)
        for a in every
    ]
    best, antenna = max(shares, default=(0.0, 0))
    if best < max(_RIGHT, 2 * fits.mean()):
        text = f"{evidence}; neither an exchange of two nor leaving one out explains it"
        return Finding("antennas misplaced", text, "check position_b_m of all")
    name = antennas[antenna].name
    text = f"{name} is not at its place: {evidence}, without it {100 * best:.0f} %"
    return Finding("antenna misplaced", text, "check its position_b_m")


def _exchanges(differences: DoubleDifferences) -> _Shapes:
    """Yield each pair of antennas, and the differences of the array with it exchanged."""
    positions_b_m = np.vstack([np.zeros(3), differences.baselines_b_m])
    for i, j in combinations(range(len(positions_b_m)), 2):
        positions = positions_b_m.copy()
        positions[[i, j]] = positions[[j, i]]
        yield (i, j), replace(differences, baselines_b_m=positions[1:] - positions[0])


def _without(
    flight: Flight, observations: Observations, t_s: FloatArray, antenna: int
) -> DoubleDifferences:
    """Return the differences of the other antennas at some epochs."""
    order = np.delete(np.arange(len(flight.antennas)), antenna)
    antennas = tuple(flight.antennas[k] for k in order)
    others = observations[np.isin(observations.t_s, t_s)].of_antennas(order)
    return double_differences(replace(flight, antennas=antennas, observations=others))


def _best_span(score: IntArray) -> tuple[int, int, int]:
    """Return the greatest sum of consecutive scores, (n,), and its first and last epoch."""
    before = np.append(0, np.cumsum(score))
    lowest = np.minimum.accumulate(before[:-1])
    gain = before[1:] - lowest
    last = int(gain.argmax())
    return int(gain[last]), int(np.flatnonzero(before[: last + 1] == lowest[last])[-1]), last


def _spread(rows: IntArray, count: int) -> IntArray:
    """Return up to so many rows, evenly."""
    chosen = np.linspace(0, len(rows) - 1, min(count, len(rows))).astype(np.int64)
    return np.asarray(rows[chosen])
