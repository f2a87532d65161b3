"""The integer that the epochs of an arc agree on: a vote against it takes one for it away."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, IntArray
from fgnav.kernels.compiled import kernel

_FEWEST = 5  # epochs more for an integer than against: wrong ones seldom say the same
_MOST = 4 * _FEWEST  # so many epochs outvote it after a slip that nobody noticed


class Consensus(NamedTuple):
    """Integers of arcs at each epoch by the votes of the others, (n, b, m) each."""

    cycles: IntArray
    margin: IntArray  # votes for it less those against; 0 where there are none
    agreed: BoolArray  # by five votes at least, and not outvoted since


def arc_consensus(arc: IntArray, cycles: IntArray, votes: BoolArray, *, causal: bool) -> Consensus:
    """Return the integer of each arc at each epoch, by the epochs before and, not causal, after.

    A majority in one pass [1]_, by twenty votes at most. Where votes before and after name two
    integers, the one of more votes counts, and neither is agreed on: a slip that nobody noticed may
    be in between.

    Parameters
    ----------
    arc : ndarray of int, shape (n, b, m)
        From slip to slip; -1 without phase.
    cycles : ndarray of int, shape (n, b, m)
    votes : ndarray of bool, shape (n, b, m)
        Where an epoch has a say.
    causal : bool

    References
    ----------
    .. [1] R. S. Boyer, J. S. Moore, "MJRTY: A Fast Majority Vote Algorithm", Automated Reasoning,
       1991, pages 105-117.
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


def _so_far(arc: IntArray, cycles: IntArray, votes: BoolArray) -> Consensus:
    whole = np.zeros(arc.shape, dtype=np.int64)
    out = Consensus(whole, whole.copy(), np.zeros(arc.shape, dtype=np.bool_))
    _count(arc, cycles, votes, out)
    return out


@kernel
def _count(arc: IntArray, cycles: IntArray, votes: BoolArray, out: Consensus) -> None:
    n, b, m = arc.shape
    for i in range(b):
        for j in range(m):
            of, integer, margin, agreed = -1, 0, 0, False
            for k in range(n):
                if arc[k, i, j] < 0:
                    continue
                if arc[k, i, j] != of:
                    of, margin, agreed = arc[k, i, j], 0, False
                out.cycles[k, i, j] = integer
                out.margin[k, i, j] = margin
                out.agreed[k, i, j] = agreed
                if not votes[k, i, j]:
                    continue
                if margin == 0:
                    integer = cycles[k, i, j]
                margin = min(margin + 1, _MOST) if cycles[k, i, j] == integer else margin - 1
                agreed = margin > 0 and (agreed or margin >= _FEWEST)
