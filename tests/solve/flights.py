"""Short simulated flights as smoothing problems, with the truth."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import gtsam
import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry.rotations import exp, transpose
from fgnav.graph.build import constant_priors, keyframe_priors, sensor_factors
from fgnav.graph.factors.array_phase import ArrayPhase
from fgnav.graph.factors.position import Position
from fgnav.graph.factors.velocity import Velocity
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.parameters import Parameter, Parameters, flight_constant
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.process import matern
from tests.graph.factors.motions import EARTH_N_RADPS, GRAVITY_N_MPS2, TrueMotion, sine

ATTITUDE_RAD = np.radians([0.3, 0.25, 0.22])
POSITION_M = 0.5
VELOCITY_MPS = 0.05
ARM_B_M = np.array([0.5, 0.2, -0.3])
ACCELEROMETER_MPS2 = 1e-2  # of a sample at 100 Hz
GYROSCOPE_RADPS = 1e-3


def flight(
    until_s: float,
    *,
    gyroscope: bool = False,
    hz: float = 10.0,
    every: int = 1,
    extra: tuple[Parameter, ...] = (),
    seed: int = 1,
    motion: TrueMotion | None = None,
) -> tuple[Problem, States]:
    """Sines of 20 degrees; ``every`` how many keyframes there is a fix."""
    rng, true_motion = np.random.default_rng(seed), motion or sine(20.0)
    t_s = np.arange(round(until_s * hz) + 1) / hz
    n, rows = len(t_s), np.arange(0, len(t_s), every)
    mean_rate = flight_constant("mean rate", ("x", "y", "z"), "rad/s", 15.0, reported=False)
    constants = Parameters((*(() if gyroscope else (mean_rate,)), *extra))
    truth = true_motion.states(t_s, gyroscope=gyroscope, constants=constants.start)
    imu = true_motion.imu(until_s, 100.0, gyroscope=gyroscope)
    force = imu.f_b_mps2 + ACCELEROMETER_MPS2 * rng.normal(size=imu.f_b_mps2.shape)
    imu = replace(imu, f_b_mps2=force)
    if imu.w_b_radps is not None:
        noise = GYROSCOPE_RADPS * rng.normal(size=imu.w_b_radps.shape)
        imu = replace(imu, w_b_radps=imu.w_b_radps + noise)
    common = {
        "t_s": t_s,
        "imu": imu,
        "sub_steps": 2,
        "gravity_n_mps2": np.tile(GRAVITY_N_MPS2, (n, 1)),
        "earth_rate_n_radps": EARTH_N_RADPS,
        "accelerometer_noise": np.full(n - 1, 1e-6),
    }
    moves = (
        Inertial(**common, gyroscope_noise=np.full(n - 1, 1e-8))
        if gyroscope
        else GyroFree(
            **common,
            poles_per_s=np.tile(matern.poles(1.0), (n - 1, 3, 1)),
            variance_rad2ps2=np.full((n - 1, 3), 0.2),
            constants=constants,
        )
    )
    measurements = _measured(true_motion, truth, t_s, rows, constants, imu.w_b_radps, rng)
    nearest = rows[np.searchsorted(rows, np.arange(n), side="right") - 1]
    start = States(
        R_nb=measurements[0].minimum[nearest // every],
        p_n_m=measurements[1].value_n_m[nearest // every],
        v_n_mps=measurements[2].value_n_mps[nearest // every],
        aux=np.zeros_like(truth.aux),
        constants=constants.start,
    )
    problem = Problem(
        t_s=t_s,
        start=start,
        motion=moves,
        sensors=measurements,
        constants=constants,
        attitude_known=np.isin(np.arange(n), rows),
    )
    return problem, truth


def _measured(
    motion: TrueMotion,
    truth: States,
    t_s: FloatArray,
    rows: IntArray,
    constants: Parameters,
    w_b_radps: FloatArray | None,
    rng: np.random.Generator,
) -> tuple[ArrayPhase, Position, Velocity]:
    k, R = len(rows), truth.R_nb[rows]
    # Three directions of the body with weights whose information is that of the attitude.
    share = np.linalg.solve(np.ones((3, 3)) - np.eye(3), 1 / ATTITUDE_RAD**2)
    swing = np.cross(motion.rates(t_s[rows]) - transpose(R) @ EARTH_N_RADPS, ARM_B_M)
    p = truth.p_n_m[rows] + R @ ARM_B_M + POSITION_M * rng.normal(size=(k, 3))
    v = truth.v_n_mps[rows] + np.einsum("nij,nj->ni", R, swing)
    none = np.full(k, -1)
    return (
        ArrayPhase(
            row=rows,
            root=np.tile(np.diag(np.tile(np.sqrt(share), 3)), (k, 1, 1)),
            minimum=R @ exp(ATTITUDE_RAD * rng.normal(size=(k, 3))),
            stretch=none,
            constants=constants,
        ),
        Position(
            row=rows,
            value_n_m=p,
            white=np.tile(np.eye(3) / POSITION_M, (k, 1, 1)),
            arm_b_m=ARM_B_M,
            constants=constants,
        ),
        Velocity(
            row=rows,
            value_n_mps=v + VELOCITY_MPS * rng.normal(size=(k, 3)),
            white=np.tile(np.eye(3) / VELOCITY_MPS, (k, 1, 1)),
            arm_b_m=ARM_B_M,
            measured_b_radps=None
            if w_b_radps is None
            else w_b_radps[(100 * t_s[rows]).round().astype(int)],
            earth_rate_n_radps=EARTH_N_RADPS,
            constants=constants,
        ),
    )


def part(problem: Problem, first: int, last: int) -> Problem:
    """The keyframes first to last and nothing else."""
    rows, motion = slice(first, last + 1), problem.motion
    cut = {
        name: getattr(motion, name)[first:last]
        for name in ("poles_per_s", "variance_rad2ps2", "accelerometer_noise", "gyroscope_noise")
        if hasattr(motion, name)
    }
    inside = np.zeros(len(problem.t_s), dtype=bool)
    inside[rows] = True
    measurements = [replace(one, row=one.row - first) for one in measured_at(problem, inside)]
    return Problem(
        t_s=problem.t_s[rows],
        start=problem.start.at(rows),
        motion=replace(
            motion, t_s=problem.t_s[rows], gravity_n_mps2=motion.gravity_n_mps2[rows], **cut
        ),
        sensors=tuple(measurements),
        constants=problem.constants,
        attitude_known=problem.attitude_known[rows],
    )


def measured_at(problem: Problem, keyframes: BoolArray) -> tuple[Any, ...]:
    """The sensors of a problem with the measurements at some keyframes."""
    names = ("row", "root", "minimum", "stretch", "value_n_m", "value_n_mps", "white",
             "measured_b_radps")  # fmt: skip
    measurements = []
    for one in problem.sensors:
        kept = keyframes[one.row]
        arrays = {n: getattr(one, n)[kept] for n in names if getattr(one, n, None) is not None}
        measurements.append(replace(one, **arrays))
    return tuple(measurements)


def sigmas_apart(one: Solution, other: Solution) -> float:
    """How far two solutions are from each other at most, in sigmas of the first."""
    sigma = np.sqrt(np.einsum("nii->ni", one.covariance))
    return float((np.abs(one.states.steps_to(other.states)) / sigma).max())


def sigma_ratio(one: Solution, other: Solution) -> float:
    """How unlike the sigmas of two solutions are at most: 0 of the same."""
    ratio = np.einsum("nii->ni", one.covariance) / np.einsum("nii->ni", other.covariance)
    return float(np.abs(np.sqrt(ratio) - 1).max())


def flight_graph(
    problem: Problem, about: States, own: Iterable[gtsam.NonlinearFactor] = ()
) -> gtsam.NonlinearFactorGraph:
    """All factors of a flight, motion preintegrated about states; keyframe k is row k."""
    graph = gtsam.NonlinearFactorGraph()
    for factor in (*keyframe_priors(problem), *constant_priors(problem.constants)):
        graph.add(factor)
    for k in range(len(problem.t_s)):
        if k:
            for factor in problem.motion.factors(k - 1, k - 1, k, about.at(slice(k - 1, k))):
                graph.add(factor)
        for factor in sensor_factors(problem, k, k):
            graph.add(factor)
    phase = problem.phase
    if phase is not None:
        for j in range(len(phase.blocks)):
            graph.add(phase.transition_factor(j))
        for i, k in enumerate(phase.row.tolist()):
            graph.add(phase.factor(i, k))
    for factor in own:
        graph.add(factor)
    return graph
