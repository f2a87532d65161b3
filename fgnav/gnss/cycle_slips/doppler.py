"""Cycle slips that nobody announced among few satellites: phase steps held against Doppler."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.types.observations import Observations

_JUDGED = 5  # channels among which ``slips.phase_arcs`` finds a slip by itself
_SIGMAS = 4.5
_QUARTER = 0.25  # cycles: a smaller step is no slip
_BEND = 0.25  # of the change of the Doppler's step: what a straight way between epochs may miss


def slipped(
    observations: Observations,
    columns: IntArray,
    wavelength_m: FloatArray,
    phase_sigma_m: FloatArray,
    doppler_sigma_mps: FloatArray,
) -> BoolArray:
    """Return the phases of the first antenna, (n, m), that step away from their Doppler.

    The mean of two Dopplers tells how far the phase went between them, motion, clock drift and all.
    What is common to all channels of an epoch is a jump of the clock. Only epochs are judged in
    which too few channels are there to be held against each other.

    Parameters
    ----------
    columns : ndarray of int, shape (m,)
        Of the channels; -1 where there is none.
    wavelength_m : ndarray, shape (m,)
    phase_sigma_m, doppler_sigma_mps : ndarray, shape (m,) or (n, m)
    """
    observed = columns >= 0
    phase_m = np.where(observed, observations.phase_cycles[:, 0, columns] * wavelength_m, np.nan)
    rate_mps = np.where(observed, -observations.doppler_hz[:, 0, columns] * wavelength_m, np.nan)
    out = np.zeros(phase_m.shape, dtype=np.bool_)
    valid = np.isfinite(phase_m) & np.isfinite(rate_mps)
    both = valid[1:] & valid[:-1]
    few = both.any(axis=1) & (both.sum(axis=1) < _JUDGED)
    if not few.any():
        return out
    step_s = np.diff(observations.t_s)[few, None]
    both, epoch = both[few], np.flatnonzero(few)
    went_m = step_s * (rate_mps[epoch] + rate_mps[epoch + 1]) / 2
    off_m = np.where(both, phase_m[epoch + 1] - phase_m[epoch] - went_m, np.nan)
    off_m -= np.nanmedian(off_m, axis=1, keepdims=True)
    slope = np.diff(rate_mps, axis=0)
    bend = np.abs(np.diff(slope, axis=0, prepend=slope[:1]))
    bend_m = step_s * _BEND * np.where(np.isfinite(bend), bend, 0.0)[epoch]
    shape = phase_m.shape
    phase_sigma_m = np.broadcast_to(phase_sigma_m, shape)[epoch + 1]
    doppler_sigma_mps = np.broadcast_to(doppler_sigma_mps, shape)[epoch + 1]
    noise_m = np.sqrt(2 * phase_sigma_m**2 + (doppler_sigma_mps * step_s) ** 2 / 2)
    least_m = np.maximum(_SIGMAS * noise_m + bend_m, _QUARTER * wavelength_m)
    out[epoch + 1] = both & (np.abs(np.where(both, off_m, 0.0)) > least_m)
    return out
