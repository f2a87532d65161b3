"""Integers that hold: what an arc's epochs agree on, at epochs that refuse it or say otherwise.

A resolver that looks at single epochs refuses many of them when code is noisy or satellites are
few, and is wrong at some, and may fix the epochs right before and after. Within an arc the integer
is constant, so what it is there it is in between. The chi-square test of the array judges the
result like any other.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, IntArray
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Rejected
from fgnav.types.integers import Integers

_FEWEST = 5  # epochs of an arc that say which integer it has: wrong ones seldom say the same
_AGREED = 0.75  # of them say the same


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ArcConsensus:
    """Integers with those that hold.

    Attributes
    ----------
    integers : Integers
    rejections : tuple of Rejected
        Single epochs that were outvoted.
    notes : tuple of str
    """

    integers: Integers
    rejections: tuple[Rejected, ...] = ()
    notes: tuple[str, ...] = ()


def arc_consensus(
    differences: DoubleDifferences, integers: Integers, antennas: tuple[str, ...]
) -> ArcConsensus:
    """Return integers, those that arcs agree on also where epochs refuse them or say otherwise.

    An arc's integer is the one that three in four of its fixed epochs have, five epochs at least.
    It holds between two of them, and beyond the last; not where those on either side differ, since
    a slip that nobody noticed may be in between. A fixed epoch is outvoted if it is alone: no fixed
    neighbour says the same. A baseline with some links fixed at an epoch gets no more: who resolved
    it left the others out.

    Parameters
    ----------
    differences : DoubleDifferences
    integers : Integers
        Of the same differences.
    antennas : tuple of str, length b + 1
        Names, the reference first.
    """
    fixed, cycles = integers.fixed, integers.cycles
    refused = differences.resolvable & ~fixed.any(axis=2, keepdims=True)
    several = fixed.any() and (refused.any() or _changing(differences.arc, cycles, fixed))
    if not several:
        return ArcConsensus(integers=integers)
    label = _labels(differences.arc)
    known, agreed = _agreed(label, cycles, fixed)
    alone = fixed & agreed & (cycles != known)
    alone &= ~(_as_before(label, cycles, fixed) | _as_before(label, cycles, fixed, back=True))
    upheld = fixed & ~alone
    holds = (refused & agreed) | alone
    for back in (False, True):
        holds &= _near(label, upheld, cycles == known, back=back)
    refused &= holds
    epochs = int((refused.any(axis=(1, 2)) & ~fixed.any(axis=(1, 2))).sum())
    links, arcs = int(refused.sum()), len(np.unique(label[refused]))
    note = (
        f"Integers of {arcs} arcs hold where they were refused: {links} links, {epochs} epochs "
        "that had none."
    )
    return ArcConsensus(
        integers=replace(integers, cycles=np.where(holds, known, cycles), fixed=fixed | holds),
        rejections=_listed(differences, antennas, np.where(alone & holds, cycles - known, 0)),
        notes=(note,) if links else (),
    )


def _changing(arc: IntArray, cycles: IntArray, fixed: BoolArray) -> bool:
    """Return whether an integer differs from the one of the epoch before, within its arc."""
    both = fixed[1:] & fixed[:-1] & (arc[1:] == arc[:-1])
    return bool((both & (cycles[1:] != cycles[:-1])).any())


def _labels(arc: IntArray) -> IntArray:
    """Return numbers of arcs, (n, b, m), that no two links share; 0 without phase."""
    n, b, m = arc.shape
    links = np.arange(b * m).reshape(b, m)
    label = 1 + links * (1 + arc.max(initial=0)) + arc
    return np.where(arc >= 0, np.unique(label, return_inverse=True)[1].reshape(n, b, m) + 1, 0)


def _agreed(label: IntArray, cycles: IntArray, fixed: BoolArray) -> tuple[IntArray, BoolArray]:
    """Return the integer most epochs of each link's arc have, and whether nearly all do.

    Both (n, b, m).
    """
    count = 1 + int(label.max())
    labels, integers, votes = majority_integers(label[fixed], cycles[fixed])
    known, most = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    known[labels], most[labels] = integers, votes
    total = np.bincount(label[fixed], minlength=count)
    agreed = (total >= _FEWEST) & (most >= _AGREED * total)
    return known[label], agreed[label]


def _as_before(
    label: IntArray, cycles: IntArray, fixed: BoolArray, *, back: bool = False
) -> BoolArray:
    """Return whether the fixed epoch before, or after, has the same integer of the same arc."""
    last, there = _last(label, fixed, back=back, strictly=True)
    return np.asarray(there & (np.take_along_axis(cycles, last, axis=0) == cycles))


def _near(label: IntArray, upheld: BoolArray, right: BoolArray, *, back: bool) -> BoolArray:
    """Return whether the upheld epoch before, or after, if its arc has any, is right."""
    last, there = _last(label, upheld, back=back)
    return np.asarray(~there | np.take_along_axis(right, last, axis=0))


def _last(
    label: IntArray, fixed: BoolArray, *, back: bool, strictly: bool = False
) -> tuple[IntArray, BoolArray]:
    """Return the row of the fixed epoch before, or after, and whether it is of the same arc."""
    step = -1 if back else 1
    rows = np.arange(len(fixed))[::step, None, None]
    fixed, turned = fixed[::step], label[::step]
    last = np.maximum.accumulate(np.where(fixed, np.arange(len(fixed))[:, None, None], -1), axis=0)
    if strictly:
        last = np.concatenate([np.full_like(last[:1], -1), last[:-1]])
    at = last.clip(0)
    there = (last >= 0) & (np.take_along_axis(turned, at, axis=0) == turned)
    return rows[:, 0, 0][at][::step], there[::step]


def _listed(
    differences: DoubleDifferences, antennas: tuple[str, ...], off: IntArray
) -> tuple[Rejected, ...]:
    """Return the integers that were outvoted, (n, b, m), one by one."""
    return tuple(
        Rejected(
            what="phase",
            link=f"{antennas[i + 1]} {differences.satellites[j]} {differences.signals[j]}",
            from_s=float(differences.t_s[k]),
            until_s=float(differences.t_s[k]),
            reason=f"integer off by {int(off[k, i, j]):+d}: outvoted by the epochs of its arc",
        )
        for k, i, j in np.argwhere(off)
    )


def majority_integers(label: IntArray, cycles: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the integer that most votes of each label name; of equal ones the largest.

    Parameters
    ----------
    label, cycles : ndarray of int, shape (v,)
        Of each vote: whose it is, and the integer it names.

    Returns
    -------
    ndarray of int, shape (l,), each
        Labels that have votes, in ascending order; the integer elected; the votes it has.
    """
    order = np.lexsort((cycles, label))
    labels, integers = label[order], cycles[order]
    begins = np.ones(len(labels), dtype=bool)
    begins[1:] = (np.diff(labels) != 0) | (np.diff(integers) != 0)
    first = np.flatnonzero(begins)
    votes = np.diff(first, append=len(labels))
    by_votes = np.lexsort((votes, labels[first]))  # stable: of equal ones the largest stands last
    wins = first[by_votes][np.diff(labels[first], append=-1) != 0]
    most = votes[by_votes][np.diff(labels[first], append=-1) != 0]
    return labels[wins], integers[wins], most
