"""Released networks as sources of factors: ``--factors gravity`` and others to come."""

from pathlib import Path
from typing import Any

from fgnav.graph.keys import Timeline
from fgnav.graph.sourced import Sourced
from fgnav.types.flight import Flight

_FACTORS = Path(__file__).resolve().parents[1] / "factors"


def manifest(name: str) -> Path:
    """Return the manifest of a released factor, for ``NeuralFactor``, or ``--factors``."""
    return _FACTORS / f"{name}.json"


def gravity(flight: Flight, timeline: Timeline) -> Sourced:
    """Direction of gravity from accelerations and velocities of fixes, as of ``gravity-factor``.

    A stream takes ``NeuralFactor(manifest("gravity-factor"))``, one of its own.
    """
    from fgnav.neural.factor import NeuralFactor  # noqa: PLC0415  # lazy: gtsam, onnxruntime

    source: Any = NeuralFactor(manifest("gravity-factor"))
    made: Sourced = source(flight, timeline)
    return made
