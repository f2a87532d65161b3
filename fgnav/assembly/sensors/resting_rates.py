"""Gyroscope of a wheeled vehicle at standstill: means of seconds, and their sigma.

Wheels do not let a vehicle turn that does not roll. Means of seconds at rest that follow one
another differ by noise alone: half their mean square is its variance, of each axis, whatever a data
sheet says (the Allan variance of a second; IEEE Std 952-1997, annex C).
"""

import numpy as np

from fgnav.assembly.sensors.standstill import WINDOW_S, Standing
from fgnav.checks import FloatArray
from fgnav.graph.factors.vehicle.resting_rate import RestingRate
from fgnav.types.flight import Imu
from fgnav.types.vehicle import FinnedVehicle, WheeledVehicle

_FEWEST = 5  # differences, by which a sigma is known to a third


def resting_rates(
    vehicle: WheeledVehicle | FinnedVehicle | None,
    imu: Imu,
    stands: Standing,
    earth_rate_n_radps: FloatArray,
) -> RestingRate | None:
    """Return the rates at rest; None without wheels, gyroscope or rest.

    Causal: sigmas are by the seconds up to each.
    """
    w_b_radps, row = imu.w_b_radps, stands.row
    if not isinstance(vehicle, WheeledVehicle) or w_b_radps is None or not len(row):
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
    good = (number >= _FEWEST) & (variance > 0).all(axis=1)
    if not good.any():
        return None
    return RestingRate(
        row=row[good],
        measured_b_radps=mean[good],
        sigma_radps=np.sqrt(variance[good]),
        earth_rate_n_radps=earth_rate_n_radps,
    )
