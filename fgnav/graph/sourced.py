"""Factors of a source, with a report of unused measurements."""

from collections.abc import Iterator
from dataclasses import dataclass

import gtsam

from fgnav.checks import Unused
from fgnav.graph.custom import NamedFactor


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Sourced:
    """Factors, and what the estimate reports of those that are left out."""

    factors: tuple[gtsam.NonlinearFactor | NamedFactor, ...] = ()
    unused: tuple[Unused, ...] = ()  # answers that are left out, with the reason
    notes: tuple[str, ...] = ()  # what a reader of the result should know, one sentence each

    def __iter__(self) -> Iterator[gtsam.NonlinearFactor | NamedFactor]:
        """Yield the factors."""
        return iter(self.factors)
