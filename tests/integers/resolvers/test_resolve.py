import gc
import weakref
from dataclasses import dataclass, field

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.integers.resolvers import resolve as module
from fgnav.integers.resolvers.resolve import resolve
from fgnav.integers.resolvers.rounding import Rounding
from fgnav.types.flight import Flight
from tests.integers.arrays import make


@dataclass(frozen=True)
class Counting:
    """Rounds, and counts how often."""

    label: str = "a"
    calls: list = field(default_factory=list, compare=False)
    name = "counting"

    def __call__(self, differences, flight):
        self.calls.append(flight.name)
        return Rounding()(differences, flight)


class Unhashable(Counting):
    """Cannot be a key."""

    __hash__ = None


@pytest.fixture
def flight(monkeypatch):
    made = make(np.random.default_rng(1))
    monkeypatch.setattr(module, "double_differences", lambda _: made.differences)
    return Flight(name="made", start_gps_s=0.0, origin=made.flight.origin)


def test_a_flight_is_resolved_once_by_each_resolver(flight):
    first, again, other = Counting(), Counting(), Counting("b")
    differences, integers = resolve(flight, first)
    assert resolve(flight, again) == (differences, integers)
    assert len(first.calls) == 1
    assert again.calls == []
    resolve(flight, other)
    assert len(other.calls) == 1


def test_unhashable_resolver_works_every_time(flight):
    resolver = Unhashable()
    resolve(flight, resolver)
    resolve(flight, resolver)
    assert len(resolver.calls) == 2


def test_integers_are_forgotten_with_the_flight(flight):
    copy = Flight(name="copy", start_gps_s=0.0, origin=flight.origin)
    _, integers = resolve(copy, Rounding())
    there = weakref.ref(copy)
    del copy
    gc.collect()
    assert there() is None
    assert integers.resolver == "rounding"


def test_an_answer_for_other_links_is_rejected_by_name(flight):
    def of_none(differences, of):
        return Rounding()(differences[np.array([], dtype=int)], of)

    with pytest.raises(BadInputError, match="resolver function: answers for"):
        resolve(flight, of_none)
