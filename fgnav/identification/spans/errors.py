"""What errors of the inertial unit add to its samples, by one number or three."""

from dataclasses import replace
from typing import Any

import numpy as np

from fgnav.checks import FloatArray
from fgnav.identification.likelihood.span_offsets import UNIT
from fgnav.identification.noise.begin import WHITE
from fgnav.types.flight import Imu

SAMPLES = {"accelerometer": "f_b_mps2", "gyroscope": "w_b_radps"}
DRIFT = "drift"  # of a bias, over all of a record


def sensors_of(sensor: str, imu: Imu) -> tuple[str, ...]:
    """Return the sensors that an error of one, or of the unit, is of."""
    names = tuple(one for one in WHITE if getattr(imu, SAMPLES[one]) is not None)
    return names if sensor == UNIT else (sensor,)


def added(shape: str, x: FloatArray, u: FloatArray, t_s: FloatArray) -> FloatArray:
    """Return what an error adds to samples x of times t_s, (n, 3).

    Parameters
    ----------
    shape : str
        Of ``span_offsets.SHAPES``; a drift, which is u in all; late by a time u.
    x, u, t_s : ndarray, shapes (n, 3), (3,) or (1,), (n,)
    """
    if shape == "offset":
        return np.broadcast_to(u, x.shape)
    if shape == DRIFT:
        return np.outer((t_s - t_s[[0, -1]].mean()) / (t_s[-1] - t_s[0]), u)
    if shape == "scale":
        return x * u
    if shape == "turn":
        return np.cross(x, u)
    in_time: FloatArray = np.stack([np.interp(t_s + u[0], t_s, one) for one in x.T], axis=1)
    return np.asarray(x - in_time)


def without(imu: Imu, sensor: str, shape: str, by: FloatArray) -> Imu:
    """Return a unit without an error of a sensor, or of both."""
    changed: dict[str, Any] = {}
    for one in sensors_of(sensor, imu):
        x = getattr(imu, SAMPLES[one])
        changed[SAMPLES[one]] = x - added(shape, x, by, imu.t_s)
    return replace(imu, **changed)
