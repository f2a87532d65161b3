"""From states of the accelerometer to an estimate of the body's origin, covariances with them."""

from dataclasses import replace

import numpy as np

from fgnav.alignment.gaps import gap_notes, spans
from fgnav.alignment.rates import timed_motion
from fgnav.assembly.prepared import PreparedFlight
from fgnav.attitude.baselines import BodyMotion
from fgnav.checks import BoolArray, FloatArray, IntArray, Unused
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import skew
from fgnav.graph.delayed import CLOCK_OFFSET, on_gnss_time
from fgnav.graph.factors.position import LEVER_ARM
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import (
    ACCELEROMETER_BIAS,
    POSITION,
    RATE,
    ROTATION,
    VELOCITY,
)
from fgnav.messages import note
from fgnav.methods.smoothing.calibration_report import calibrated_parameters, constant_note
from fgnav.methods.smoothing.observability import TURN, undetermined
from fgnav.types.estimate import Estimate

ROUGH = "its window ended too far from where it was linearised"
_FEW = 0.5  # of keyframes: where most are refused the method ended nowhere


def estimate_of(
    name: str,
    prepared: PreparedFlight,
    solution: Solution,
    rows: IntArray | None = None,
) -> Estimate:
    """Return the estimate at keyframes, or at some of them, with all that is reported of it.

    Parameters
    ----------
    name : str
    prepared : PreparedFlight
    solution : Solution
    rows : ndarray of int, optional
        Keyframes to speak of; all by default.
    """
    problem = prepared.problem
    open_states, weak = undetermined(problem, solution)
    if prepared.rough and not solution.converged:
        open_states = (TURN, *open_states)
    notes = [note("W403", states=", ".join(weak))] if weak else []
    refused = _refused(prepared, solution)
    converged = solution.converged or bool(refused.any())
    if not converged:
        notes.append(note("E401", method=name))
    notes += gap_notes("estimate", spans(problem.t_s, refused), "W402")
    constants = calibrated_parameters(problem.constants, solution)
    notes += map(constant_note, constants)
    epochs = prepared.epochs if rows is None else len(rows)
    rows = np.arange(len(problem.t_s)) if rows is None else rows
    lost = int(refused[rows].sum())
    rows = rows[~refused[rows]]
    return replace(
        stated_at(name, prepared, problem, solution[rows], rows),
        n_epochs=epochs,
        unobservable=open_states,
        integers=prepared.integers,
        arcs=prepared.arcs,
        unused=(
            *prepared.unused,
            *([Unused(what="keyframe", reason=ROUGH, count=lost)] if lost else []),
        ),
        converged=converged,
        rejections=prepared.rejections,
        calibration=constants,
        notes=(*prepared.notes, *notes),
    )


def stated_at(
    name: str,
    prepared: PreparedFlight,
    problem: Problem,
    solution: Solution,
    rows: IntArray,
) -> Estimate:
    """Return the estimate of the body's origin by some rows of a problem, at GNSS time."""
    t_s = problem.t_s[rows]
    if problem.constants.column(CLOCK_OFFSET) >= 0:  # states so far are those of the unit's clock
        timed = timed_motion(
            prepared.imu,
            t_s,
            problem.motion.gravity_n_mps2[rows],
            problem.motion.earth_rate_n_radps,
            causal=prepared.causal,
        )
        solution = on_gnss_time(solution, timed, problem.constants)
    w_b_radps = problem.motion.rates_b_radps(t_s, solution.states.aux)
    estimate = stated(name, problem, solution, t_s, w_b_radps)
    added, P = prepared.attitude_inflation_rad2, estimate.attitude_covariance_rad2
    if added is None or P is None:
        return estimate
    more = interpolate(t_s, prepared.problem.t_s, added.reshape(-1, 9)).reshape(-1, 3, 3)
    return replace(estimate, attitude_covariance_rad2=P + more)


def stated(
    name: str, problem: Problem, solution: Solution, t_s: FloatArray, w_b_radps: FloatArray
) -> Estimate:
    """Return the estimate of the body's origin by a solution, without its circumstances.

    Parameters
    ----------
    name : str
    problem : Problem
        Of the body and the constants that are solved.
    solution : Solution
    t_s : ndarray, shape (n,)
        Times of its states.
    w_b_radps : ndarray, shape (n, 3)
        Their rates: of a gyroscope, less its bias, against inertial space; states of the rate
        against n.
    """
    states, P, gyroscope = solution.states, solution.covariance, problem.gyroscope
    motion, rates = _origin_motion(problem, solution, w_b_radps)
    return Estimate(
        method=name,
        t_s=t_s,
        n_epochs=len(t_s),
        R_nb=states.R_nb,
        attitude_covariance_rad2=P[:, ROTATION, ROTATION],
        p_n_m=motion.p_n_m,
        position_covariance_m2=motion.position_covariance_m2,
        v_n_mps=motion.v_n_mps,
        velocity_covariance_m2ps2=motion.velocity_covariance_m2ps2,
        angular_rate_b_radps=rates,
        accelerometer_bias_mps2=states.aux[:, :3],
        accelerometer_bias_covariance_m2ps4=P[:, ACCELEROMETER_BIAS, ACCELEROMETER_BIAS],
        gyroscope_bias_radps=states.aux[:, 3:6] if gyroscope else None,
        gyroscope_bias_covariance_rad2ps2=P[:, RATE, RATE] if gyroscope else None,
        converged=solution.converged,
    )


def _refused(prepared: PreparedFlight, solution: Solution) -> BoolArray:
    """Return keyframes, (n,), whose window ended in no minimum; none where most of them did not.

    Nor where the search started from an assumption: then one such window may have lost its way.
    """
    none = np.zeros(len(solution.covariance), dtype=np.bool_)
    refused = solution.refused
    is_part = refused is not None and refused.any() and refused.mean() < _FEW
    return none if refused is None or prepared.rough or not is_part else refused


def _origin_motion(
    problem: Problem, solution: Solution, w_b_radps: FloatArray
) -> tuple[BodyMotion, FloatArray]:
    """Move states from the accelerometer to the origin: ``p + R a`` and ``v + R (w_nb x a)``.

    An estimated lever arm from accelerometer to antennas moves the accelerometer in the body, and
    its doubt is part of the origin's. Returned with body rates against inertial space, (n, 3).
    """
    R_nb, P, n = solution.states.R_nb, solution.covariance, len(w_b_radps)
    motion, lever = problem.motion, problem.constants.columns(LEVER_ARM)
    gyroscope = problem.gyroscope
    constants = solution.states.constants if solution.constants is None else solution.constants
    arm_b_m: FloatArray = np.tile(-motion.imu.position_b_m, (n, 1))
    if lever.stop:
        arm_b_m += constants[..., lever]
    arm = skew(arm_b_m)
    earth_b_radps = np.einsum("nji,j->ni", R_nb, motion.earth_rate_n_radps)
    relative_radps = w_b_radps - earth_b_radps if gyroscope else w_b_radps
    arm_velocity_b_mps = np.cross(relative_radps, arm_b_m)
    A: FloatArray = np.zeros((n, 3, P.shape[1]))  # of position by the state
    B: FloatArray = np.zeros((n, 3, P.shape[1]))  # of velocity
    A[:, :, ROTATION], A[:, :, POSITION] = -R_nb @ arm, R_nb
    B[:, :, ROTATION] = -R_nb @ skew(arm_velocity_b_mps)
    if gyroscope:
        B[:, :, ROTATION] += R_nb @ arm @ skew(earth_b_radps)
    B[:, :, VELOCITY] = np.eye(3)
    B[:, :, RATE] = R_nb @ arm if gyroscope else -R_nb @ arm
    if lever.stop:
        cross = solution.constant_cross[:, :, lever]
        lever_covariance = solution.constant_covariance[:, lever, lever]
        P = np.asarray(np.block([[P, cross], [cross.swapaxes(1, 2), lever_covariance]]))
        A = np.concatenate([A, R_nb], axis=2)
        B = np.concatenate([B, R_nb @ skew(relative_radps)], axis=2)
    moved = BodyMotion(
        p_n_m=solution.states.p_n_m + np.einsum("nij,nj->ni", R_nb, arm_b_m),
        position_covariance_m2=A @ P @ A.swapaxes(1, 2),
        v_n_mps=solution.states.v_n_mps + np.einsum("nij,nj->ni", R_nb, arm_velocity_b_mps),
        velocity_covariance_m2ps2=B @ P @ B.swapaxes(1, 2),
    )
    return moved, relative_radps + earth_b_radps
