"""Attitudes from the first epoch on that a gyroscope carries, of a flight without an array."""

import numpy as np

from fgnav.alignment.alignment import Alignment
from fgnav.alignment.in_motion.windows import EarlierMotion, in_motion, in_motion_smoothed
from fgnav.alignment.initial import LEVEL_S, heading_without_motion_s, level_start
from fgnav.attitude.flight_vectors import track_of
from fgnav.attitude.imu_rotation import spun
from fgnav.checks import FloatArray, NoSolutionError
from fgnav.graph.types.problem import ROTATION_PRIOR_RAD
from fgnav.messages import note
from fgnav.types.flight import Flight, Imu


def gyroscope_alignment(
    flight: Flight, imu: Imu, *, causal: bool = False, earlier: EarlierMotion | None = None
) -> Alignment:
    """Return attitudes at the epochs of a flight's track.

    Those are valid whose heading is known by then. Each is from the nearest window whose motion
    determines the heading; causal, from the last such window by then, and valid from the end of the
    first. Where none does, level, with the heading stated, of a baseline, of the field, or zero.

    Raises
    ------
    NoSolutionError
        If there is no track, or next to no inertial sample.
    """
    track = track_of(flight, causal=causal)
    t_s = track.t_s
    if not len(t_s):
        raise NoSolutionError("attitude: the flight's track has no epoch")
    if earlier is None:
        gravity_n_mps2 = flight.origin.gravity_n_mps2(track.p_n_m[[0, 0]])[0]
        first_s = float(t_s[np.searchsorted(t_s, imu.t_s[0]).clip(0, len(t_s) - 1)])
        step_s, given_s = float(np.diff(t_s[:2]).sum()), np.inf
        R_level: FloatArray = np.eye(3)
        motion = (in_motion if causal else in_motion_smoothed)(imu, track, gravity_n_mps2)
    else:
        first_s, step_s, _, gravity_n_mps2, R_level, *_, given_s = earlier
        motion = in_motion(imu, track, gravity_n_mps2, earlier)
    if motion is None:
        raise NoSolutionError(f"attitude: {len(imu.t_s)} inertial samples are too few")
    # By samples that are gone as well.
    given_s = without_motion_s = min(heading_without_motion_s(flight, first_s), given_s)
    if len(motion.until_s) and not (causal and without_motion_s < np.inf):
        window = motion.latest(t_s) if causal else motion.nearest(t_s)
        determined_s = float(motion.until_s[0]) if causal else -np.inf
        R_nu, sigma_rad = motion.R_nu[window], motion.sigma_at(t_s, window)
    else:
        level_s = first_s if causal else max(first_s, float(imu.t_s[0]) + LEVEL_S)
        level_s = level_s if without_motion_s == np.inf else max(level_s, without_motion_s)
        if earlier is None:
            R_level = level_start(flight, imu, motion.rotation, level_s)
        R_nu = np.tile(R_level, (len(t_s), 1, 1))
        sigma_rad = np.full(len(t_s), ROTATION_PRIOR_RAD)
        determined_s = without_motion_s if causal or without_motion_s == np.inf else -np.inf
    without_motion_s = without_motion_s if causal or without_motion_s == np.inf else -np.inf
    # Which is first: a window that ends later is of the future, whenever it began.
    is_without = without_motion_s <= _first(motion.until_s, determined_s)
    return Alignment(
        t_s=t_s,
        R_nb=spun(motion.rotation, t_s, R_nu),
        covariance_rad2=sigma_rad[:, None, None] ** 2 * np.eye(3),
        valid=t_s >= determined_s,
        refused=np.zeros(len(t_s), dtype=np.bool_),
        rotation=motion.rotation,
        gyroscope_bias_b_radps=motion.bias_b_radps,
        heading_from_s=without_motion_s if is_without else _first(motion.begun_s, determined_s),
        heading_known_s=without_motion_s if is_without else _first(motion.until_s, determined_s),
        notes=(note("W201"),) if determined_s == np.inf else (),
        motion=EarlierMotion(
            first_s=first_s,
            step_s=step_s,
            until_s=float(t_s[t_s <= imu.t_s[-1]].max(initial=-np.inf)),
            gravity_n_mps2=gravity_n_mps2,
            R_level=R_level,
            R_ub=motion.rotation.R_ub[0],
            windows=motion,
            without_motion_s=given_s,
        ),
    )


def _first(of_windows_s: FloatArray, determined_s: float) -> float:
    """Return the first window's time; where there is none, ``determined_s``."""
    return float(of_windows_s[0]) if len(of_windows_s) else determined_s
