"""From a flight to its double differences and their integers, computed once."""

from weakref import WeakKeyDictionary

from fgnav.flight import Flight
from fgnav.gnss.difference import double_differences
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.resolver import Integers, Resolver

_RESOLVED: WeakKeyDictionary[Flight, dict[Resolver, Integers]] = WeakKeyDictionary()


def resolve(flight: Flight, resolver: Resolver) -> tuple[DoubleDifferences, Integers]:
    """Return a flight's double differences and what a resolver makes of them.

    Methods that share a resolver share its work: integers are kept as long as the flight lives, for
    resolvers that hash, such as frozen dataclasses.

    Parameters
    ----------
    flight : Flight
    resolver : Resolver

    Returns
    -------
    DoubleDifferences, Integers
    """
    differences = double_differences(flight)
    try:
        hash(resolver)
    except TypeError:
        return differences, resolver(differences, flight)
    known = _RESOLVED.setdefault(flight, {})
    if resolver not in known:
        known[resolver] = resolver(differences, flight)
    return differences, known[resolver]
