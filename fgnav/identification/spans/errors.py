"""What errors of the inertial unit add to its samples, by three numbers each, or by a matrix."""

from dataclasses import replace
from typing import Any

import numpy as np

from fgnav.checks import FloatArray
from fgnav.identification.likelihood.span_offsets import SHAPES
from fgnav.identification.noise.begin import WHITE
from fgnav.types.flight import Imu

SAMPLES = {"accelerometer": "f_b_mps2", "gyroscope": "w_b_radps"}
DRIFT = "drift"  # of a bias, over all of a record
MIX = "mix"  # of axes, by any matrix
# 1-sigma where next to nothing is known: of biases, and drifts in all, m/s2 and rad/s, and of
# scales, and turns in rad.
ANY_BIAS = {"accelerometer": 10.0, "gyroscope": 1.0}
ANY_SHARE = 0.3
ANY_MIX = float(np.sqrt(2 / 3))  # RMS entry of I - Q, Q any orthogonal matrix (Haar's measure)
NUMBERS = {MIX: 9}  # of an error; of all others 3
ERRORS = tuple((sensor, shape) for sensor in WHITE for shape in (*SHAPES, DRIFT))


def added(shape: str, x: FloatArray, u: FloatArray, t_s: FloatArray) -> FloatArray:
    """Return what an error adds to samples, (n, 3).

    Parameters
    ----------
    shape : str
        Of ``span_offsets.SHAPES``, a drift by u a second from the first sample on, or a mix of
        axes by the matrix U of rows u.
    x, u, t_s : ndarray, shapes (n, 3), (g,), (n,)
        Samples, the error's numbers, times.
    """
    if shape == MIX:
        return np.asarray(x @ u.reshape(3, 3).T)
    if shape == "offset":
        return np.broadcast_to(u, x.shape)
    if shape == DRIFT:
        return np.outer(t_s - t_s[0], u)
    return x * u if shape == "scale" else np.asarray(np.cross(x, u))


def further(shape: str, u: FloatArray, step: FloatArray) -> FloatArray:
    """Return what takes both out of samples, first u; of small ones their sum."""
    if shape != MIX:
        return u + step
    U, more = u.reshape(3, 3), step.reshape(3, 3)
    return np.asarray((U + more - more @ U).ravel())


def without(
    imu: Imu,
    sensor: str,
    shape: str,
    by: FloatArray,
    span_s: tuple[float, float] = (-np.inf, np.inf),
) -> Imu:
    """Return a unit without an error of a sensor, by numbers (g,), after one time up to another."""
    x, t_s = getattr(imu, SAMPLES[sensor]), imu.t_s
    inside = (t_s > span_s[0]) & (t_s <= span_s[1])
    right = x - added(shape, x, by, t_s)
    changed: dict[str, Any] = {SAMPLES[sensor]: np.where(inside[:, None], right, x)}
    return replace(imu, **changed)
