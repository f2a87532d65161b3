"""Vectors between samples, on straight lines; and their integrals."""

import numpy as np

from fgnav.checks import FloatArray


def interpolate(
    t_s: FloatArray, samples_s: FloatArray, values: FloatArray, *, causal: bool = False
) -> FloatArray:
    """Return values, (k, d) at samples, (k,), at other times, (n, d); causal, the last sample's.

    Beyond the first and the last sample they stay as they are there.
    """
    if causal:
        return np.asarray(values[(np.searchsorted(samples_s, t_s, side="right") - 1).clip(0)])
    return np.stack([np.interp(t_s, samples_s, column) for column in values.T], axis=1)


def integral(t_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return the integral of samples, (k, d), from the first to each."""
    steps = (values[1:] + values[:-1]) / 2 * np.diff(t_s)[:, None]
    return np.vstack([np.zeros(values.shape[1]), np.cumsum(steps, axis=0)])
