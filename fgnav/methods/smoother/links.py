"""From keyframes to what the kernels of a chain read: states, motions, measurements, priors.

``graph`` says the same in GTSAM's factors; the tests hold one against the other.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.methods.smoother.graph import (
    POSITION_PRIOR_M,
    ROTATION_PRIOR_RAD,
    VELOCITY_PRIOR_MPS,
    landmark_covariance_m2,
)
from fgnav.methods.smoother.keyframes import Directions, Keyframes, Timed
from fgnav.methods.smoother.link_kernel import Motions, Prior, Senses, States
from fgnav.methods.smoother.motion_kernel import MOTION, Gained, preintegrate

_NO_LANDMARK = np.zeros(3)


def states_of(keyframes: Keyframes) -> States:
    """Return where the search starts."""
    landmark_n_m = keyframes.landmark_n_m
    return States(
        R_nb=np.array(keyframes.R_nb, order="C"),
        p_n_m=np.array(keyframes.p_n_m, order="C"),
        v_n_mps=np.array(keyframes.v_n_mps, order="C"),
        slot=np.array(keyframes.slot, order="C"),
        landmark_n_m=np.array(_NO_LANDMARK if landmark_n_m is None else landmark_n_m, float),
    )


def empty_states(n: int) -> States:
    """Return room for the states of n keyframes."""
    R_nb, three = np.zeros((n, 3, 3)), np.zeros((2, n, 3))
    return States(R_nb, three[0], three[1], np.zeros((n, 6)), np.zeros(3))


def empty_motions(n: int) -> Motions:
    """Return room for the motions to n keyframes."""
    return Motions(
        span_s=np.zeros(n),
        about=np.zeros((n, 6)),
        gained=np.zeros((n, 9)),
        correction=np.zeros((n, 9, 6)),
        white=np.zeros((n, MOTION, MOTION)),
        gravity_n_mps2=np.zeros((n, 3)),
        earth_rate_n_radps=np.zeros((n, 3)),
    )


class Samples(NamedTuple):
    """Inertial samples of intervals between n keyframes; see ``Increments``."""

    t_s: FloatArray  # (n,), of the keyframes
    first: IntArray
    step_s: FloatArray
    f_b_mps2: FloatArray
    w_b_radps: FloatArray
    noise: FloatArray
    gravity_n_mps2: FloatArray
    earth_rate_n_radps: FloatArray


def samples_of(keyframes: Keyframes) -> Samples:
    """Return what the motions between keyframes are integrated from."""
    pre = keyframes.preintegrate
    return Samples(
        t_s=keyframes.t_s,
        first=pre.increments.first,
        step_s=pre.increments.step_s,
        f_b_mps2=pre.increments.f_b_mps2,
        w_b_radps=pre.increments.w_b_radps,
        noise=pre.noise,
        gravity_n_mps2=pre.gravity_n_mps2,
        earth_rate_n_radps=pre.earth_rate_n_radps,
    )


def integrate(
    motions: Motions, into: IntArray, samples: Samples, rows: IntArray, about: FloatArray
) -> None:
    """Fill some motions, each that to a keyframe from the one before.

    Parameters
    ----------
    motions : Motions
    into : ndarray of int, shape (m,)
        Where to.
    samples : Samples
    rows : ndarray of int, shape (m,)
        Which keyframes; the first has no motion.
    about : ndarray, shape (m, 6)
        The slots that samples are corrected with.

    Raises
    ------
    NoSolutionError
        If an interval's covariance is not positive definite.
    """
    before = rows - 1
    gained = Gained(*(np.empty((len(rows), *shape)) for shape in ((9,), (9, 6), (MOTION, MOTION))))
    about = np.ascontiguousarray(about)
    failed = preintegrate(before, *samples[1:6], about, gained)
    if failed:
        raise NoSolutionError(f"motion: {failed} intervals between keyframes have no covariance")
    motions.span_s[into] = samples.t_s[rows] - samples.t_s[before]
    motions.about[into] = about
    motions.gained[into], motions.correction[into], motions.white[into] = gained
    motions.gravity_n_mps2[into] = samples.gravity_n_mps2[before]
    motions.earth_rate_n_radps[into] = samples.earth_rate_n_radps


def senses_of(keyframes: Keyframes) -> Senses:
    """Return what the keyframes measured, with the weight of each measurement."""
    n, array = len(keyframes.t_s), keyframes.array
    there = array.there[:, None, None]
    position, white, arm_b_m = _weighted(keyframes.position, n)
    velocity, velocity_white, _ = _weighted(keyframes.velocity, n)
    down_n = keyframes.gravity_n_mps2[:, None]
    return Senses(
        root=np.ascontiguousarray(np.where(there, array.root, 0.0)),  # else compiled twice
        minimum=np.where(there, array.minimum, 0.0),
        position_n_m=position,
        position_white=white,
        arm_b_m=arm_b_m,
        velocity_n_mps=velocity,
        velocity_white=velocity_white,
        known_n=down_n / np.linalg.norm(down_n, axis=2, keepdims=True).clip(1e-9),
        known_across_b=_across(keyframes.gravity, n)[:, None].copy(),
        sight_across_b=_across(keyframes.sight, n),
    )


def empty_senses(n: int) -> Senses:
    """Return room for the measurements of n keyframes."""
    three, white = np.zeros((4, n, 1, 3)), np.zeros((2, n, 1, 3, 3))
    return Senses(
        root=np.zeros((n, 9, 9)),
        minimum=np.zeros((n, 3, 3)),
        position_n_m=three[0],
        position_white=white[0],
        arm_b_m=three[1],
        velocity_n_mps=three[2],
        velocity_white=white[1],
        known_n=three[3],
        known_across_b=np.zeros((n, 1, 2, 3)),
        sight_across_b=np.zeros((n, 2, 3)),
    )


def prior_of(keyframes: Keyframes) -> Prior:
    """Return what is known before the first keyframe, see ``graph.priors``."""
    sigma = (ROTATION_PRIOR_RAD, POSITION_PRIOR_M, VELOCITY_PRIOR_MPS)
    white = np.linalg.inv(np.linalg.cholesky(landmark_covariance_m2(keyframes)))
    states = states_of(keyframes)
    return Prior(
        R_nb=states.R_nb[0].copy(),
        p_n_m=states.p_n_m[0].copy(),
        sigma=np.concatenate([np.repeat(sigma, 3), keyframes.slot_sigma]),
        landmark_n_m=states.landmark_n_m,
        landmark_white=white,
    )


def _weighted(timed: Timed | None, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values, (n, 1, 3), what whitens them, (n, 1, 3, 3), and lever arms, (n, 1, 3)."""
    if timed is None:
        return np.zeros((n, 1, 3)), np.zeros((n, 1, 3, 3)), np.zeros((n, 1, 3))
    there = np.isfinite(timed.value[:, 0])
    white = np.zeros((n, 1, 3, 3))
    white[there, 0] = np.linalg.inv(np.linalg.cholesky(timed.covariance[there]))
    value = np.where(there[:, None], timed.value, 0.0)
    return value[:, None].copy(), white, np.tile(timed.arm_b_m, (n, 1, 1))


def _across(directions: Directions | None, n: int) -> FloatArray:
    """Return two vectors across each direction, over its sigma, (n, 2, 3)."""
    out = np.zeros((n, 2, 3))
    if directions is not None:
        there = np.isfinite(directions.e_b[:, 0])
        sigma_rad = directions.sigma_rad[there, None, None]
        out[there] = across(directions.e_b[there]) / sigma_rad
    return out


def across(e: FloatArray) -> FloatArray:
    """Return two unit vectors across each unit vector, (n, 2, 3)."""
    least = np.eye(3)[np.abs(e).argmin(axis=1)]
    first = np.cross(e, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(e, first)], axis=1)
