"""Ways from a flight to an estimate, found by name.

A method is a frozen dataclass with ``name`` and ``__call__(flight) -> Estimate``; those that use
carrier phase take a ``resolver``. Third parties add their own through the entry-point group
``fgnav.methods``: a callable that takes ``resolver`` and returns an ``Estimator``.
"""

from fgnav import plugins
from fgnav.estimate import Estimator
from fgnav.integers.resolver import Resolver

GROUP = "fgnav.methods"
METHODS = {
    "closed-form": "fgnav.methods.closed_form:ClosedForm",
    "maximum-likelihood": "fgnav.methods.maximum_likelihood:MaximumLikelihood",
    "smoother": "fgnav.methods.smoother:Smoother",
    "batch": "fgnav.methods.smoother:Batch",
    "rtk": "fgnav.methods.rtk:Rtk",
}


def method_names() -> tuple[str, ...]:
    """Return the names of all methods: the library's own, then installed ones."""
    return plugins.names(GROUP, METHODS)


def method_named(name: str, resolver: Resolver) -> Estimator:
    """Return the method of that name.

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.
    """
    factory = plugins.named(GROUP, METHODS, name, kind="method")
    estimator: Estimator = factory(resolver=resolver)
    return estimator
