"""From a flight to its double differences and their integers, computed once."""

from weakref import WeakKeyDictionary

from fgnav.checks import BadInputError
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
        If the resolver has no causal form, or answers for other links than it was asked.
    """
    if causal:
        resolver = causal_form(resolver)
        differences = double_differences(flight, causal=True)
    else:
        differences = double_differences(flight)
    try:
        hash(resolver)
    except TypeError:
        return differences, _answer(resolver, differences, flight)
    cached = _RESOLVED.setdefault(flight, {})
    key = (resolver, causal)
    if key not in cached:
        cached[key] = _answer(resolver, differences, flight)
    return differences, cached[key]


def _answer(resolver: Resolver, differences: DoubleDifferences, flight: Flight) -> Integers:
    integers = resolver(differences, flight)
    if integers.fixed.shape != differences.phase_m.shape:
        name = getattr(resolver, "name", type(resolver).__name__)
        raise BadInputError(
            f"resolver {name}: answers for (epochs, baselines, channels) {integers.fixed.shape}, "
            f"asked for {differences.phase_m.shape}"
        )
    return integers
