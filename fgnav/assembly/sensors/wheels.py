"""Constraints of wheels on lateral velocity, once a second.

Tyres slip for a second or so at a time; more often the same slip would be counted again and again.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph.factors.vehicle.wheels import AXES, AXLE, RollingWheels
from fgnav.graph.types.parameters import Parameter, flight_constant
from fgnav.types.flight import Imu
from fgnav.types.vehicle import FinnedVehicle, WheeledVehicle

_EVERY_S = 1.0


def wheels(
    vehicle: WheeledVehicle | FinnedVehicle | None,
    imu: Imu,
    t_s: FloatArray,
    measured_b_radps: FloatArray | None,
    earth_rate_n_radps: FloatArray,
) -> tuple[RollingWheels | None, tuple[Parameter, ...]]:
    """Return wheels at keyframes, (n,), their axes and their axle; None without wheels.

    ``measured_b_radps``, (n, 3), are the gyroscope's rates there; None without one.
    """
    if not isinstance(vehicle, WheeledVehicle):
        return None, ()
    second = np.floor((t_s - t_s[0]) / _EVERY_S).astype(np.int64)
    row = np.flatnonzero(np.diff(second, prepend=-1) > 0)
    rolling = RollingWheels(
        row=row,
        slip_mps=vehicle.slip_mps,
        arm_b_m=vehicle.position_b_m - imu.position_b_m,
        measured_b_radps=None if measured_b_radps is None else measured_b_radps[row],
        earth_rate_n_radps=earth_rate_n_radps,
    )
    axes = flight_constant(AXES, ("y", "z"), "rad", vehicle.axes_sigma_rad)
    axle = flight_constant(AXLE, ("x", "y", "z"), "m", vehicle.position_sigma_m)
    return rolling, (axes, axle)
