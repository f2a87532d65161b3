"""Resolved integers, and what anything that resolves them looks like."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Loss, frozen
from fgnav.flight import Flight
from fgnav.gnss.differences import DoubleDifferences


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Integers:
    """Integers of the double differences, in the layout of ``DoubleDifferences.phase_m``.

    Attributes
    ----------
    resolver : str
        Who resolved them.
    cycles : ndarray of int64, shape (n, b, m)
        0 where not fixed.
    fixed : ndarray of bool, shape (n, b, m)
        Links whose integer is accepted. Reference channels are never fixed: they need no integer.
    ratio : ndarray, shape (n, b)
        Second-best over best squared norm of the search that fixed the baseline; NaN where there
        was none. A joint search gives all baselines the same.
    wrong_probability : ndarray, shape (n,), or None
        That an epoch's best integers, fixed or not, are not all right, by a resolver that can tell;
        1 where it found none.
    losses : tuple of Loss
        Links that were there and were not fixed, with the reason.
    """

    resolver: str
    cycles: IntArray
    fixed: BoolArray
    ratio: FloatArray
    wrong_probability: FloatArray | None = None
    losses: tuple[Loss, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        cycles = frozen("integers cycles", self.cycles, (None, None, None), dtype=np.int64)
        fixed = frozen("integers fixed", self.fixed, cycles.shape, dtype=np.bool_)
        ratio = frozen("integers ratio", self.ratio, cycles.shape[:2], gaps=True)
        object.__setattr__(self, "cycles", cycles)
        object.__setattr__(self, "fixed", fixed)
        object.__setattr__(self, "ratio", ratio)
        if self.wrong_probability is not None:
            wrong = frozen("integers wrong_probability", self.wrong_probability, cycles.shape[:1])
            object.__setattr__(self, "wrong_probability", wrong)


class Resolver(Protocol):
    """Anything that turns double differences into integers."""

    @property
    def name(self) -> str:
        """Short label, as the command line knows it."""
        ...

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:
        """Resolve every epoch; an epoch without an answer is not fixed and counted as a loss."""
        ...


def fixed_ranges_m(differences: DoubleDifferences, integers: Integers) -> FloatArray:
    """Return phase minus its integers, m, (n, b, m): NaN where not fixed, 0 at references."""
    known = integers.fixed | (differences.is_reference[:, None, :] & (differences.phase_m == 0))
    ranges_m = differences.phase_m - differences.wavelength_m * integers.cycles
    return np.asarray(np.where(known, ranges_m, np.nan))
