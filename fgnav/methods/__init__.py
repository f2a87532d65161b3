"""Ways from a flight to an estimate, found by name.

A method is a frozen dataclass with ``name`` and ``__call__(flight) -> Estimate``; those that use
carrier phase take a ``resolver``, those in ``SMOOTHERS`` the ``Options``. Third parties add theirs
through the entry-point group ``fgnav.methods``: a callable that takes ``resolver`` and returns an
``Estimator``.
"""

from dataclasses import dataclass

from fgnav import plugins
from fgnav.gravity import GravityEstimator
from fgnav.lazy import lazy
from fgnav.types.estimate import Estimator
from fgnav.types.integers import Resolver

GROUP = "fgnav.methods"
METHODS = {
    "closed-form": "fgnav.methods.closed_form:ClosedForm",
    "closed-form-weighted": "fgnav.methods.closed_form:weighted",
    "maximum-likelihood": "fgnav.methods.maximum_likelihood:MaximumLikelihood",
    "smoother": "fgnav.methods.smoother:Smoother",
    "forward": "fgnav.methods.smoother:Forward",
    "batch": "fgnav.methods.smoother:Batch",
    "rtk": "fgnav.methods.rtk:Rtk",
}
SMOOTHERS = ("smoother", "forward", "batch")  # those that take all of ``Options``
WITH_GRAVITY = ("closed-form", "closed-form-weighted", *SMOOTHERS)  # and with factors
WITH_LAG = ("smoother", "forward")

__getattr__ = lazy(
    __name__,
    {
        "maximum_likelihood": ("MaximumLikelihood",),
        "stream": ("Measured", "Measurements", "StreamConfig"),
    },
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Options of smoothers; None and empty leave their defaults.

    Closed forms take gravity and factors.

    Attributes
    ----------
    gravity : GravityEstimator or None
    calibrate : tuple of str
    factors : tuple of str or None
        Names of installed sources of factors; empty: none, not the gravity network either.
    causal : bool
        Of the smoother alone: the others are what they are.
    noise : {"estimated", "nominal"} or None
    lag_s : float or None
        Of those in ``WITH_LAG``.
    """

    gravity: GravityEstimator | None = None
    calibrate: tuple[str, ...] = ()
    factors: tuple[str, ...] | None = None
    causal: bool = False
    noise: str | None = None
    lag_s: float | None = None

    def of(self, name: str) -> dict[str, object]:
        """Return the arguments of the method of that name."""
        if name not in WITH_GRAVITY:
            return {}
        wanted: dict[str, object] = {"gravity": self.gravity, "factors": self.factors}
        if name in SMOOTHERS:
            wanted |= {
                "calibrate": self.calibrate or None,
                "causal": True if self.causal and name == "smoother" else None,
                "noise": self.noise,
                "lag_s": self.lag_s if name in WITH_LAG else None,
            }
        return {option: value for option, value in wanted.items() if value is not None}


def method_named(
    name: str,
    resolver: Resolver,
    options: Options | None = None,
) -> Estimator:
    """Return the method of that name, with those of the options that it takes.

    Parameters
    ----------
    name : str
    resolver : Resolver
    options : Options, optional

    Returns
    -------
    Estimator

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.

    Examples
    --------
    >>> from fgnav.integers.resolvers.registry import resolver_named
    >>> from fgnav.methods import Options, method_named
    >>> method_named("smoother", resolver_named("lambda"), Options(lag_s=2.0)).lag_s
    2.0
    """
    factory = plugins.named(GROUP, METHODS, name, kind="method")
    estimator: Estimator = factory(resolver=resolver, **(options or Options()).of(name))
    return estimator
