"""The integers a method used against those that the truth implies."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray
from fgnav.evaluation.reference import covered, truth_at
from fgnav.integers.acceptance import phase_links
from fgnav.integers.resolvers.truth import true_integers
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Truth
from fgnav.types.integers import Integers


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegerCounts:
    """Counts of links with an unknown integer, summed over all epochs.

    Attributes
    ----------
    fixed, not_fixed : int
        Links whose integer was accepted, and those left open.
    right, wrong : int or None
        Fixed links whose integer equals the truth's, and those where it does not; None without
        truth. Epochs outside the truth's time span are in neither.
    chance : float or None
        That an epoch's integers are not all right, as the resolver states it of all, in the mean
        over epochs whose links are all fixed; None where it states none.
    """

    fixed: int
    not_fixed: int
    right: int | None = None
    wrong: int | None = None
    chance: float | None = None


def count_integers(
    differences: DoubleDifferences, integers: Integers, true_cycles: Integers | None
) -> IntegerCounts:
    """Count the integers a method used, and, with the true ones, the right and the wrong.

    Parameters
    ----------
    differences : DoubleDifferences
        Of the flight.
    integers : Integers
        In the layout of ``differences``.
    true_cycles : Integers or None
        ``fixed`` marks where the truth is known.

    Raises
    ------
    BadInputError
        If the integers are not in that layout.
    """
    if integers.cycles.shape != differences.phase_m.shape:
        raise BadInputError(
            f"integers of {integers.resolver}: expected the shape of the flight's double "
            f"differences {differences.phase_m.shape}, got {integers.cycles.shape}"
        )
    fixed = integers.fixed
    left = phase_links(differences) & ~fixed
    complete = fixed.any(axis=(1, 2)) & ~left.any(axis=(1, 2))
    probability = integers.wrong_probability
    counts = IntegerCounts(
        fixed=int(fixed.sum()),
        not_fixed=int(left.sum()),
        chance=None
        if probability is None or not complete.any()
        else float(probability[complete].mean()),
    )
    if true_cycles is None:
        return counts
    comparable = fixed & true_cycles.fixed
    right = int((comparable & (integers.cycles == true_cycles.cycles)).sum())
    return replace(counts, right=right, wrong=int(comparable.sum()) - right)


def true_attitudes(truth: Truth, t_s: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return (n, 3, 3) true attitudes and (n,) whether they are known; else they are identity."""
    is_covered = covered(truth, t_s)
    R_nb = np.tile(np.eye(3), (len(t_s), 1, 1))
    R_nb[is_covered] = truth_at(truth, t_s[is_covered]).R_nb
    return R_nb, is_covered


def integers_at(
    differences: DoubleDifferences, R_nb: FloatArray, is_covered: BoolArray
) -> Integers:
    """Return the integers that attitudes imply, fixed at the epochs where the attitude is known.

    Parameters
    ----------
    R_nb : ndarray, shape (n, 3, 3)
    is_covered : ndarray of bool, shape (n,)
    """
    fixed = phase_links(differences) & is_covered[:, None, None]
    return Integers(
        resolver="truth",
        cycles=np.where(fixed, true_integers(differences, R_nb), 0),
        fixed=fixed,
        ratio=np.full(fixed.shape[:2], np.nan),
    )
