"""Samples of an inertial unit without their noise: what derivatives by its constants are made of.

A difference of samples that a constant moves in time, as a clock does, is that of the motion and of
their noise, and squares of the latter look like information about the constant: a step of it then
falls short, by all of it where the motion is slow beside the noise. Of n samples those cosines are
kept that are larger than any of white noise [1]_, sigma sqrt(2 ln n), sigma as stated or, if that
is more, by the record's own sixth differences.

References
----------
.. [1] Donoho, Johnstone: Ideal spatial adaptation by wavelet shrinkage, Biometrika 81(3), 1994:
   the universal threshold.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.fft import dct, idct
from scipy.special import comb

from fgnav.checks import FloatArray
from fgnav.identification.spans.errors import SAMPLES
from fgnav.types.flight import Imu

ORDER = 6  # of differences: of a turn of 2 Hz at 50 Hz they leave 1e-5
NORMAL = 1.4826  # sigma of normal noise over its median size


def denoised(imu: Imu) -> Imu:
    """Return a unit whose samples are the cosines that no white noise has."""
    interval_s = float(np.median(np.diff(imu.t_s))) if len(imu.t_s) > 1 else np.inf
    stated = {
        "accelerometer": imu.accelerometer_noise_mps2_per_sqrt_hz,
        "gyroscope": imu.gyroscope_noise_radps_per_sqrt_hz or 0.0,
    }
    changed: dict[str, Any] = {}
    for sensor, name in SAMPLES.items():
        x = getattr(imu, name)
        if x is not None and len(x) > 2 * ORDER:
            changed[name] = _kept(x, stated[sensor] / np.sqrt(interval_s))
    return replace(imu, **changed)


def _kept(x: FloatArray, least: float) -> FloatArray:
    sixth = np.abs(np.diff(x, ORDER, axis=0)) / np.sqrt(comb(2 * ORDER, ORDER))
    sigma = np.maximum(least, NORMAL * np.median(sixth, axis=0))
    size = dct(x, axis=0, norm="ortho")
    size[np.abs(size) < sigma * np.sqrt(2.0 * np.log(len(x)))] = 0.0
    return np.asarray(idct(size, axis=0, norm="ortho"))
