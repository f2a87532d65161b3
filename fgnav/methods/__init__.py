"""Ways from a flight to an estimate, found by name.

A method is a frozen dataclass with ``name`` and ``__call__(flight) -> Estimate``; those that use
carrier phase take a ``resolver``. Third parties add their own through the entry-point group
``fgnav.methods``: a callable that takes ``resolver`` and returns an ``Estimator``.
"""

from importlib import import_module
from importlib.metadata import entry_points

from fgnav.checks import BadInputError
from fgnav.estimate import Estimator
from fgnav.integers.resolver import Resolver

METHODS = {
    "closed-form": "fgnav.methods.closed_form:ClosedForm",
    "maximum-likelihood": "fgnav.methods.maximum_likelihood:MaximumLikelihood",
    "smoother": "fgnav.methods.smoother:Smoother",
    "batch": "fgnav.methods.smoother:Batch",
    "rtk": "fgnav.methods.rtk:Rtk",
}


def method_names() -> tuple[str, ...]:
    """Return the names of all methods: the library's own, then installed ones."""
    installed = (e.name for e in entry_points(group="fgnav.methods"))
    return (*METHODS, *(name for name in installed if name not in METHODS))


def method_named(name: str, resolver: Resolver) -> Estimator:
    """Return the method of that name.

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.
    """
    if name in METHODS:
        module, _, attribute = METHODS[name].partition(":")
        factory = getattr(import_module(module), attribute)
    else:
        found = [e for e in entry_points(group="fgnav.methods") if e.name == name]
        if not found:
            raise BadInputError(f"method {name!r}: not one of {', '.join(method_names())}")
        factory = found[0].load()
    estimator: Estimator = factory(resolver=resolver)
    return estimator
