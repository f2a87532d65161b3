"""Released networks as sources of factors: ``--factors gravity,velocity``."""

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
    return _made("gravity-factor", flight, timeline)


def velocity(flight: Flight, timeline: Timeline) -> Sourced:
    """Velocity in body axes from four seconds of a MEMS inertial unit, as of ``velocity``."""
    return _made("velocity", flight, timeline)


def _made(name: str, flight: Flight, timeline: Timeline) -> Sourced:
    from fgnav.neural.factor import NeuralFactor  # noqa: PLC0415  # lazy: gtsam, onnxruntime

    source: Any = NeuralFactor(manifest(name))
    made: Sourced = source(flight, timeline)
    return made
