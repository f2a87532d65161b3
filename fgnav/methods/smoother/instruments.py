"""Instruments beside the array, brought to the keyframes: code or fixes, detector, gravity."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Loss
from fgnav.flight import Fixes, Flight, Imu
from fgnav.gnss.code_solution import code_solution
from fgnav.gravity import GravityEstimator
from fgnav.methods.smoother.keyframes import Directions, Timed
from fgnav.seeker import line_of_sight, to_landmark_b_m

_SAME_S = 1e-4  # measurements this close to a keyframe are of that keyframe


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AntennaMotion:
    """Position and velocity of an antenna at keyframes.

    Attributes
    ----------
    position, velocity : Timed or None
        Their covariance is the noise that is new at each keyframe.
    common_m2 : ndarray, shape (n, 3, 3)
        Variance of positions that is common to all keyframes: no smoothing reduces it.
    losses : tuple of Loss
    """

    position: Timed | None
    velocity: Timed | None
    common_m2: FloatArray
    losses: tuple[Loss, ...]


def antenna_motion(flight: Flight, imu: Imu, t_s: FloatArray) -> AntennaMotion:
    """Return what code and Doppler, or else the receiver's own fixes, say at keyframes, (n,)."""
    none = np.zeros((len(t_s), 3, 3))
    if flight.observations is not None:
        code = code_solution(flight)
        arm_b_m = flight.antennas[0].position_b_m - imu.position_b_m
        row, found = nearest(code.t_s, t_s)
        position = _timed(code.p_n_m, code.position_noise_m2, row, found, arm_b_m)
        common_m2 = (code.position_covariance_m2 - code.position_noise_m2)[row]
        v_n_mps, covariance = code.v_n_mps, code.velocity_covariance_m2ps2
        losses = (*code.losses, *_unused("code solution", len(code.t_s), found))
    elif flight.fixes is not None:
        fixes = flight.fixes
        arm_b_m = flight.antenna(fixes.antenna).position_b_m - imu.position_b_m
        row, found = nearest(fixes.t_s, t_s)
        position = _timed(fixes.p_n_m, _diagonal(fixes.position_sigma_m), row, found, arm_b_m)
        common_m2 = none
        v_n_mps, covariance = fixes.v_n_mps, _velocity_covariance(fixes)
        losses = _unused("fix", len(fixes.t_s), found)
    else:
        return AntennaMotion(position=None, velocity=None, common_m2=none, losses=())
    velocity = None
    if v_n_mps is not None and covariance is not None:
        velocity = _timed(v_n_mps, covariance, row, found, arm_b_m)
    return AntennaMotion(position=position, velocity=velocity, common_m2=common_m2, losses=losses)


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
    directions = Directions(e_b=e_b, sigma_rad=np.full(len(t_s), seen.sigma_rad))
    return directions, (*seen.losses, *_unused("line of sight", len(seen.t_s), found))


def gravity(
    flight: Flight, estimator: GravityEstimator | None, t_s: FloatArray
) -> tuple[Directions | None, tuple[Loss, ...]]:
    """Return the direction of gravity at the keyframes nearest to each estimate."""
    if estimator is None:
        return None, ()
    told = estimator(flight)
    keyframe, _ = nearest(t_s, told.t_s)
    spacing_s = float(np.median(np.diff(t_s)))
    close = np.abs(t_s[keyframe] - told.t_s) <= spacing_s / 2
    e_b, sigma_rad = np.full((len(t_s), 3), np.nan), np.ones(len(t_s))
    e_b[keyframe[close]] = told.g_b[close]
    across = np.einsum("nii->n", told.covariance) / 2
    sigma_rad[keyframe[close]] = np.sqrt(across[close])
    losses = (*told.losses, *_unused("gravity direction", len(told.t_s), close))
    return Directions(e_b=e_b, sigma_rad=sigma_rad), losses


def nearest(have_s: FloatArray, want_s: FloatArray) -> tuple[IntArray, BoolArray]:
    """Return the row of the time nearest to each wanted time, and whether it is the same time."""
    after = np.searchsorted(have_s, want_s).clip(1, max(len(have_s) - 1, 1))
    after = after.clip(max=len(have_s) - 1)
    before = np.maximum(after - 1, 0)
    row = np.where(want_s - have_s[before] < have_s[after] - want_s, before, after)
    return row, np.abs(have_s[row] - want_s) < _SAME_S


def _timed(
    value: FloatArray, covariance: FloatArray, row: IntArray, found: BoolArray, arm_b_m: FloatArray
) -> Timed:
    value = np.where(found[:, None], value[row], np.nan)
    return Timed(value=value, covariance=covariance[row], arm_b_m=arm_b_m)


def _diagonal(sigma: FloatArray) -> FloatArray:
    return np.asarray(sigma[:, :, None] ** 2 * np.eye(3))


def _velocity_covariance(fixes: Fixes) -> FloatArray | None:
    return None if fixes.velocity_sigma_mps is None else _diagonal(fixes.velocity_sigma_mps)


def _unused(what: str, count: int, found: BoolArray) -> tuple[Loss, ...]:
    unused = count - int(found.sum())
    return (Loss(what=what, reason="not at a keyframe", count=unused),) if unused else ()
