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


def interpolate_tensors(at_s: FloatArray, t_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return values, (m, ...), at other times, (k, ...), linearly; ends beyond them."""
    after = np.searchsorted(t_s, at_s).clip(1, len(t_s) - 1)
    share = ((at_s - t_s[after - 1]) / (t_s[after] - t_s[after - 1])).clip(0.0, 1.0)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[after - 1] + share * (values[after] - values[after - 1]))


def corrected_integral(t_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return the integral of samples, (m, ...), from the first to each: corrected trapezoids."""
    step_s = np.diff(t_s).reshape(-1, *[1] * (values.ndim - 1))
    slope = np.gradient(values, t_s, axis=0)
    parts = (values[1:] + values[:-1]) / 2 * step_s + step_s**2 / 12 * (slope[:-1] - slope[1:])
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(parts, axis=0)])
