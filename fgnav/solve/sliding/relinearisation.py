"""Criteria of relinearization in a window.

Parameters stay where they are: one shared variable relinearised has the whole window eliminated
anew.
"""

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.graph.types.states import AUX, GYROSCOPE_AUX, RATE, ROTATION

# A keyframe is relinearised when its estimate has moved further than this from where it was:
# rotations err by half the square, 0.003 degree.
MOVED_RAD = 0.01
# Beside a gyroscope all are at once, and at less: where one is level and its neighbour is not by
# this much, specific force seems to push by 0.01 m/s2 and to tell a heading. In a second that is
# two and a half times what velocities by phase err.
_MOVED_WITH_GYROSCOPE_RAD = 0.001
MOVED_RADPS = 0.05  # of the rate, without a gyroscope: turns by that in 0.1 s
_MOVES = np.r_[ROTATION, RATE]
_MOVED = np.repeat([MOVED_RAD, MOVED_RADPS], 3)
_ERRS_AT_MOST = 0.25  # of sigma, by half the square of a move: 3 % more RMS error
UNKNOWN_RAD = 0.5  # of an attitude: it is wherever it is linearised
# Of the attitude where a window would begin. What is marginalised there stays linearised where
# little was known: in an outage of 15 s it had turned by 86 degrees, and a heading that motion had
# only begun to tell let roll seem told from the accelerometer's bias. So it waits, so long at most.
# Off by this much, a heading takes 0.05 m/s, what Doppler errs, from 1 m/s2 held for ten seconds.
_DETERMINED_RAD, WAITS_S = 0.1, 30.0

BLOCK_S = 1.0  # that a window is solved with at once, and of what is marginalised
SLOW_S = 0.5  # attitudes this far apart move too far for one linearisation
_FINE = 0.5  # of a usual move: between them states are relinearised sooner
_MUCH = 20.0  # times as far as else, after an outage: at once
_LEAST_SHARE = 0.1  # of a step
REPEATS = 5  # relinearisations after one update, at most; the next update goes on


def may_leave(sigma_rad: float, span_s: float) -> bool:
    """Return True if states that have left the window may be marginalized.

    Parameters
    ----------
    sigma_rad : float
        Of the attitude where the window would begin, all axes.
    span_s : float
        Of what is in the window yet.
    """
    return sigma_rad < _DETERMINED_RAD or span_s >= WAITS_S


def repeats_at(steps: FloatArray, is_slow: bool) -> float | None:
    """Return from how far on, times as usual, states are relinearised at once after an update.

    Parameters
    ----------
    steps : ndarray, shape (n, D)
        From where keyframes are linearised to their estimates.
    is_slow : bool
        Whether attitudes are further apart than ``SLOW_S``.

    Returns
    -------
    float or None
        None: the next update does it.
    """
    if is_slow:
        return _FINE
    is_moved = bool(np.abs(steps[-1, ROTATION]).max() > 2 * MOVED_RAD)
    return 1.0 if is_moved or moved_far(steps, _MUCH).any() else None


def relaxed(share: float, steps: FloatArray, before: FloatArray) -> float:
    """Compute the shares of its steps that a search takes next, (n, D), after the previous shares.

    Where level and forces are hardly known, steps overshoot and undo each other, the longer the
    further: Aitken's relaxation takes as much as would have led to the end.

    References
    ----------
    Irons & Tuck, A version of the Aitken accelerator for computer iteration, International Journal
    for Numerical Methods in Engineering 1(3), 1969.
    """
    turns, turned = steps[:, ROTATION].ravel(), before[:, ROTATION].ravel()
    along = float(turns @ turned) / max(float(turned @ turned), np.finfo(float).tiny)
    return float(np.clip(share / (1.0 - along), _LEAST_SHARE, 1.0)) if along < 0.0 else 1.0


def moved_far(steps: FloatArray, times: float = 1.0) -> BoolArray:
    """Select keyframes to relinearize, (n,), by their steps, (n, D).

    ``times`` as far as else counts as far.
    """
    if steps.shape[1] == AUX + GYROSCOPE_AUX:
        far = np.abs(steps[:, ROTATION]) > times * _MOVED_WITH_GYROSCOPE_RAD
        return np.full(len(steps), far.any())
    far = np.abs(steps[:, _MOVES]) > times * _MOVED
    return np.asarray(far.any(axis=1))


def is_rough(steps: FloatArray, covariance: FloatArray) -> BoolArray:
    """Select those of m estimates that are too far from their linearization points, (m,).

    An attitude unknown to half a radian and more is wherever it is linearised: its sigma says so.

    Parameters
    ----------
    steps : ndarray, shape (m, D)
        From there to the estimates.
    covariance : ndarray, shape (m, D, D)
    """
    turned = np.linalg.norm(steps[:, ROTATION], axis=1)
    far = turned > 2 * MOVED_RAD
    if not far.any():
        return np.asarray(far)
    sigma = np.sqrt(np.einsum("nii->n", covariance[:, ROTATION, ROTATION]))
    far &= turned**2 / 2 > _ERRS_AT_MOST * sigma
    return np.asarray(far & (sigma < UNKNOWN_RAD))
