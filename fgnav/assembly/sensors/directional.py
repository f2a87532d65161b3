"""Directions seen from the body, brought to the keyframes: line of sight, gravity."""

import numpy as np

from fgnav.alignment.gaps import LONGEST_STEP_S
from fgnav.alignment.matching import SAME_S, nearest, unmatched
from fgnav.checks import FloatArray, Unused
from fgnav.graph.factors.directions import Directions
from fgnav.gravity import GravityDirection
from fgnav.photodetector import line_of_sight, to_landmark_b_m
from fgnav.types.flight import Imu, Photodetector


def sight(
    photodetector: Photodetector | None,
    imu: Imu,
    t_s: FloatArray,
    p_n_m: FloatArray,
    *,
    causal: bool = False,
) -> tuple[Directions | None, tuple[Unused, ...]]:
    """Return directions from the accelerometer to the landmark at keyframes.

    The detector's lever arm is taken off with the distance that approximate positions, (n, 3),
    give: an error of metres in kilometres moves the direction by less than the detector sees.
    """
    if photodetector is None:
        return None, ()
    seen = line_of_sight(photodetector, causal=causal)
    if not len(seen.t_s):
        return None, seen.unused
    row, matched = nearest(seen.t_s, t_s)
    distance_m = np.linalg.norm(photodetector.landmark_n_m - p_n_m, axis=1)
    to_landmark = to_landmark_b_m(photodetector, seen.e_b[row], imu.position_b_m, distance_m)
    to_landmark[~matched] = np.nan
    e_b = to_landmark / np.linalg.norm(to_landmark, axis=1, keepdims=True)
    unused = (*seen.unused, *unmatched("line of sight", len(seen.t_s), matched))
    return Directions.isotropic(e_b, seen.sigma_rad), unused


def gravity(
    direction: GravityDirection | None, t_s: FloatArray, *, causal: bool = False
) -> tuple[Directions | None, tuple[Unused, ...]]:
    """Return the direction of gravity at the keyframes nearest to each estimate.

    Causal: at the first keyframe that is not before it.

    Raises
    ------
    BadInputError
        If an estimate has a covariance that is not positive definite across it.
    """
    if direction is None:
        return None, ()
    if causal:
        keyframe = np.searchsorted(t_s, direction.t_s - SAME_S).clip(max=len(t_s) - 1)
        delay_s = t_s[keyframe] - direction.t_s
        close = (delay_s > -2 * SAME_S) & (delay_s < LONGEST_STEP_S)
        _, last = np.unique(keyframe[::-1], return_index=True)
        newest = np.zeros(len(keyframe), dtype=np.bool_)
        newest[len(keyframe) - 1 - last] = True
        close &= newest
    else:
        keyframe, _ = nearest(t_s, direction.t_s)
        spacing_s = float(np.median(np.diff(t_s)))
        close = np.abs(t_s[keyframe] - direction.t_s) <= spacing_s / 2
    seen = Directions.of("gravity direction", direction.g_b, direction.covariance)
    unused = (*direction.unused, *unmatched("gravity direction", len(direction.t_s), close))
    return seen[close].scatter(keyframe[close], len(t_s)), unused
