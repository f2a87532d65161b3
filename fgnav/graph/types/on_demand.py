"""Sequences whose elements are made when they are taken, of less than they are."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Generic, TypeVar, overload

Item = TypeVar("Item")

_KEPT = 1024  # made last, some kB each: solvers take what is new, or all of a flight, many times
MANY = 4096  # of such as take a kB


class OnDemand(Sequence[Item], Generic[Item]):
    """Elements by their number.

    Parameters
    ----------
    count : int
    make : callable
        Returns an element by its number, 0 to ``count - 1``.
    kept : int
        How many are kept, those taken last.
    """

    def __init__(self, count: int, make: Callable[[int], Item], kept: int = _KEPT) -> None:
        self._count, self._make = count, lru_cache(kept)(make)

    def __len__(self) -> int:
        """Return the number of elements."""
        return self._count

    @overload
    def __getitem__(self, place: int) -> Item: ...
    @overload
    def __getitem__(self, place: slice) -> "OnDemand[Item]": ...
    def __getitem__(self, place: int | slice) -> "Item | OnDemand[Item]":
        """Make an element; several are as little made as they all are."""
        numbers = range(self._count)[place]
        if isinstance(numbers, int):
            return self._make(numbers)
        of = numbers
        return OnDemand(len(of), lambda i: self._make(of[i]))
