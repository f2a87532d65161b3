"""Resolvers by name, the library's own and installed ones.

Third parties add theirs through the entry-point group ``fgnav.resolvers``: a callable without
arguments that returns a ``Resolver``.
"""

from importlib import import_module
from importlib.metadata import entry_points

from fgnav.checks import BadInputError
from fgnav.integers.resolver import Resolver

RESOLVERS = {
    "rounding": "fgnav.integers.rounding:Rounding",
    "lambda": "fgnav.integers.lambda_:Lambda",
    "truth": "fgnav.integers.truth:Truth",
}


def resolver_names() -> tuple[str, ...]:
    """Return the names of all resolvers: the library's own, then installed ones."""
    installed = (e.name for e in entry_points(group="fgnav.resolvers"))
    return (*RESOLVERS, *(name for name in installed if name not in RESOLVERS))


def resolver_named(name: str) -> Resolver:
    """Return the resolver of that name, as it is by default.

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.
    """
    if name in RESOLVERS:
        module, _, attribute = RESOLVERS[name].partition(":")
        factory = getattr(import_module(module), attribute)
    else:
        found = [e for e in entry_points(group="fgnav.resolvers") if e.name == name]
        if not found:
            raise BadInputError(f"integers {name!r}: not one of {', '.join(resolver_names())}")
        factory = found[0].load()
    resolver: Resolver = factory()
    return resolver
