"""The integer that the epochs of an arc agree on: the one with most votes."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.kernels.compiled import inner, kernel

_FEWEST = 5.0  # votes more than any other integer has: wrong ones seldom say the same
_MOST = 4 * _FEWEST  # so many displace it after a slip that nobody noticed


class Consensus(NamedTuple):
    """Integers of arcs at each epoch by the votes of the others, (n, b, m) each."""

    cycles: IntArray
    margin: FloatArray  # votes for it less those for the next; 0 where there are none
    agreed: BoolArray  # by five votes at least, and not outvoted since


def arc_consensus(arc: IntArray, cycles: IntArray, votes: FloatArray, *, causal: bool) -> Consensus:
    """Return the integer of each arc at each epoch, by the epochs before and, not causal, after.

    The most votes win, be they a minority: wrong integers are of many kinds. An integer has twenty
    at most; of more, each loses what is beyond. Where votes before and after name two integers, the
    one by more votes counts, and neither is agreed on: a slip that nobody noticed may be in
    between.

    Parameters
    ----------
    arc : ndarray of int, shape (n, b, m)
        From slip to slip; -1 without phase.
    cycles : ndarray of int, shape (n, b, m)
    votes : ndarray, shape (n, b, m)
        What say an epoch has, from 0 to 1.
    """
    before = _so_far(arc, cycles, votes)
    if causal:
        return before
    after = _so_far(arc[::-1], cycles[::-1], votes[::-1])
    after = Consensus(after.cycles[::-1], after.margin[::-1], after.agreed[::-1])
    same = (before.cycles == after.cycles) | (before.margin == 0) | (after.margin == 0)
    return Consensus(
        np.where(before.margin >= after.margin, before.cycles, after.cycles),
        np.maximum(before.margin, after.margin),
        (before.agreed | after.agreed) & same,
    )


def _so_far(arc: IntArray, cycles: IntArray, votes: FloatArray) -> Consensus:
    out = Consensus(
        np.zeros(arc.shape, dtype=np.int64),
        np.zeros(arc.shape),
        np.zeros(arc.shape, dtype=np.bool_),
    )
    # Copies, in C's order and not frozen: the kernel is compiled once.
    copied = np.array(arc, order="C"), np.array(cycles, order="C"), np.array(votes, order="C")
    _count(*copied, out)
    return out


@kernel
def _count(arc: IntArray, cycles: IntArray, votes: FloatArray, out: Consensus) -> None:
    n, b, m = arc.shape
    named, count = np.zeros(n, dtype=np.int64), np.zeros(n)
    for i in range(b):
        for j in range(m):
            of, names, agreed = -1, 0, False
            for k in range(n):
                if arc[k, i, j] < 0:
                    continue
                if arc[k, i, j] != of:
                    of, names, agreed = arc[k, i, j], 0, False
                first, margin = _leading(count, names)
                agreed = margin > 0.0 and (agreed or margin >= _FEWEST)
                out.cycles[k, i, j] = named[first] if names else 0
                out.margin[k, i, j] = margin
                out.agreed[k, i, j] = agreed
                if votes[k, i, j] > 0.0:
                    names = _voted(cycles[k, i, j], votes[k, i, j], named, count, names)


@inner
def _leading(count: FloatArray, names: int) -> tuple[int, float]:
    """Return which of the integers named has most votes, and how many more than the next."""
    first, most, second = 0, 0.0, 0.0
    for c in range(names):
        if count[c] > most:
            first, most, second = c, count[c], most
        else:
            second = max(second, count[c])
    return first, most - second


@inner
def _voted(integer: int, vote: float, named: IntArray, count: FloatArray, names: int) -> int:
    """Add a vote for an integer, in place; return how many integers are named by then."""
    at = 0
    while at < names and named[at] != integer:
        at += 1
    if at == names:
        named[at], count[at] = integer, 0.0
        names += 1
    count[at] += vote
    beyond = count[at] - _MOST
    if beyond > 0.0:
        for c in range(names):
            count[c] = max(count[c] - beyond, 0.0)
    return names
