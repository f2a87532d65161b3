"""When fins hold a body's nose in the wind: as often as its sideslip is another one."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.correlation import apart, inflation, interval_s
from fgnav.graph.factors.vehicle.aerodynamic_angles import MEAN, WIND
from fgnav.graph.types.constants import FlightConstant, flight_constant
from fgnav.types.vehicle import FinnedVehicle

_WIDEST_RAD = 0.5  # the tangent of an angle is linear to a tenth below


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Airflow:
    """Keyframes at which fins constrain the attitude, (k,)."""

    row: IntArray  # (k,)
    sigma_rad: FloatArray  # (k, 2): of sideslip and angle of attack about their mean
    # North and east, m/s; mean sideslip and angle of attack, rad.
    wind: FlightConstant
    mean: FlightConstant


def airflow(vehicle: FinnedVehicle, t_s: FloatArray, v_n_mps: FloatArray) -> Airflow:
    """Return when fins constrain keyframes, (n,), of about these velocities, (n, 3).

    Not where the body is so slow that air may flow from anywhere.
    """
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
    return Airflow(
        row=row,
        sigma_rad=sigma_rad,
        wind=flight_constant(WIND, ("north", "east"), "m/s", vehicle.wind_sigma_mps),
        mean=flight_constant(MEAN, ("sideslip", "attack"), "rad", mean_sigma_rad),
    )
