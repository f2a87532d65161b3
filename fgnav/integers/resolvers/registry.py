"""Resolvers by name, the library's own and installed ones.

Third parties add theirs through the entry-point group ``fgnav.resolvers``: a callable without
arguments that returns a ``Resolver``.
"""

from fgnav import plugins
from fgnav.types.integers import Resolver

GROUP = "fgnav.resolvers"
RESOLVERS = {
    "rounding": "fgnav.integers.resolvers.rounding:Rounding",
    "lambda": "fgnav.integers.resolvers.lambda_:Lambda",
    "constrained": "fgnav.integers.resolvers.constrained:Constrained",
    "lambda-arcs": "fgnav.integers.arcs.resolver:lambda_arcs",
    "constrained-arcs": "fgnav.integers.arcs.resolver:constrained_arcs",
    "truth": "fgnav.integers.resolvers.truth:Truth",
}
_WITH_NETWORK, _WITHOUT = "network-arcs", "constrained-arcs"
# Of those that accept by a probability those that fix most: by a network's, measured to be wrong no
# more often than ``constrained``, where it is installed. ``lambda`` accepts everything.
DEFAULT = _WITH_NETWORK if _WITH_NETWORK in plugins.names(GROUP, RESOLVERS) else _WITHOUT


def default_resolver() -> Resolver:
    """Return the resolver of who asks for none."""
    return resolver_named(DEFAULT)


def resolver_names() -> tuple[str, ...]:
    """Return the names of all resolvers: the library's own, then installed ones."""
    return plugins.names(GROUP, RESOLVERS)


def resolver_named(name: str) -> Resolver:
    """Return the resolver of that name, as it is by default.

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.
    """
    resolver: Resolver = plugins.named(GROUP, RESOLVERS, name, kind="integers")()
    return resolver
