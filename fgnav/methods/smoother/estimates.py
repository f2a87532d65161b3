"""From states of the accelerometer to an estimate of the body's origin, covariances with them."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.estimate import Estimate
from fgnav.methods.smoother.collect import Collected
from fgnav.methods.smoother.consistency import consistency
from fgnav.methods.smoother.constants_found import arm_off, constants_found, sentence
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.observability import TURN, undetermined
from fgnav.methods.smoother.solution import SharedSolution, Solution
from fgnav.rotations import skew


def estimate_of(
    name: str,
    collected: Collected,
    solution: Solution,
    rows: IntArray | None = None,
    believed: Solution | None = None,
) -> Estimate:
    """Return the estimate at keyframes, or at some of them, with all that is to be said of it.

    Parameters
    ----------
    name : str
    collected : Collected
    solution : Solution
        As solved.
    rows : ndarray of int, optional
        Keyframes to speak of; all by default.
    believed : Solution, optional
        The same with covariances to be stated; as solved by default.
    """
    keyframes = collected.keyframes
    imu = keyframes.preintegrate.imu
    open_states, weak = undetermined(keyframes, solution)
    if collected.rough and not solution.converged:
        open_states = (TURN, *open_states)
    notes, gyro_free = [weak] if weak else [], imu.w_b_radps is None
    if gyro_free:
        density = keyframes.preintegrate.angular_acceleration_density
        told = ", ".join(f"{value:.2g}" for value in density)
        notes.append(f"Angular acceleration density about the body axes: {told} (rad/s2)2/Hz.")
        white = keyframes.preintegrate.rate_density
        if white.any():
            told = ", ".join(f"{value:.2g}" for value in white)
            notes.append(
                f"Of rates, a part comes and goes between fixes: {told} (rad/s)2/Hz; those stated "
                "are without it."
            )
    if not solution.converged:
        notes.append(f"{name} did not end at a minimum: do not use the estimate.")
    constants = constants_found(keyframes, solution)
    notes += map(sentence, constants)
    rows = np.arange(len(keyframes.t_s)) if rows is None else rows
    t_s, tests = keyframes.t_s[rows], consistency(keyframes, solution)
    solution = (solution if believed is None else believed)[rows]
    told_b_radps = keyframes.preintegrate.told_radps(t_s)
    common = (collected.common_position_m2[rows], collected.common_velocity_m2ps2[rows])
    return replace(
        stated(name, keyframes, solution, t_s, told_b_radps, common),
        epochs=collected.epochs,
        unobservable=open_states,
        integers=collected.integers,
        losses=collected.losses,
        rejections=collected.rejections,
        consistency=tests,
        constants=constants,
        notes=(*collected.notes, *notes),
    )


def stated(
    name: str,
    keyframes: Keyframes,
    solution: Solution,
    t_s: FloatArray,
    told_b_radps: FloatArray,
    common: tuple[FloatArray | float, FloatArray | float] = (0.0, 0.0),
) -> Estimate:
    """Return what a solution says of the body, and nothing of how it came about.

    Parameters
    ----------
    name : str
    keyframes : Keyframes
        Of the same instruments and constants as those solved.
    solution : Solution
    t_s : ndarray, shape (n,)
        Times of its states.
    told_b_radps : ndarray, shape (n, 3)
        What a gyroscope says then; 0 without one.
    common : tuple of ndarray, shape (n, 3, 3), or float
        Variance of positions that no smoothing reduces, m2, and of their drift, m2/s2.
    """
    imu, off = keyframes.preintegrate.imu, arm_off(keyframes, solution)
    gyro_free = imu.w_b_radps is None
    motion = origin_motion(
        solution,
        told_b_radps,
        -imu.position_b_m if off is None else off.value - imu.position_b_m,
        keyframes.preintegrate.earth_rate_n_radps,
        off,
    )
    return Estimate(
        method=name,
        t_s=t_s,
        epochs=len(t_s),
        R_nb=solution.R_nb,
        attitude_covariance_rad2=solution.covariance[:, :3, :3],
        p_n_m=motion.p_n_m,
        position_covariance_m2=motion.position_covariance_m2 + common[0],
        v_n_mps=motion.v_n_mps,
        velocity_covariance_m2ps2=motion.velocity_covariance_m2ps2 + common[1],
        angular_rate_b_radps=motion.w_b_radps,
        accelerometer_bias_mps2=solution.slot[:, :3],
        accelerometer_bias_covariance_m2ps4=solution.slot_covariance[:, :3, :3],
        gyroscope_bias_radps=None if gyro_free else solution.slot[:, 3:],
        gyroscope_bias_covariance_rad2ps2=(
            None if gyro_free else solution.slot_covariance[:, 3:, 3:]
        ),
        converged=solution.converged,
    )


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class OriginMotion:
    """Motion of the body's origin.

    Attributes
    ----------
    w_b_radps : ndarray, shape (n, 3)
        Body rates against inertial space.
    p_n_m, v_n_mps : ndarray, shape (n, 3)
    position_covariance_m2, velocity_covariance_m2ps2 : ndarray, shape (n, 3, 3)
    """

    w_b_radps: FloatArray
    p_n_m: FloatArray
    position_covariance_m2: FloatArray
    v_n_mps: FloatArray
    velocity_covariance_m2ps2: FloatArray


def origin_motion(
    solution: Solution,
    told_b_radps: FloatArray,
    arm_b_m: FloatArray,
    earth_rate_n_radps: FloatArray,
    off: SharedSolution | None = None,
) -> OriginMotion:
    """Move states from the accelerometer to the origin: ``p + R a`` and ``v + R (w x a)``.

    Parameters
    ----------
    solution : Solution
    told_b_radps : ndarray, shape (n, 3)
        What a gyroscope says; 0 without one. The rate is this less the slot.
    arm_b_m : ndarray, shape (3,)
        From the accelerometer to the origin.
    earth_rate_n_radps : ndarray, shape (3,)
    off : SharedSolution, optional
        What is in the arm of an estimate of it, with its doubt.
    """
    R_nb, P, arm = solution.R_nb, solution.covariance, skew(arm_b_m[None])[0]
    w_b_radps = told_b_radps - solution.slot[:, 3:]
    earth_b_radps = np.einsum("nji,j->ni", R_nb, earth_rate_n_radps)
    swing_b_mps = np.cross(w_b_radps - earth_b_radps, arm_b_m)
    derivatives: FloatArray = np.zeros((2, len(R_nb), 3, 15))
    A, B = derivatives  # of position and velocity by the state
    A[:, :, :3], A[:, :, 3:6] = -R_nb @ arm, R_nb
    B[:, :, :3] = R_nb @ (arm @ skew(earth_b_radps) - skew(swing_b_mps))
    B[:, :, 6:9], B[:, :, 12:] = np.eye(3), R_nb @ arm
    if off is not None:
        P = np.asarray(np.block([[P, off.cross], [off.cross.swapaxes(1, 2), off.covariance]]))
        spin = skew(w_b_radps - earth_b_radps)
        A, B = (np.concatenate(pair, axis=2) for pair in ((A, R_nb), (B, R_nb @ spin)))
    return OriginMotion(
        w_b_radps=w_b_radps,
        p_n_m=solution.p_n_m + R_nb @ arm_b_m,
        position_covariance_m2=A @ P @ A.swapaxes(1, 2),
        v_n_mps=solution.v_n_mps + np.einsum("nij,nj->ni", R_nb, swing_b_mps),
        velocity_covariance_m2ps2=B @ P @ B.swapaxes(1, 2),
    )
