"""Released networks as factors: ``--factors gravity,velocity`` takes their manifests."""

from pathlib import Path

_FACTORS = Path(__file__).resolve().parents[1] / "factors"


def manifest(name: str) -> Path:
    """Return the manifest of a released factor, for ``NeuralFactor``, or ``--factors``."""
    return _FACTORS / f"{name}.json"


gravity = manifest("gravity")  # its direction, from accelerations and fixes' velocities
gravity_accelerometer = manifest("gravity-accelerometer")  # the same from accelerations alone
velocity = manifest("velocity")  # in body axes, from four seconds of a MEMS inertial unit
