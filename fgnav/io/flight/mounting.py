"""How a unit's axes lie in the body."""

from collections.abc import Sequence

import numpy as np

from fgnav.checks import BadInputError, FloatArray, quoted
from fgnav.geometry.rotations import from_euler

FORWARD_RIGHT_DOWN = ("x", "y", "z")


def mounting(axes: Sequence[str], angles_deg: Sequence[float]) -> FloatArray:
    """Return R_bu, (3, 3): from the axes in which a unit's samples are to the body's.

    Parameters
    ----------
    axes : sequence of 3 str
        Which axis of the samples points forward, right and down: ``("-x", "y", "-z")``.
    angles_deg : sequence of 3 float
        Roll, pitch, yaw by which the unit, its axes so named, is turned against the body.

    Raises
    ------
    BadInputError
        If the axes are no right-handed triad.
    """
    P = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        name = axis.removeprefix("-")
        if name not in FORWARD_RIGHT_DOWN:
            raise BadInputError(f"imu axes: must be x, y, z, -x, -y or -z, got {quoted(axis)}")
        P[row, FORWARD_RIGHT_DOWN.index(name)] = -1.0 if axis.startswith("-") else 1.0
    if round(float(np.linalg.det(P))) != 1:  # 0: an axis twice; -1: left-handed
        raise BadInputError(
            f"imu axes: must be a right-handed triad such as -x, y, -z, got {', '.join(axes)}; "
            "look at the signs"
        )
    return np.asarray(from_euler(*np.radians(angles_deg)[:, None])[0] @ P)
