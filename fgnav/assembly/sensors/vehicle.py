"""Constraints of a vehicle: of its wheels, of the air along its fins, and at standstill."""

import numpy as np

from fgnav.assembly.sensors.standstill import WINDOW_S, Standing
from fgnav.checks import FloatArray
from fgnav.graph.correlation import apart, inflation, interval_s
from fgnav.graph.factors.vehicle.aerodynamic_angles import MEAN, WIND, AerodynamicAngles
from fgnav.graph.factors.vehicle.resting_rate import RestingRate
from fgnav.graph.factors.vehicle.wheels import AXES, AXLE, RollingWheels
from fgnav.graph.types.parameters import Parameter, flight_constant
from fgnav.types.flight import Imu
from fgnav.types.vehicle import FinnedVehicle, WheeledVehicle

_EVERY_S = 1.0
_WIDEST_RAD = 0.5  # the tangent of an angle is linear to a tenth below
_MINIMUM = 5  # differences, by which a sigma is known to a third


def wheels(
    vehicle: WheeledVehicle,
    imu: Imu,
    t_s: FloatArray,
    measured_b_radps: FloatArray | None,
    earth_rate_n_radps: FloatArray,
) -> tuple[RollingWheels, tuple[Parameter, ...]]:
    """Return constraints on lateral velocity at keyframes, (n,), axes of the wheels and axle.

    Tyres slip for a second or so at a time: more often than once a second the same slip would be
    counted again. ``measured_b_radps``, (n, 3), are the gyroscope's rates; None without one.
    """
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


def airflow(
    vehicle: FinnedVehicle, t_s: FloatArray, v_n_mps: FloatArray
) -> tuple[AerodynamicAngles, tuple[Parameter, ...]]:
    """Return aerodynamic angles at keyframes, (n,), that are independent, wind and mean angles.

    Of about these velocities, (n, 3); not where a body is so slow that air may come from anywhere.
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
    wind = flight_constant(WIND, ("north", "east"), "m/s", vehicle.wind_sigma_mps)
    mean = flight_constant(MEAN, ("sideslip", "attack"), "rad", mean_sigma_rad)
    return AerodynamicAngles(row=row, sigma_rad=sigma_rad), (wind, mean)


def resting_rates(imu: Imu, stands: Standing, earth_rate_n_radps: FloatArray) -> RestingRate | None:
    """Return a gyroscope's means of seconds at standstill, and their sigma; None without any.

    Wheels do not let a vehicle turn that does not roll. Means of seconds at rest that follow one
    another differ by noise alone: half their mean square is its variance, of each axis, whatever a
    data sheet says (the Allan variance of a second; IEEE Std 952-1997, annex C). Causal: by the
    seconds up to each.
    """
    w_b_radps, row = imu.w_b_radps, stands.row
    if w_b_radps is None or not len(row):
        return None
    until_s = stands.until_s
    total = np.vstack([np.zeros(3), w_b_radps.cumsum(axis=0)])
    first = np.searchsorted(imu.t_s, until_s - WINDOW_S, side="right")
    last = np.searchsorted(imu.t_s, until_s, side="right")
    mean = (total[last] - total[first]) / (last - first)[:, None]
    follows = np.append(False, np.diff(until_s) < 1.5 * WINDOW_S)
    half = np.where(follows[:, None], np.diff(mean, axis=0, prepend=mean[:1]) ** 2 / 2, 0.0)
    until = np.arange(len(row)) if stands.causal else np.full(len(row), len(row) - 1)
    number = follows.cumsum()[until]
    variance = half.cumsum(axis=0)[until] / np.maximum(number, 1)[:, None]
    good = (number >= _MINIMUM) & (variance > 0).all(axis=1)
    if not good.any():
        return None
    return RestingRate(
        row=row[good],
        measured_b_radps=mean[good],
        sigma_radps=np.sqrt(variance[good]),
        earth_rate_n_radps=earth_rate_n_radps,
    )
