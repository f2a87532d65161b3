"""A flight as a factor graph: states, constants, measurements, motion, and their factors.

Owns the statement of every measurement: one file of ``factors`` holds one sensor's residual and
Jacobian, and GTSAM, the batch, innovations and reports all read that one.
"""

from typing import Any

from fgnav.graph.keys import Timeline, angular_motion, constant, imu_bias, pose, velocity

__all__ = [
    "Timeline",
    "angular_motion",
    "constant",
    "imu_bias",
    "pose",
    "residual_factor",
    "velocity",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Load what brings GTSAM when it is first used."""
    if name != "residual_factor":
        msg = f"module 'fgnav.graph' has no attribute {name!r}"
        raise AttributeError(msg)
    from fgnav.graph.custom import residual_factor  # noqa: PLC0415  # lazy: gtsam

    return residual_factor
