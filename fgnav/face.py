"""Functions of ``import fgnav`` beside its types: methods by name, comparisons, a plot."""

from collections.abc import Iterable, Mapping
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any, TypeAlias, overload

import numpy as np

from fgnav.checks import BadInputError
from fgnav.evaluation.ablation import restricted
from fgnav.evaluation.comparison import Comparison, Watch
from fgnav.evaluation.comparison import compare as compare_one
from fgnav.evaluation.flights import FlightsComparison, compare_flights
from fgnav.gravity import GravityEstimator, gravity_named
from fgnav.integers.resolvers.registry import DEFAULT, resolver_named
from fgnav.methods import Options, method_named
from fgnav.types.estimate import Estimate, Estimator
from fgnav.types.flight import Flight, Truth
from fgnav.types.integers import Resolver

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BAND = 3.0  # standard deviations


def method(
    name: str,
    *,
    integers: Resolver | str = DEFAULT,
    gravity: GravityEstimator | str | None = None,
    **options: Any,  # noqa: ANN401
) -> Estimator:
    """Return a method as the command line has it.

    Parameters
    ----------
    name : str
        ``"smoother"``; ``fgnav methods`` lists them.
    integers : Resolver or str
    gravity : GravityEstimator or str, optional
    **options
        The others of ``fgnav.methods.Options``: ``noise``, ``lag_s``, ``factors``, ``estimate``.

    Returns
    -------
    Estimator

    Examples
    --------
    >>> import fgnav
    >>> fgnav.method("smoother", integers="lambda", lag_s=2.0).lag_s
    2.0
    """
    resolver = resolver_named(integers) if isinstance(integers, str) else integers
    source = gravity_named(gravity) if isinstance(gravity, str) else gravity
    return method_named(name, resolver, Options(gravity=source, **options))


Methods: TypeAlias = Iterable[Estimator | str] | Mapping[str, Estimator | str]


@overload
def compare(flights: Flight, methods: Methods, *, watch: Watch = ...) -> Comparison: ...
@overload
def compare(
    flights: Iterable[Flight] | Mapping[str, Flight], methods: Methods, *, watch: Watch = ...
) -> FlightsComparison: ...
def compare(
    flights: Flight | Iterable[Flight] | Mapping[str, Flight],
    methods: Methods,
    *,
    watch: Watch = nullcontext,
) -> Comparison | FlightsComparison:
    """Run methods on a flight, or on several, and judge them.

    Parameters
    ----------
    flights : Flight, or iterable of Flight, or mapping of str to Flight
        Tables call several by their names, or by those of the mapping.
    methods : iterable of Estimator or str, or mapping of str to these
        By name as on the command line, or anything that turns a flight into an estimate; the names
        of a mapping are those of tables.
    watch : callable
        From a method's name to a context that it runs in, for progress.

    Returns
    -------
    Comparison or FlightsComparison
        Of one flight, or of several.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> comparison = fgnav.compare(flight, ["maximum-likelihood", "rtk"])
    >>> comparison["rtk"].score.attitude_rmse_deg < 2.0
    True
    """
    if isinstance(methods, Mapping):
        estimators: list[Estimator] = [
            restricted(label, _estimator(method), ()) for label, method in methods.items()
        ]
    else:
        estimators = [_estimator(method) for method in methods]
    if isinstance(flights, Flight):
        return compare_one(flights, estimators, watch=watch)
    if isinstance(flights, Mapping):
        return compare_flights(flights.items(), estimators, watch=watch)
    pairs = ((flight.name, flight) for flight in flights)
    return compare_flights(pairs, estimators, watch=watch)


def _estimator(estimator: Estimator | str) -> Estimator:
    return method(estimator) if isinstance(estimator, str) else estimator


def plot(*estimates: Estimate, truth: Truth | None = None) -> "Figure":
    """Draw estimates over time: errors where there is a truth, each within its own three sigma.

    Parameters
    ----------
    *estimates : Estimate
    truth : Truth, optional

    Returns
    -------
    matplotlib.figure.Figure
        Roll, pitch and yaw; position and velocity where all have them.

    Raises
    ------
    BadInputError
        If there is no estimate.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> figure = fgnav.plot(fgnav.method("rtk")(flight), truth=flight.truth)
    >>> figure.axes[0].get_title()
    'error of roll, deg'
    """
    from matplotlib.figure import Figure  # noqa: PLC0415  # lazy

    if not estimates:
        raise BadInputError("plot: no estimates; pass one or more")
    shown: list[Any] = [
        estimate if truth is None else estimate.errors(truth) for estimate in estimates
    ]
    position, velocity = (
        ("p_n_m", "v_n_mps") if truth is None else ("position_n_m", "velocity_n_mps")
    )
    rows = [
        ("deg", "euler_deg", "sigma_deg", ("roll", "pitch", "yaw")),
        ("m", position, "position_sigma_m", ("north", "east", "down")),
        ("m/s", velocity, "velocity_sigma_mps", ("north", "east", "down")),
    ]
    rows = [
        panels for panels in rows if all(getattr(chart, panels[1]) is not None for chart in shown)
    ]
    figure = Figure(figsize=(10, 2.2 * len(rows)), layout="constrained")
    for panels, (unit, value, sigma, names) in zip(
        figure.subplots(len(rows), 3, sharex=True, squeeze=False), rows, strict=True
    ):
        for k, (axes, name) in enumerate(zip(panels, names, strict=True)):
            axes.set_title(f"{name}, {unit}" if truth is None else f"error of {name}, {unit}")
            for estimate, chart in zip(estimates, shown, strict=True):
                y, half = getattr(chart, value)[:, k], getattr(chart, sigma)
                (line,) = axes.plot(chart.t_s, y, label=estimate.method)
                if half is not None:
                    middle = y if truth is None else np.zeros_like(y)
                    band = _BAND * half[:, k]
                    axes.fill_between(
                        chart.t_s, middle - band, middle + band, color=line.get_color(), alpha=0.2
                    )
    figure.supxlabel("time, s")
    figure.axes[0].legend()
    return figure
