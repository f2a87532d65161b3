"""From a flight to its double differences and their integers, computed once."""

from weakref import WeakKeyDictionary

from fgnav.gnss.difference import double_differences
from fgnav.integers.resolvers.causal import causal_form
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers, Resolver

_Key = tuple[Resolver, bool]
_RESOLVED: WeakKeyDictionary[Flight, dict[_Key, Integers]] = WeakKeyDictionary()


def resolve(
    flight: Flight, resolver: Resolver, *, causal: bool = False
) -> tuple[DoubleDifferences, Integers]:
    """Return a flight's double differences and what a resolver makes of them.

    Methods that share a resolver share its work: integers are kept as long as the flight lives, for
    resolvers that hash, such as frozen dataclasses.

    Parameters
    ----------
    flight : Flight
    resolver : Resolver
    causal : bool
        Each epoch by epochs up to it alone, by the resolver's ``causal_form``.

    Returns
    -------
    DoubleDifferences, Integers

    Raises
    ------
    BadInputError
        If the resolver has no causal form.
    """
    if causal:
        resolver = causal_form(resolver)
        differences = double_differences(flight, causal=True)
    else:
        differences = double_differences(flight)
    try:
        hash(resolver)
    except TypeError:
        return differences, resolver(differences, flight)
    cached = _RESOLVED.setdefault(flight, {})
    key = (resolver, causal)
    if key not in cached:
        cached[key] = resolver(differences, flight)
    return differences, cached[key]
