"""The integer that the epochs of an arc agree on: a running majority vote [1]_.

References
----------
.. [1] R. S. Boyer, J S. Moore, "MJRTY: a fast majority vote algorithm", in "Automated Reasoning",
   Kluwer, 1991.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray

_MINIMUM = 2.0  # votes ahead of all others: wrong integers seldom agree
_MOST = 20.0  # so many displace it after a slip that nobody noticed


class Consensus(NamedTuple):
    """Integers of arcs at each epoch by the votes of the others, (n, b, m) each."""

    cycles: IntArray
    agreed: BoolArray  # two votes ahead at least, and not outvoted since


def arc_consensus(arc: IntArray, cycles: IntArray, votes: FloatArray, *, causal: bool) -> Consensus:
    """Return the integer of each arc at each epoch, by the epochs before and, not causal, after.

    Where these name two, a slip that nobody noticed is in between: the epoch's own counts if it is
    one of them, else neither.

    Parameters
    ----------
    arc : ndarray of int, shape (n, b, m)
        From slip to slip; -1 without phase.
    cycles : ndarray of int, shape (n, b, m)
    votes : ndarray, shape (n, b, m)
        From 0 to 1.
    """
    before = _so_far(arc, cycles, votes)
    if causal:
        return before
    after = _so_far(arc[::-1], cycles[::-1], votes[::-1])
    after = Consensus(after.cycles[::-1], after.agreed[::-1])
    both = before.agreed & after.agreed
    of_after = ~before.agreed | (both & (after.cycles == cycles))
    named = np.where(of_after, after.cycles, before.cycles)
    disputed = both & (before.cycles != after.cycles) & (named != cycles)
    return Consensus(named, (before.agreed | after.agreed) & ~disputed)


def _so_far(arc: IntArray, cycles: IntArray, votes: FloatArray) -> Consensus:
    links = arc.shape[1:]
    out = Consensus(np.zeros(arc.shape, dtype=np.int64), np.zeros(arc.shape, dtype=np.bool_))
    last, agreed = np.full(links, -1), np.zeros(links, dtype=np.bool_)
    named, ahead = np.zeros(links, dtype=np.int64), np.zeros(links)
    for k in range(len(arc)):
        new = (arc[k] >= 0) & (arc[k] != last)
        last = np.where(new, arc[k], last)
        ahead[new], agreed[new] = 0.0, False
        agreed |= ahead >= _MINIMUM
        out.cycles[k], out.agreed[k] = named, agreed & (arc[k] >= 0)
        lead = ahead + np.where(cycles[k] == named, votes[k], -votes[k])
        named, agreed = np.where(lead < 0.0, cycles[k], named), agreed & (lead > 0.0)
        ahead = np.minimum(np.abs(lead), _MOST)
    return out
