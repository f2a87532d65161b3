"""Sources of factors of one's own: callables, names of installed ones, manifests of networks."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fgnav import plugins
from fgnav.checks import BadInputError, Loss
from fgnav.graph.keys import Timeline
from fgnav.graph.sourced import Sourced
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.types.flight import Flight

if TYPE_CHECKING:
    import gtsam

    from fgnav.graph.custom import OwnFactor

FACTORS = "fgnav.factors"  # entry points

FactorSource = Callable[[Flight, Timeline], "Iterable[gtsam.NonlinearFactor | OwnFactor]"]


@dataclass(frozen=True, eq=False, slots=True)
class OwnFactors:
    """Factors of one's own, each with its name, and what their sources report."""

    factors: "tuple[OwnFactor, ...]" = ()
    losses: tuple[Loss, ...] = ()
    notes: tuple[str, ...] = ()


def own_factors(
    sources: tuple[FactorSource | str, ...], flight: Flight, problem: SmoothingProblem
) -> OwnFactors:
    """Return the factors that sources and the flight's networks make, and what they leave out."""
    if not (sources or flight.networks):
        return OwnFactors()
    from fgnav.graph.custom import named  # noqa: PLC0415  # lazy: gtsam

    timeline = Timeline(t_s=problem.t_s, gyroscope=problem.motion.aux == 6)
    made: list[OwnFactor] = []
    losses: list[Loss] = []
    notes: list[str] = []
    for source in with_networks(sources, flight.networks):
        factors = source(flight, timeline)
        if not isinstance(factors, Iterable):
            what = getattr(source, "__name__", type(source).__name__)
            raise BadInputError(f"source of factors {what}: must yield factors, got {factors!r}")
        made += map(named, factors)
        if isinstance(factors, Sourced):
            losses += factors.losses
            notes += factors.notes
    return OwnFactors(tuple(made), tuple(losses), tuple(notes))


def with_networks(sources: tuple[Any, ...], manifests: tuple[Path, ...]) -> tuple[Any, ...]:
    """Return sources of a flight's factors, or a stream's, and manifests that are not among them.

    A network counts once: who gives its ``NeuralFactor`` takes the place of the flight's.
    """
    given = tuple(map(factor_source, sources))
    stated = {one.manifest.resolve() for one in given if hasattr(one, "manifest")}
    return *given, *(factor_source(str(m)) for m in manifests if m.resolve() not in stated)


def factor_source(source: FactorSource | str) -> FactorSource:
    """Return a source of factors, an installed one by its name, a network by its manifest."""
    if not isinstance(source, str):
        return source
    if Path(source).suffix in (".toml", ".json"):
        from fgnav.neural.factor import NeuralFactor  # noqa: PLC0415  # lazy: gtsam, onnxruntime

        return NeuralFactor(source)
    loaded: FactorSource = plugins.named(FACTORS, {}, source, kind="source of factors")
    return loaded
