"""From keyframes to what the kernels of a chain read: states, motions, measurements, priors.

``graph`` says the same in GTSAM's factors; the tests hold one against the other.
"""

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.methods.smoother.constants import columns, covariance
from fgnav.methods.smoother.directions import Directions
from fgnav.methods.smoother.keyframes import (
    POSITION_PRIOR_M,
    ROTATION_PRIOR_RAD,
    VELOCITY_PRIOR_MPS,
    Keyframes,
    Timed,
)
from fgnav.methods.smoother.link_types import Motions, Prior, Samples, Senses, States
from fgnav.methods.smoother.motion_kernel import MOTION, Gained, preintegrate


def states_of(keyframes: Keyframes) -> States:
    """Return where the search starts."""
    shared, shape = keyframes.shared, keyframes.baselines
    return States(
        R_nb=np.array(keyframes.R_nb, order="C"),
        p_n_m=np.array(keyframes.p_n_m, order="C"),
        v_n_mps=np.array(keyframes.v_n_mps, order="C"),
        slot=np.array(keyframes.slot, order="C"),
        constants=keyframes.shared_mean + np.concatenate([np.empty(0), *(c.start for c in shared)]),
        columns=keyframes.columns,
        baselines_b_m=np.zeros((0, 3)) if shape is None else np.array(shape.baselines_b_m),
    )


def empty_states(n: int, like: States | None = None) -> States:
    """Return room for the states of n keyframes, with what others share."""
    R_nb, three = np.zeros((n, 3, 3)), np.zeros((2, n, 3))
    own = (R_nb, three[0], three[1], np.zeros((n, 6)))
    if like is None:
        return States(*own, np.empty(0), columns((), 0), np.zeros((0, 3)))
    return States(*own, like.constants.copy(), like.columns, like.baselines_b_m)


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
    n, array, shape = len(keyframes.t_s), keyframes.array, keyframes.baselines
    there = keyframes.rigid[:, None, None]
    position, white, arm_b_m = _weighted(keyframes.position, n)
    piece = None if keyframes.position is None else keyframes.position.piece
    velocity, velocity_white, _ = _weighted(keyframes.velocity, n)
    down_n = keyframes.gravity_n_mps2[:, None]
    return Senses(
        root=np.ascontiguousarray(np.where(there, array.root, 0.0)),  # else compiled twice
        minimum=np.where(there, array.minimum, 0.0),
        floating=np.full(n, -1.0) if array.floating is None else array.floating.astype(float),
        position_n_m=position,
        position_white=white,
        arm_b_m=arm_b_m,
        position_piece=np.full((n, 1), -1.0) if piece is None else piece[:, None].astype(float),
        rate_b_radps=keyframes.rate_b_radps,
        shape_root=np.zeros((n, 0, 0)) if shape is None else np.ascontiguousarray(shape.root),
        shape_minimum_n_m=np.zeros((n, 0, 3)) if shape is None else shape.minimum,
        velocity_n_mps=velocity,
        velocity_white=velocity_white,
        known_n=down_n / np.linalg.norm(down_n, axis=2, keepdims=True).clip(1e-9),
        known_across_b=_across(keyframes.gravity, n)[:, None].copy(),
        sight_across_b=_across(keyframes.sight, n),
        **_surroundings(keyframes, n),
    )


def _surroundings(keyframes: Keyframes, n: int) -> dict[str, FloatArray]:
    """Return the senses of barometer and magnetometer; nothing weighs where there are none."""
    found: dict[str, FloatArray] = {
        "height_weight": np.zeros(n),
        "height_down_n_m": np.zeros(n),
        "height_arm_b_m": np.zeros((n, 3)),
        "height_at": np.zeros((n, 2)),
        "field_across_b": np.zeros((n, 2, 3)),
        "field_n_ut": np.zeros((n, 3)),
    }
    heights, field = keyframes.heights, keyframes.field
    if heights is not None:
        there, before = np.isfinite(heights.down_n_m), np.floor(heights.place)
        found["height_weight"] = there / heights.sigma_m
        found["height_down_n_m"] = np.where(there, heights.down_n_m, 0.0)
        found["height_arm_b_m"][:] = heights.arm_b_m
        found["height_at"] = np.stack([before, heights.place - before], axis=1)
    if field is not None:
        found["field_across_b"] = _across(field.directions, n)
        found["field_n_ut"][:] = field.field_n_ut
    return found


def empty_senses(n: int, like: Senses) -> Senses:
    """Return room for the measurements of n keyframes of the kinds that others have."""
    return Senses(*(np.zeros((n, *part.shape[1:])) for part in like))


def no_senses() -> Senses:
    """Return measurements of no keyframes, for a memory that is still empty."""
    return Senses(*(np.zeros(0) for _ in Senses._fields))


def prior_of(keyframes: Keyframes) -> Prior:
    """Return what is known before the first keyframe, see ``graph.priors``."""
    sigma = (ROTATION_PRIOR_RAD, POSITION_PRIOR_M, VELOCITY_PRIOR_MPS)
    white = np.linalg.inv(np.linalg.cholesky(covariance(keyframes.shared)))
    states = states_of(keyframes)
    return Prior(
        R_nb=states.R_nb[0].copy(),
        p_n_m=states.p_n_m[0].copy(),
        sigma=np.concatenate([np.repeat(sigma, 3), keyframes.slot_sigma]),
        constants=keyframes.shared_mean,
        constants_white=white,
    )


def _weighted(timed: Timed | None, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values, (n, 1, 3), what whitens them, (n, 1, 3, 3), and lever arms, (n, 1, 3)."""
    if timed is None:
        return np.zeros((n, 1, 3)), np.zeros((n, 1, 3, 3)), np.zeros((n, 1, 3))
    there = np.isfinite(timed.value[:, 0])
    value = np.where(there[:, None], timed.value, 0.0)
    white = timed.white(np.arange(n))[:, None]
    return value[:, None].copy(), white, np.tile(timed.arm_b_m, (n, 1, 1))


def _across(directions: Directions | None, n: int) -> FloatArray:
    """Return what whitens each direction, (n, 2, 3); zeros where there is none."""
    return np.zeros((n, 2, 3)) if directions is None else directions.across_b.copy()
