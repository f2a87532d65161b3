"""Instruments beside the antennas, brought to the keyframes: detector, gravity."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Loss
from fgnav.flight import Flight, Imu
from fgnav.gravity import GravityDirection
from fgnav.methods.smoother.directions import Directions
from fgnav.seeker import line_of_sight, to_landmark_b_m

_SAME_S = 1e-4  # measurements this close to a keyframe are of that keyframe


def sight(
    flight: Flight, imu: Imu, t_s: FloatArray, p_n_m: FloatArray
) -> tuple[Directions | None, tuple[Loss, ...]]:
    """Return directions from the accelerometer to the landmark at keyframes.

    The detector's lever arm is taken off with the distance that approximate positions, (n, 3),
    give: an error of metres in kilometres moves the direction by less than the detector sees.
    """
    seeker = flight.seeker
    if seeker is None:
        return None, ()
    seen = line_of_sight(seeker)
    if not len(seen.t_s):
        return None, seen.losses
    row, found = nearest(seen.t_s, t_s)
    distance_m = np.linalg.norm(seeker.landmark_n_m - p_n_m, axis=1)
    to_landmark = to_landmark_b_m(seeker, seen.e_b[row], imu.position_b_m, distance_m)
    to_landmark[~found] = np.nan
    e_b = to_landmark / np.linalg.norm(to_landmark, axis=1, keepdims=True)
    losses = (*seen.losses, *unused("line of sight", len(seen.t_s), found))
    return Directions.isotropic(e_b, seen.sigma_rad), losses


def gravity(
    told: GravityDirection | None, t_s: FloatArray
) -> tuple[Directions | None, tuple[Loss, ...]]:
    """Return the direction of gravity at the keyframes nearest to each estimate.

    Raises
    ------
    BadInputError
        If an estimate has a covariance that is not positive definite across it.
    """
    if told is None:
        return None, ()
    keyframe, _ = nearest(t_s, told.t_s)
    spacing_s = float(np.median(np.diff(t_s)))
    close = np.abs(t_s[keyframe] - told.t_s) <= spacing_s / 2
    seen = Directions.of("gravity direction", told.g_b, told.covariance)
    losses = (*told.losses, *unused("gravity direction", len(told.t_s), close))
    return seen[close].at(keyframe[close], len(t_s)), losses


def nearest(have_s: FloatArray, want_s: FloatArray) -> tuple[IntArray, BoolArray]:
    """Return the row of the time nearest to each wanted time, and whether it is the same time."""
    after = np.searchsorted(have_s, want_s).clip(1, max(len(have_s) - 1, 1))
    after = after.clip(max=len(have_s) - 1)
    before = np.maximum(after - 1, 0)
    row = np.where(want_s - have_s[before] < have_s[after] - want_s, before, after)
    return row, np.abs(have_s[row] - want_s) < _SAME_S


def unused(what: str, count: int, found: BoolArray) -> tuple[Loss, ...]:
    """Return the loss of measurements, ``count`` of them, that are at no keyframe."""
    left = count - int(found.sum())
    return (Loss(what=what, reason="not at a keyframe", count=left),) if left else ()
