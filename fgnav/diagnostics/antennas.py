"""Antennas that are exchanged or displaced: integers that fit the phases need the true array.

An epoch fits a shape where some integers, and the attitude that goes with them, bring its phases to
agree to 2.4 times the nominal noise; of a wrong shape hardly any does.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.diagnostics.contents import Finding
from fgnav.integers.array.search import search_constrained
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight

_FITS = 6.0  # squared residuals per degree of freedom: phase noise up to 2.4 times the nominal
_NODES = 20_000  # of a search; of a wrong shape it finds nothing
_EPOCHS = 60  # that decide between shapes
_WRONG, _RIGHT = 0.5, 0.75  # shares of epochs that fit
_BY_CHANCE = 1e-2  # share of epochs that fit a wrong shape, upper limit
_FALSE_ALARM = 1e-4  # of a flight
_BY_ANTENNA = ("tag_s", "code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")


class Exchange(NamedTuple):
    """Two antennas whose observations are exchanged over some epochs.

    Attributes
    ----------
    fits, runner_up : int
        Epochs of the span that fit only with this pair exchanged less those that do not, and the
        same of the second-best pair.
    """

    pair: tuple[int, int]
    from_s: float
    until_s: float
    fits: int
    runner_up: int

    @property
    def log_likelihood_ratio(self) -> float:
        """Log-likelihood ratio to antennas as given."""
        return self.fits * float(np.log(1 / _BY_CHANCE))

    @property
    def runner_up_ratio(self) -> float:
        """The same of the second-best pair."""
        return self.runner_up * float(np.log(1 / _BY_CHANCE))

    def corrected(self, flight: Flight) -> Flight:
        """Return a flight whose antennas have their own observations."""
        seen = flight.observations
        if seen is None:
            return flight
        order = np.arange(seen.tag_s.shape[1])
        order[list(self.pair)] = self.pair[::-1]
        is_in = (seen.t_s >= self.from_s) & (seen.t_s <= self.until_s)
        changed = {}
        for name in _BY_ANTENNA:
            x = getattr(seen, name)
            changed[name] = np.where(is_in.reshape(-1, *[1] * (x.ndim - 1)), x[:, order], x)
        return replace(flight, observations=replace(seen, **changed))


def exchanged_antennas(
    differences: DoubleDifferences, fixed: BoolArray | None = None
) -> Exchange | None:
    """Return two antennas that are exchanged over a span of epochs.

    Each epoch that fits with an exchange alone favours it by the same odds. The span that favours
    it most is returned if, of all pairs and spans, chance leaves none such.

    Parameters
    ----------
    differences : DoubleDifferences
        Of n epochs.
    fixed : ndarray of bool, shape (n,), optional
        Epochs whose integers are fixed already, so that they fit.
    """
    places_b_m = np.vstack([np.zeros(3), differences.baselines_b_m])
    if len(places_b_m) < 3:
        return None
    tested = differences.resolvable.any(axis=(1, 2))
    failing = np.flatnonzero(tested if fixed is None else tested & ~fixed)
    failing = failing[~fits_shape(differences[failing])]
    count = differences.t_s.size**2 / 2 * len(places_b_m) * (len(places_b_m) - 1) / 2
    needed = int(np.ceil(np.log(max(count, 1) / _FALSE_ALARM) / np.log(1 / _BY_CHANCE)))
    if len(failing) < needed:
        return None
    some = _spread(failing, _EPOCHS)
    shapes = _exchanges(places_b_m, differences[some])
    counts = sorted(((int(fits_shape(shape).sum()), pair) for pair, shape in shapes), reverse=True)
    spans = []
    for count, pair in counts[:2]:
        score = np.where(tested, -1, 0)
        if count:
            shape = next(s for p, s in _exchanges(places_b_m, differences[failing]) if p == pair)
            score[failing] = np.where(fits_shape(shape), 1, -1)
        spans.append((*_best_span(score), pair))
    (first, last, total, pair), (_, _, other, _) = sorted(spans, key=lambda one: -one[2])
    if total < needed:
        return None
    from_s, until_s = differences.t_s[[first, last]].tolist()
    return Exchange(pair, from_s, until_s, total, max(other, 0))


def fits_shape(differences: DoubleDifferences) -> BoolArray:
    """Return which epochs, (n,), fit the array's shape."""
    if not len(differences.t_s):
        return np.zeros(0, dtype=np.bool_)
    search = search_constrained(differences, _NODES)
    return np.asarray((search.costs[:, 0] <= _FITS * search.degrees) & (search.degrees > 0))


def antenna_findings(flight: Flight, differences: DoubleDifferences) -> list[Finding]:
    """Return antennas that are exchanged or not at their places; empty if epochs fit."""
    useful = np.flatnonzero(differences.resolvable.any(axis=(1, 2)))
    names = [antenna.name for antenna in flight.antennas]
    part = differences[_spread(useful, _EPOCHS)]
    fits = fits_shape(part)
    if fits.all():
        return []
    exchange = exchanged_antennas(part, fits)
    if exchange is not None:
        first, second = (names[i] for i in exchange.pair)
        text = (
            f"{first} and {second} look exchanged from {exchange.from_s:.1f} to "
            f"{exchange.until_s:.1f} s: {exchange.fits} epochs fit the array only so"
        )
        mend = "exchange their observations or position_b_m"
        return [Finding(name="antennas exchanged", text=text, mend=mend)]
    given = float(fits.mean())
    if given >= _WRONG:
        return []
    evidence = f"{100 * given:.0f} % of {len(part.t_s)} epochs fit the given places"
    shares = [(float(fits_shape(_without(part, a)).mean()), a) for a in range(len(names))]
    best, antenna = max(shares) if len(names) > 2 else (0.0, 0)
    if best < max(_RIGHT, 2 * given):
        mend = "check position_b_m of all"
        text = f"{evidence}; neither an exchange of two nor leaving one out explains it"
        return [Finding(name="antennas misplaced", text=text, mend=mend)]
    text = f"{names[antenna]} is not at its place: {evidence}, without it {100 * best:.0f} %"
    mend = "check its position_b_m"
    return [Finding(name="antenna misplaced", text=text, mend=mend)]


def _exchanges(
    places_b_m: FloatArray, differences: DoubleDifferences
) -> Iterator[tuple[tuple[int, int], DoubleDifferences]]:
    """Yield each pair of antennas, and the differences of the array with it exchanged."""
    for i, j in combinations(range(len(places_b_m)), 2):
        places = places_b_m.copy()
        places[[i, j]] = places[[j, i]]
        yield (i, j), replace(differences, baselines_b_m=places[1:] - places[0])


def _without(differences: DoubleDifferences, antenna: int) -> DoubleDifferences:
    """Return the differences of the other antennas; without the first, against the second."""
    code_m, phase_m = differences.code_m, differences.phase_m
    baselines_b_m = differences.baselines_b_m
    if antenna == 0:
        code_m, phase_m = code_m - code_m[:, :1], phase_m - phase_m[:, :1]
        baselines_b_m = baselines_b_m - baselines_b_m[0]
    row = max(antenna - 1, 0)
    return replace(
        differences,
        baselines_b_m=np.delete(baselines_b_m, row, axis=0),
        code_m=np.delete(code_m, row, axis=1),
        phase_m=np.delete(phase_m, row, axis=1),
        arc=np.delete(differences.arc, row, axis=1),
    )


def _best_span(score: IntArray) -> tuple[int, int, int]:
    """Return first and last of the epochs, (n,), whose scores have the greatest sum, and that."""
    before = np.append(0, np.cumsum(score))
    lowest = np.minimum.accumulate(before[:-1])
    gain = before[1:] - lowest
    last = int(gain.argmax())
    first = int(np.flatnonzero(before[: last + 1] == lowest[last])[-1])
    return first, last, int(gain[last])


def _spread(rows: IntArray, count: int) -> IntArray:
    """Return up to so many rows, evenly."""
    chosen = np.linspace(0, len(rows) - 1, min(count, len(rows))).astype(np.int64)
    return np.asarray(rows[chosen])
