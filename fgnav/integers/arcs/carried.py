"""Integers carried along arcs: which epoch speaks for an arc, and how sure that is."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray

_TINY = 1e-300


class Answers(NamedTuple):
    """Integers by single epochs, each by its own references."""

    cycles: IntArray  # (n, b, m)
    resolved: BoolArray  # (n, b, m): resolved, or a reference, whose integer is 0
    wrong: FloatArray  # (n,): chance that an epoch's answer is not right
    arc: IntArray  # (n, b, m): of single differences; -1 without phase
    of_reference: IntArray  # (n, m): reference of each channel; -1 without


class ArcIntegers(NamedTuple):
    """Integers by arcs from the answers of their epochs, (n, b, m) each."""

    cycles: IntArray
    source: IntArray  # epoch that speaks for the link; -1: none does
    chance: FloatArray  # that the integer is wrong


def carry(answers: Answers, *, causal: bool = False) -> ArcIntegers:
    """Give every link of an arc the integer of the arc's surest epoch.

    Parameters
    ----------
    causal : bool
        Each epoch by epochs up to it alone: the surest so far.

    Returns
    -------
    Carried
        By the references of the epochs; what other epochs say is re-expressed.
    """
    shape = answers.cycles.shape
    out = ArcIntegers(np.zeros(shape, dtype=np.int64), np.full(shape, -1), np.ones(shape))
    epoch, channel = np.nonzero(answers.of_reference >= 0)
    pairs = np.unique(np.c_[channel, answers.of_reference[epoch, channel]], axis=0)
    for i in range(shape[1]):
        for j, r in pairs[pairs[:, 0] != pairs[:, 1]]:
            arcs = answers.arc[:, i, [j, r]]
            rows = np.flatnonzero((arcs >= 0).all(axis=1))
            ends = np.flatnonzero((np.diff(arcs[rows], axis=0) != 0).any(axis=1)) + 1
            for run in np.split(rows, ends):
                resolved = answers.resolved[run, i, j] & answers.resolved[run, i, r]
                answered = run[resolved]
                if not len(answered):
                    continue
                cycles = answers.cycles[answered, i, j] - answers.cycles[answered, i, r]
                surest, chance = _surest_so_far(cycles, answers.wrong[answered])
                last = np.cumsum(resolved) - 1 if causal else np.full(len(run), len(answered) - 1)
                given = (last >= 0) & (answers.of_reference[run, j] == r)
                to, of = run[given], last[given]
                out.cycles[to, i, j] = cycles[surest[of]]
                out.source[to, i, j] = answered[surest[of]]
                out.chance[to, i, j] = chance[of]
    return out


def _surest_so_far(cycles: IntArray, wrong: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the surest of the first 1, 2, …, k answers, and the chance that all err, (k,) each."""
    count = np.arange(1, len(wrong) + 1)
    lowest = np.minimum.accumulate(wrong)
    before = np.append(np.inf, lowest[:-1])
    surest = np.maximum.accumulate(np.where(wrong < before, count - 1, 0))
    contradicts = cycles != cycles[np.append(0, surest[:-1])]
    against = np.minimum.accumulate(np.where(contradicts, np.maximum(wrong, before), np.inf))
    # Of as many chances one may be small by chance; their geometric mean is never so. Both bound
    # what the epochs together would say, and the smaller of two bounds counts twice.
    log_odds = np.cumsum(np.log(np.maximum(1.0 - wrong, _TINY)) - np.log(np.maximum(wrong, _TINY)))
    mean = 1.0 / (1.0 + np.exp(log_odds / count))
    opposed = lowest / np.maximum(lowest + against, _TINY)  # by a second opinion
    return surest, np.minimum(1.0, np.maximum(2.0 * np.minimum(count * lowest, mean), opposed))


def chance_of_epochs(
    arc_integers: ArcIntegers, continues: BoolArray
) -> tuple[FloatArray, IntArray]:
    """Return the chance that an epoch is wrong anywhere, (n,), and how many epochs it rests on."""
    n = len(continues)
    epoch = np.nonzero(continues)[0]
    both, at = np.unique(epoch * n + arc_integers.source[continues], return_inverse=True)
    worst = np.zeros(len(both))
    np.maximum.at(worst, at, arc_integers.chance[continues])
    chance = np.bincount(both // n, worst, n)
    return np.minimum(1.0, chance), np.bincount(both // n, minlength=n)
