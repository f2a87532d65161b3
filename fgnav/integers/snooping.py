"""Bad links: which of them spoil the residuals of an epoch, and what the rest makes of it.

Detection, identification, adaptation [1]_: an epoch whose residuals are no noise is asked which
link, of one antenna to one satellite, explains them best. The most suspect ones are left out in
turn and the integers searched again from the start; the first whose absence leaves but noise stays
out. If there is none, the one that leaves the likeliest residuals does, and the next is looked for.

References
----------
.. [1] P. J. G. Teunissen, "Quality control in integrated navigation systems", IEEE Aerospace and
   Electronic Systems Magazine 5, 1990.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from fgnav.checks import BoolArray, IntArray, Loss
from fgnav.integers.array.search import PROVEN, ConstrainedSearch, search_constrained
from fgnav.integers.suspects import suspects
from fgnav.types.differences import DoubleDifferences

LEFT_OUT = "left out: its residual is no noise, and without it the epoch's others are"

_SUSPECTS = 12  # links tried: where the integers are wrong as well, the first is seldom the bad one
_DOUBT = 14.0  # of squared w-tests: a link behind by less is the bad one with 1 in 1000 or more


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Snooped:
    """A search in which some epochs go without some links."""

    searched: ConstrainedSearch  # of all epochs; of those saved, what their remaining links give
    # Links, those of the reference antenna first, that were left out to save an epoch.
    left_out: BoolArray  # (n, b + 1, m)
    unresolved: BoolArray  # (n, b, m): double differences that the links left out take part in


@dataclass(frozen=True, eq=False, slots=True)
class _Attempt:
    """Some epochs, the links they go without, and what that gives."""

    at: IntArray  # (k,)
    out: BoolArray  # (k, b + 1, m)
    searched: ConstrainedSearch

    def some(self, which: BoolArray) -> "_Attempt":
        return _Attempt(self.at[which], self.out[which], self.searched.rows(np.flatnonzero(which)))


def snooped(
    differences: DoubleDifferences,
    searched: ConstrainedSearch,
    refused: BoolArray,
    *,
    links_max: int,
    tail: float,
    nodes: int,
) -> Snooped:
    """Try refused epochs again without the links that spoil them.

    An epoch is saved if its residuals without at most ``links_max`` links pass chi-square, and if
    whatever else could have been left out to the same effect leads to the same integers.

    Parameters
    ----------
    searched : ConstrainedSearch
        Of the same differences.
    refused : ndarray of bool, shape (n,)
        Epochs to try.
    tail : float
        Residuals that noise exceeds in a smaller share of epochs are not accepted.
    nodes : int
        What a search may visit.
    """
    n, b, m = differences.phase_m.shape
    left_out = np.zeros((n, b + 1, m), dtype=np.bool_)
    if links_max == 0 or not refused.any():
        return Snooped(
            searched=searched, left_out=left_out, unresolved=np.zeros((n, b, m), np.bool_)
        )
    at = np.flatnonzero(refused & np.isfinite(searched.costs[:, 0]))
    now = _Attempt(at, left_out[at], searched.rows(at))
    for _ in range(links_max):
        if len(now.at) == 0:
            break
        now, passed, agreed = _one_more(differences, now, tail, nodes)
        saved = now.some(passed & agreed)
        left_out[saved.at] = saved.out
        searched = searched.with_rows(saved.at, saved.searched)
        now = now.some(~passed & np.isfinite(now.searched.costs[:, 0]))
    unresolved = touched(differences, np.arange(n), left_out)
    return Snooped(searched=searched, left_out=left_out, unresolved=unresolved)


def touched(differences: DoubleDifferences, epochs: IntArray, links: BoolArray) -> BoolArray:
    """Return the double differences, (k, b, m), that links, (k, b + 1, m), of epochs take part in.

    Each is made of four: of its channel and of the group's reference, at its antenna and at the
    reference antenna.
    """
    of_reference = differences.reference[epochs][:, differences.group].clip(0)[:, None, :]
    either = links | np.take_along_axis(links, of_reference, axis=2)
    return np.asarray(either[:, 1:] | either[:, :1])


def left_out_losses(
    differences: DoubleDifferences, antennas: tuple[str, ...], left_out: BoolArray
) -> tuple[Loss, ...]:
    """Return a loss for every antenna and channel of which links were left out.

    A double difference that lacks two such links is counted with the first.

    Parameters
    ----------
    left_out : ndarray of bool, shape (n, b + 1, m)
    """
    if not left_out.any():
        return ()
    some = np.flatnonzero(left_out.any(axis=(1, 2)))
    losses, counted = [], ~differences.resolvable[some]
    for a, j in np.argwhere(left_out.any(axis=0)):
        one = np.zeros_like(left_out[some])
        one[:, a, j] = left_out[some, a, j]
        lost = touched(differences, some, one) & ~counted
        counted = counted | lost
        # of two antennas nothing tells which one it is
        antenna = " or ".join(antennas) if len(antennas) == 2 else antennas[a]
        what = f"{antenna} {differences.satellites[j]} {differences.signals[j]} link"
        losses.append(Loss(what=what, reason=LEFT_OUT, count=int(lost.sum())))
    return tuple(losses)


def _one_more(
    differences: DoubleDifferences, now: _Attempt, tail: float, nodes: int
) -> tuple[_Attempt, BoolArray, BoolArray]:
    """Leave one more link out; return whether that passes, and whether all that do agree."""
    rows = differences.resampled(now.at)
    less = rows.without_code(touched(differences, now.at, now.out))
    which, explained = suspects(less, now.searched.cycles, _SUSPECTS)
    trials, links, likelihood = [], [], np.zeros((which.shape[1], len(now.at)))
    for s in range(which.shape[1]):
        out = now.out.copy()
        np.put_along_axis(out.reshape(len(out), -1), which[:, s : s + 1], values=True, axis=1)
        less = rows.without_code(touched(differences, now.at, out))
        searched = search_constrained(less, nodes)
        sound = (searched.status == PROVEN) & (searched.degrees > 0)
        cost = np.where(sound, searched.costs[:, 0], np.inf)
        likelihood[s] = np.where(sound, chdtrc(np.maximum(searched.degrees, 1), cost), -1.0)
        trials.append(_Attempt(now.at, out, searched))
        links.append(less.resolvable)
    passes: BoolArray = np.asarray(likelihood >= tail)
    best = np.where(passes.any(axis=0), passes.argmax(axis=0), likelihood.argmax(axis=0))
    now = _picked(trials, best)
    of_best = np.choose(best[:, None, None], links)
    near = np.take_along_axis(explained.T, best[None], axis=0) - explained.T < _DOUBT
    agreed = np.full(now.at.shape, fill_value=True)
    for s, trial in enumerate(trials):
        same = (trial.searched.cycles == now.searched.cycles) | ~(links[s] & of_best)
        agreed = agreed & (~passes[s] | same.all(axis=(1, 2)))
        # who explains the residuals as well stays out as well
        now.out[passes[s] & near[s]] |= trial.out[passes[s] & near[s]]
    return now, np.asarray(passes.any(axis=0)), agreed


def _picked(trials: list[_Attempt], best: IntArray) -> _Attempt:
    """Return for each epoch the trial of that number."""
    searched = trials[0].searched
    for s, trial in enumerate(trials):
        at = np.flatnonzero(best == s)
        searched = searched.with_rows(at, trial.searched.rows(at))
    out = np.choose(best[:, None, None], [trial.out for trial in trials])
    return _Attempt(trials[0].at, out, searched)
