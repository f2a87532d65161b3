"""What errors of the inertial unit add to its samples, by three numbers each."""

from dataclasses import replace
from typing import Any

import numpy as np

from fgnav.checks import FloatArray
from fgnav.identification.likelihood.span_offsets import SHAPES
from fgnav.identification.noise.begin import WHITE
from fgnav.types.flight import Imu

SAMPLES = {"accelerometer": "f_b_mps2", "gyroscope": "w_b_radps"}
DRIFT = "drift"  # of a bias, over all of a record
# 1-sigma where next to nothing is known: of biases, and drifts in all, m/s2 and rad/s, and of
# scales, and turns in rad.
ANY_BIAS = {"accelerometer": 10.0, "gyroscope": 1.0}
ANY_SHARE = 0.3
ERRORS = tuple((sensor, shape) for sensor in WHITE for shape in (*SHAPES, DRIFT))


def added(shape: str, x: FloatArray, u: FloatArray, t_s: FloatArray) -> FloatArray:
    """Return what an error adds to samples, (n, 3).

    Parameters
    ----------
    shape : str
        Of ``span_offsets.SHAPES``, or a drift by u a second from the first sample on.
    x, u, t_s : ndarray, shapes (n, 3), (3,), (n,)
        Samples, the error's numbers, times.
    """
    if shape == "offset":
        return np.broadcast_to(u, x.shape)
    if shape == DRIFT:
        return np.outer(t_s - t_s[0], u)
    return x * u if shape == "scale" else np.asarray(np.cross(x, u))


def without(imu: Imu, sensor: str, shape: str, by: FloatArray) -> Imu:
    """Return a unit without an error of a sensor, by numbers (3,)."""
    x = getattr(imu, SAMPLES[sensor])
    changed: dict[str, Any] = {SAMPLES[sensor]: x - added(shape, x, by, imu.t_s)}
    return replace(imu, **changed)
