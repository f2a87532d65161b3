"""Ways from a flight to an estimate, found by name.

A method is a frozen dataclass with ``name`` and ``__call__(flight) -> Estimate``; those that use
carrier phase take a ``resolver``, those in ``WITH_GRAVITY`` a ``gravity`` estimator, and words of
what to ``estimate`` with the flight, those in ``WITH_LAG`` a ``lag_s``. Third parties add their own
through the entry-point group ``fgnav.methods``: a callable that takes ``resolver`` and returns an
``Estimator``.
"""

from fgnav import plugins
from fgnav.estimate import Estimator
from fgnav.gravity import GravityEstimator
from fgnav.integers.resolver import Resolver

GROUP = "fgnav.methods"
METHODS = {
    "closed-form": "fgnav.methods.closed_form:ClosedForm",
    "maximum-likelihood": "fgnav.methods.maximum_likelihood:MaximumLikelihood",
    "smoother": "fgnav.methods.smoother:Smoother",
    "forward": "fgnav.methods.smoother:Forward",
    "batch": "fgnav.methods.smoother:Batch",
    "gtsam": "fgnav.methods.smoother:GtsamBatch",
    "rtk": "fgnav.methods.rtk:Rtk",
}
WITH_GRAVITY = ("smoother", "forward", "batch", "gtsam")
WITH_LAG = ("smoother",)


def method_named(
    name: str,
    resolver: Resolver,
    gravity: GravityEstimator | None = None,
    estimate: tuple[str, ...] = (),
    lag_s: float | None = None,
) -> Estimator:
    """Return the method of that name, with those of the options that it takes.

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.
    """
    factory = plugins.named(GROUP, METHODS, name, kind="method")
    options: dict[str, object] = {}
    if name in WITH_GRAVITY:
        options |= {"gravity": gravity} if gravity is not None else {}
        options |= {"estimate": estimate} if estimate else {}
    if name in WITH_LAG:
        options |= {"lag_s": lag_s} if lag_s is not None else {}
    estimator: Estimator = factory(resolver=resolver, **options)
    return estimator
