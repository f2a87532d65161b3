"""Sources of custom factors: callables, names of installed ones, manifests of networks."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import gtsam

from fgnav import plugins
from fgnav.assembly.prepared import PreparedFlight
from fgnav.checks import BadInputError, Unused
from fgnav.graph import keys
from fgnav.graph.custom import NamedFactor, named
from fgnav.graph.keys import Timeline
from fgnav.graph.sourced import Sourced
from fgnav.graph.types.parameters import Parameter
from fgnav.types.flight import Flight

FACTORS = "fgnav.factors"  # entry points

FactorSource = Callable[[Flight, Timeline], Iterable[gtsam.NonlinearFactor | NamedFactor]]


def custom_factors(
    sources: tuple[FactorSource | str, ...], flight: Flight, prepared: PreparedFlight
) -> tuple[PreparedFlight, Sourced]:
    """Return the factors that sources and the flight's networks make, and what they leave out.

    The flight is returned with the constants that they ask for.
    """
    if not (sources or flight.networks):
        return prepared, Sourced()
    problem, asking = prepared.problem, with_networks(sources, flight.networks)
    timeline = Timeline(t_s=problem.t_s, gyroscope=problem.gyroscope)
    made: list[NamedFactor] = []
    unused: list[Unused] = []
    notes: list[str] = []
    for source, of_source in with_timelines(asking, timeline, len(problem.constants.parts)):
        factors = source(flight, of_source)
        if not isinstance(factors, Iterable):
            what = getattr(source, "__name__", type(source).__name__)
            raise BadInputError(f"source of factors {what}: must yield factors, got {factors!r}")
        made += map(named, factors)
        if isinstance(factors, Sourced):
            unused += factors.unused
            notes += factors.notes
    asked = custom_constants(asking)
    prepared = prepared.changed(lambda problem: problem.with_constants(asked))
    networks = tuple(source.name for source in asking if hasattr(source, "manifest"))
    sourced = Sourced(
        factors=tuple(made), unused=tuple(unused), notes=tuple(notes), networks=networks
    )
    return prepared, sourced


def custom_constants(sources: Iterable[Any]) -> tuple[Parameter, ...]:
    """Return the constants that sources ask for, by an attribute, one source after another."""
    return tuple(parameter for source in sources for parameter in getattr(source, "constants", ()))


def with_timelines(
    sources: Iterable[Any], timeline: Timeline, first: int
) -> Iterator[tuple[Any, Timeline]]:
    """Yield sources, each with a timeline that has the keys of its constants, from number first."""
    for source in sources:
        count = len(custom_constants((source,)))
        yield (
            source,
            replace(timeline, constants=tuple(map(keys.constant, range(first, first + count)))),
        )
        first += count


def with_networks(sources: tuple[Any, ...], manifests: tuple[Path, ...]) -> tuple[Any, ...]:
    """Return sources of a flight's factors, or a stream's, and manifests that are not among them.

    A network counts once: who gives its ``NeuralFactor`` takes the place of the flight's.
    """
    given = tuple(map(factor_source, sources))
    stated = {source.manifest.resolve() for source in given if hasattr(source, "manifest")}
    return *given, *(factor_source(str(m)) for m in manifests if m.resolve() not in stated)


def factor_source(source: FactorSource | str) -> FactorSource:
    """Return a source of factors, an installed one by its name, a network by its manifest.

    What is installed under a name may be a source, or the path of a manifest.
    """
    if not isinstance(source, str):
        return source
    is_manifest = Path(source).suffix in (".toml", ".json")
    loaded: FactorSource | Path = (
        Path(source)
        if is_manifest
        else plugins.named(FACTORS, {}, source, kind="source of factors")
    )
    if not isinstance(loaded, Path):
        return loaded
    from fgnav.neural.factor import NeuralFactor  # noqa: PLC0415  # lazy: gtsam, onnxruntime

    return NeuralFactor(loaded)
