"""Integers carried along arcs, compiled: which epoch speaks for an arc, and how sure that is."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.kernels.compiled import kernel

_TINY = 1e-300


class Answers(NamedTuple):
    """What single epochs say of the integers, each by its own references."""

    cycles: IntArray  # (n, b, m)
    resolved: BoolArray  # (n, b, m): resolved, or a reference, whose integer is 0
    wrong: FloatArray  # (n,): chance that an epoch's answer is not right
    arc: IntArray  # (n, b, m): of single differences; -1 without phase
    of_reference: IntArray  # (n, m): reference of each channel; -1 without


class Carried(NamedTuple):
    """What arcs make of the answers of their epochs, (n, b, m) each."""

    cycles: IntArray
    source: IntArray  # epoch that speaks for the link; -1: none does
    chance: FloatArray  # that the integer is wrong


class _SoFar(NamedTuple):
    """What epochs in which the arcs of two channels both go on have said until now."""

    source: int  # the surest; -1: none
    cycles: int
    voices: int
    least: float  # chance of the surest to be wrong
    against: float  # of the surest that contradicts it
    for_it: float  # sums of logarithms of chances to be right, and wrong
    other: float


def carry(answers: Answers, *, causal: bool = False) -> Carried:
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
    n, b, m = answers.cycles.shape
    carried = Carried(
        np.zeros((n, b, m), dtype=np.int64),
        np.full((n, b, m), -1, dtype=np.int64),
        np.ones((n, b, m)),
    )
    pairs = np.zeros((m, m), dtype=np.bool_)
    epoch, channel = np.nonzero(answers.of_reference >= 0)
    pairs[channel, answers.of_reference[epoch, channel]] = True
    pairs[np.arange(m), np.arange(m)] = False
    answers = Answers._make(map(np.array, answers))  # writable: compiled for these alone
    _carry_pairs(answers, np.ascontiguousarray(np.argwhere(pairs)), carried, causal)
    return carried


@kernel
def _carry_pairs(answers: Answers, pairs: IntArray, carried: Carried, causal: bool) -> None:
    """Carry differences of channels ``pairs``, (p, 2), the second as reference."""
    n, b, _ = answers.cycles.shape
    for i in range(b):
        for p in range(len(pairs)):
            j, r = pairs[p, 0], pairs[p, 1]
            so_far, first = _no_answer(), 0
            arc_j, arc_r = -1, -1
            for k in range(n):
                if answers.arc[k, i, j] < 0 or answers.arc[k, i, r] < 0:
                    continue
                if answers.arc[k, i, j] != arc_j or answers.arc[k, i, r] != arc_r:
                    if not causal:
                        _give(so_far, answers, (i, j, r), (first, k), carried)
                    arc_j, arc_r = answers.arc[k, i, j], answers.arc[k, i, r]
                    so_far, first = _no_answer(), k
                if answers.resolved[k, i, j] and answers.resolved[k, i, r]:
                    integer = answers.cycles[k, i, j] - answers.cycles[k, i, r]
                    so_far = _with_answer(so_far, k, integer, answers.wrong[k])
                if causal:
                    _give(so_far, answers, (i, j, r), (k, k + 1), carried)
            if not causal:
                _give(so_far, answers, (i, j, r), (first, n), carried)


@kernel
def _give(
    so_far: _SoFar,
    answers: Answers,
    link: tuple[int, int, int],
    epochs: tuple[int, int],
    carried: Carried,
) -> None:
    """Give a link of some epochs, from the first to one before the last, what was said of it."""
    if so_far.source < 0:
        return
    i, j, r = link
    chance = _chance(so_far)
    for k in range(epochs[0], epochs[1]):
        continues = answers.arc[k, i, j] >= 0 and answers.arc[k, i, r] >= 0
        if continues and answers.of_reference[k, j] == r:
            carried.cycles[k, i, j] = so_far.cycles
            carried.source[k, i, j] = so_far.source
            carried.chance[k, i, j] = chance


@kernel
def _no_answer() -> _SoFar:
    return _SoFar(-1, 0, 0, np.inf, np.inf, 0.0, 0.0)


@kernel
def _with_answer(so_far: _SoFar, k: int, integer: int, wrong: float) -> _SoFar:
    """Add what epoch k says, and its chance to be wrong."""
    source, cycles, voices, least, against, for_it, other = so_far
    if source >= 0 and integer != cycles:
        against = min(against, max(wrong, least))
    if wrong < least:
        source, cycles, least = k, integer, wrong
    for_it += np.log(max(1.0 - wrong, _TINY))
    other += np.log(max(wrong, _TINY))
    return _SoFar(source, cycles, voices + 1, least, against, for_it, other)


@kernel
def _chance(so_far: _SoFar) -> float:
    """Return how likely what the epochs say together is wrong."""
    _, _, voices, least, against, for_it, other = so_far
    # Of as many chances one may be small by chance; their geometric mean is never so. Both bound
    # what the epochs together would say, and the smaller of two bounds counts twice.
    mean = 1.0 / (1.0 + np.exp((for_it - other) / voices))
    opposed = least / (least + against) if least > 0.0 else 0.0  # by a second opinion
    return float(min(1.0, max(2.0 * min(voices * least, mean), opposed)))


@kernel
def chance_of_epochs(carried: Carried, continues: BoolArray) -> tuple[FloatArray, IntArray]:
    """Return the chance that an epoch is wrong anywhere, (n,), and how many epochs it rests on."""
    n, b, m = carried.cycles.shape
    chance, sources = np.zeros(n), np.zeros(n, dtype=np.int64)
    seen, worst = np.empty(b * m, dtype=np.int64), np.empty(b * m)
    for k in range(n):
        count = 0
        for i in range(b):
            for j in range(m):
                if not continues[k, i, j]:
                    continue
                at = 0
                while at < count and seen[at] != carried.source[k, i, j]:
                    at += 1
                if at == count:
                    seen[at], worst[at] = carried.source[k, i, j], 0.0
                    count += 1
                worst[at] = max(worst[at], carried.chance[k, i, j])
        chance[k], sources[k] = min(1.0, np.sum(worst[:count])), count
    return chance, sources
