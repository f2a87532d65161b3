"""Resolved integers, and what anything that resolves them looks like."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Unused, freeze, unused_of
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight

# Who says what a link's integer is.
SOURCES = ("resolver", "arc")


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
    reasons : tuple of str, length n, or None
        Why an epoch is not fixed, or lacks some of its links; empty where nothing is missing.
    source : ndarray of int, shape (n, b, m), or None
        Whose integer a link has, of ``SOURCES``; None: all the resolver's.
    unused : tuple of Unused
        Links that were there and were not fixed, with the reason.
    """

    resolver: str
    cycles: IntArray
    fixed: BoolArray
    ratio: FloatArray
    wrong_probability: FloatArray | None = None
    reasons: tuple[str, ...] | None = None
    unused: tuple[Unused, ...] = ()
    source: IntArray | None = None

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        freeze("integers", self, {"cycles": (None, None, None)}, dtype=np.int64)
        n, b, _ = shape = self.cycles.shape
        freeze("integers", self, {"fixed": shape}, dtype=np.bool_)
        freeze("integers", self, {"ratio": (n, b)}, gaps=True)
        if self.wrong_probability is not None:
            freeze("integers", self, {"wrong_probability": (n,)})
        if self.source is not None:
            freeze("integers", self, {"source": shape}, dtype=np.int64)
        if self.reasons is not None and len(self.reasons) != n:
            raise BadInputError(
                f"integers reasons: expected one for each of {n} epochs, got {len(self.reasons)}"
            )

    @property
    def outcome(self) -> tuple[str, ...]:
        """Outcome of each epoch, length n: fixed, refused (validation), or float (no answer).

        Only a resolver that states probabilities tells refused from float.
        """
        answer = np.zeros(len(self.cycles), dtype=np.bool_)
        if self.wrong_probability is not None:
            answer = self.wrong_probability < 1.0
        names = np.where(answer, "refused", "float")
        return tuple(np.where(self.fixed.any(axis=(1, 2)), "fixed", names).tolist())


def joined(
    resolver: str, parts: Sequence[Integers], order: IntArray | slice = slice(None)
) -> Integers:
    """Return the integers of all epochs of parts, one after another or in an order of these."""

    def column(name: str) -> Any:  # noqa: ANN401  # as the field
        values = [getattr(block, name) for block in parts]
        return None if any(v is None for v in values) else np.concatenate(values)[order]

    lost = Counter[tuple[str, str]]()
    for loss in (loss for block in parts for loss in block.unused):
        lost[loss.what, loss.reason] += loss.count
    reasons = column("reasons")
    return Integers(
        resolver=resolver,
        cycles=column("cycles"),
        fixed=column("fixed"),
        ratio=column("ratio"),
        wrong_probability=column("wrong_probability"),
        reasons=None if reasons is None else tuple(reasons.tolist()),
        unused=unused_of(lost),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ArcInteger:
    """An integer that a link has had, from slip to slip or until another took its place.

    Attributes
    ----------
    link : str
        ``"a3 G05 1C"``.
    from_s, until_s : float
        First and last epoch that has it.
    cycles : int
        Of the double difference: to the channel of reference; against a base to the oldest arc of
        its carrier.
    wrong_probability : float or None
        As the resolver states it of its epochs; None where it does not.
    by : str
        Of most of its epochs: ``resolver``, or ``arc`` (what the arc's epochs agree on); ``base``:
        integer least squares of differences to a base.
    """

    link: str
    from_s: float
    until_s: float
    cycles: int
    wrong_probability: float | None
    by: str


class Resolver(Protocol):
    """Anything that turns double differences into integers."""

    @property
    def name(self) -> str:
        """Short label, as the command line knows it."""
        ...

    # ``looks_ahead``, where it has it: whether what it says of an epoch may depend on later ones;
    # taken as true if not stated. ``fgnav.integers.resolvers.causal`` makes one of it that does
    # not.

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:
        """Resolve every epoch; an epoch without an answer is not fixed and counted as a loss."""
        ...


def fixed_ranges_m(differences: DoubleDifferences, integers: Integers) -> FloatArray:
    """Return phase minus its integers, m, (n, b, m): NaN where not fixed, 0 at references."""
    resolved = integers.fixed | (differences.is_reference[:, None, :] & (differences.phase_m == 0))
    ranges_m = differences.phase_m - differences.wavelength_m * integers.cycles
    return np.asarray(np.where(resolved, ranges_m, np.nan))
