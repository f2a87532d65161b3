"""Aerodynamic angles of a finned body, at times at which they are independent."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph.correlation import apart, inflation, interval_s
from fgnav.graph.factors.vehicle.aerodynamic_angles import MEAN, WIND, AerodynamicAngles
from fgnav.graph.types.parameters import Parameter, flight_constant
from fgnav.types.vehicle import FinnedVehicle, WheeledVehicle

_WIDEST_RAD = 0.5  # the tangent of an angle is linear to a tenth below


def airflow(
    vehicle: FinnedVehicle | WheeledVehicle | None, t_s: FloatArray, v_n_mps: FloatArray
) -> tuple[AerodynamicAngles | None, tuple[Parameter, ...]]:
    """Return angles of keyframes, (n,), of about these velocities, (n, 3), wind and mean angles.

    Not where the body is so slow that air may flow from anywhere; None without fins.
    """
    if not isinstance(vehicle, FinnedVehicle):
        return None, ()
    angles_rad = np.array([vehicle.sideslip_sigma_rad, vehicle.attack_sigma_rad])
    speed_mps = np.linalg.norm(v_n_mps, axis=1)
    air_mps = np.hypot(vehicle.wind_sigma_mps, vehicle.crossflow_sigma_mps)
    fast = np.isfinite(speed_mps) & (speed_mps * _WIDEST_RAD > air_mps)
    between_s = interval_s(vehicle.half_life_s)
    row = np.flatnonzero(fast)
    row = row[apart(t_s[row], between_s)]
    crossflow_rad = vehicle.crossflow_sigma_mps / speed_mps[row]
    varying_rad2 = (1.0 - vehicle.constant_share) * angles_rad**2 + crossflow_rad[:, None] ** 2
    sigma_rad = np.sqrt(inflation(vehicle.half_life_s, between_s) * varying_rad2)
    mean_sigma_rad = np.sqrt(vehicle.constant_share) * angles_rad
    wind = flight_constant(WIND, ("north", "east"), "m/s", vehicle.wind_sigma_mps)
    mean = flight_constant(MEAN, ("sideslip", "attack"), "rad", mean_sigma_rad)
    return AerodynamicAngles(row=row, sigma_rad=sigma_rad), (wind, mean)
