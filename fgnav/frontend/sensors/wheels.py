"""When wheels constrain a vehicle not to move to the side: once a second while it is on them.

Tyres slip for a second or so at a time; more often the same slip would be counted again and again.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.factors.vehicle.wheels import AXES, AXLE
from fgnav.graph.types.constants import FlightConstant, flight_constant
from fgnav.types.flight import Imu
from fgnav.types.vehicle import WheeledVehicle

_EVERY_S = 1.0


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Wheels:
    """Keyframes at which wheels speak, (k,)."""

    row: IntArray  # (k,)
    slip_mps: float
    arm_b_m: FloatArray  # (3,): from the accelerometer to the axle
    # The turn from body axes to those in which wheels roll, about y and z; what ``arm_b_m`` lacks.
    axes: FlightConstant
    axle: FlightConstant


def wheels(vehicle: WheeledVehicle, imu: Imu, t_s: FloatArray) -> Wheels:
    """Return when a vehicle's wheels constrain keyframes, (n,)."""
    second = np.floor((t_s - t_s[0]) / _EVERY_S).astype(np.int64)
    return Wheels(
        row=np.flatnonzero(np.diff(second, prepend=-1) > 0),
        slip_mps=vehicle.slip_mps,
        arm_b_m=vehicle.position_b_m - imu.position_b_m,
        axes=flight_constant(AXES, ("y", "z"), "rad", vehicle.axes_sigma_rad),
        axle=flight_constant(AXLE, ("x", "y", "z"), "m", vehicle.position_sigma_m),
    )
