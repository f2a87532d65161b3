"""Factors of a source, with a report of unused measurements."""

from collections.abc import Iterator
from dataclasses import dataclass

from fgnav.checks import Unused
from fgnav.graph.custom import NamedFactor


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Sourced:
    """Factors, and what the estimate reports of those that are left out."""

    factors: tuple[NamedFactor, ...] = ()
    unused: tuple[Unused, ...] = ()  # answers that are left out, with the reason
    notes: tuple[str, ...] = ()  # what a reader of the result should know, one sentence each
    networks: tuple[str, ...] = ()  # names of those that were asked

    def __iter__(self) -> Iterator[NamedFactor]:
        """Yield the factors."""
        return iter(self.factors)
