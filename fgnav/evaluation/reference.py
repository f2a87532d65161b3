"""References of an epoch: the truth between its samples, or the same epoch of another estimate."""

from typing import Any

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry.interpolation import interpolate
from fgnav.integers.resolvers.truth import attitude_at
from fgnav.types.flight import TRUTH_SIGMAS, Truth

_SAME_EPOCH_S = 1e-6
_EDGE_S = 1e-3  # times are rounded in files: an epoch this far outside the span is its end
_GAP = 5.0  # an interval this many times the usual one is a gap: nothing is known inside it


def covered(truth: Truth, t_s: FloatArray) -> BoolArray:
    """Select epochs, (n,), inside the truth's time span and in none of its gaps."""
    times_s = truth.t_s
    if len(times_s) < 2:
        return np.asarray(np.isin(np.round(t_s / _EDGE_S), np.round(times_s / _EDGE_S)))
    before = _before(times_s, t_s)
    steps_s = np.diff(times_s)
    gap = steps_s[before] > _GAP * np.median(steps_s)
    at_sample = (
        np.minimum(np.abs(t_s - times_s[before]), np.abs(t_s - times_s[before + 1])) < _EDGE_S
    )
    inside = (t_s >= times_s[0] - _EDGE_S) & (t_s <= times_s[-1] + _EDGE_S)
    return np.asarray(inside & (~gap | at_sample))


def truth_at(truth: Truth, t_s: FloatArray) -> Truth:
    """Return the truth at covered epochs.

    Attitude turns about one axis at constant rate between two samples (the geodesic), position
    follows the cubic that matches position and velocity at both, velocity and sigmas straight. At a
    sample itself all three are exact.

    Parameters
    ----------
    t_s : ndarray, shape (n,)
        Epochs for which ``covered`` says yes.
    """
    if not len(t_s):
        return truth[:0]
    sigmas: dict[str, Any] = {
        name: _between(truth.t_s, getattr(truth, name), t_s) for name in TRUTH_SIGMAS
    }
    last = len(truth.t_s) - 1
    before = _before(truth.t_s, t_s)
    after = np.minimum(before + 1, last)
    step_s = (truth.t_s[after] - truth.t_s[before])[:, None]
    x = (t_s - truth.t_s[before])[:, None] / np.where(step_s > 0, step_s, 1.0)
    v0, v1 = truth.v_n_mps[before], truth.v_n_mps[after]
    p0, p1 = truth.p_n_m[before], truth.p_n_m[after]
    p_n_m = (
        (1 + 2 * x) * (1 - x) ** 2 * p0
        + x**2 * (3 - 2 * x) * p1
        + x * (1 - x) * ((1 - x) * v0 - x * v1) * step_s
    )
    v_n_mps = (1 - x) * v0 + x * v1
    return Truth(t_s=t_s, p_n_m=p_n_m, v_n_mps=v_n_mps, R_nb=attitude_at(truth, t_s)[0], **sigmas)


def _between(times_s: FloatArray, sigma: FloatArray | None, t_s: FloatArray) -> FloatArray | None:
    """Return sigmas at epochs, (n, 3), straight between samples; None where none are stated."""
    if sigma is None:
        return None
    return interpolate(t_s, times_s, sigma)


def common_epochs(a_s: FloatArray, b_s: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the indices, in each of two increasing lists of times, of the epochs they share."""
    a_ticks = np.round(a_s / _SAME_EPOCH_S).astype(np.int64)
    b_ticks = np.round(b_s / _SAME_EPOCH_S).astype(np.int64)
    _, of_a, of_b = np.intersect1d(a_ticks, b_ticks, assume_unique=True, return_indices=True)
    return of_a, of_b


def _before(times_s: FloatArray, t_s: FloatArray) -> IntArray:
    """Return the index of the last sample at or before each epoch, kept off the last sample."""
    index = np.searchsorted(times_s, t_s, side="right") - 1
    return np.asarray(index.clip(0, max(len(times_s) - 2, 0)))
