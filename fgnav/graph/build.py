"""A smoothing problem as GTSAM takes it: values and factors of its keyframes and constants.

Keyframe k has ``pose(k)``, ``velocity(k)`` and ``imu_bias(k)`` with a gyroscope, else
``angular_motion(k)``; part i of the constants has ``constant(i)``.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import gtsam
import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph import keys
from fgnav.graph.linear_factor import linear_factor
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.problem import Problem, pose_prior
from fgnav.graph.types.states import AUX, GYROSCOPE_AUX, States

_POSE, _VELOCITY, _IMU_BIAS, _ANGULAR_MOTION = (
    of(0) for of in (keys.pose, keys.velocity, keys.imu_bias, keys.angular_motion)
)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Layout:
    """Variables of a keyframe and of the flight."""

    gyroscope: bool
    constants: Parameters
    correlated: int = 0  # dimensions of the array's correlated error, last of the angular motion

    @classmethod
    def of(cls, problem: Problem) -> "Layout":
        """Return the variables of a problem."""
        correlated = 0 if problem.gyroscope else problem.motion.aux - 2 * GYROSCOPE_AUX
        return cls(gyroscope=problem.gyroscope, constants=problem.constants, correlated=correlated)

    @property
    def width(self) -> int:
        """Dimensions of one keyframe's tangent, D."""
        return AUX + (GYROSCOPE_AUX if self.gyroscope else 2 * GYROSCOPE_AUX + self.correlated)

    @property
    def constant_keys(self) -> list[int]:
        """Return the keys of all constants."""
        return [keys.constant(i) for i in range(len(self.constants.parts))]

    def keyframe(self, k: int) -> tuple[int, int, int]:
        """Return the keys of keyframe k, in the order of its tangent."""
        return _POSE | k, _VELOCITY | k, (_IMU_BIAS if self.gyroscope else _ANGULAR_MOTION) | k


def insert_keyframe(values: gtsam.Values, layout: Layout, k: int, at: States, row: int = 0) -> None:
    """Add row ``row`` of states to the values, as keyframe k."""
    x, v, aux = layout.keyframe(k)
    values.insert(x, gtsam.Pose3(gtsam.Rot3(at.R_nb[row]), at.p_n_m[row]))
    values.insert(v, at.v_n_mps[row])
    # 30 us: ConstantBias is the last of insert's overloads, and there is no other way to a new key.
    values.insert(aux, as_bias(at.aux[row]) if layout.gyroscope else at.aux[row])


def keyframe_states(values: gtsam.Values, layout: Layout, numbers: Sequence[int]) -> States:
    """Return keyframes and constants as they are in the values."""
    n, read = len(numbers), values.atVector
    R_nb, p_n_m, v_n_mps = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
    aux = np.empty((n, layout.width - AUX))
    for row, k in enumerate(numbers):
        x, v, vector = layout.keyframe(k)
        pose = values.atPose3(x).matrix()  # a third of rotation's and translation's time
        R_nb[row], p_n_m[row], v_n_mps[row] = pose[:3, :3], pose[:3, 3], read(v)
        aux[row] = values.atConstantBias(vector).vector() if layout.gyroscope else read(vector)
    constants = np.concatenate([np.empty(0), *map(read, layout.constant_keys)])
    return States(R_nb, p_n_m, v_n_mps, aux, constants)


def insert_constants(values: gtsam.Values, layout: Layout, at: FloatArray) -> None:
    """Add constants, (b,), to the values."""
    for key, size, first in _parts(layout.constants):
        values.insert(key, at[first : first + size])


def as_bias(aux: FloatArray) -> gtsam.imuBias.ConstantBias:
    """Return the biases of a state with a gyroscope, (6,), as GTSAM's type."""
    return gtsam.imuBias.ConstantBias(aux[:3], aux[3:])


def sensor_factors(problem: Problem, row: int, k: int) -> Iterator[gtsam.NonlinearFactor]:
    """Yield the measurements of a problem's row as factors of keyframe k."""
    for sensor in problem.sensors:
        for i in range(*sensor.row.searchsorted((row, row + 1)).tolist()):
            yield sensor.factor(i, k)


def keyframe_priors(problem: Problem) -> list[gtsam.NonlinearFactor]:
    """Build the priors of the first keyframe.

    Pose about where the search starts, velocity about zero, both hardly known; ``aux`` as the
    motion states it.
    """
    layout, (R_nb, P) = Layout.of(problem), pose_prior(problem)
    x, v, _ = layout.keyframe(0)
    pose = gtsam.Pose3(gtsam.Rot3(R_nb), problem.start.p_n_m[0])
    gaussian = gtsam.noiseModel.Gaussian.Covariance
    return [
        gtsam.PriorFactorPose3(x, pose, gaussian(P[:6, :6])),
        gtsam.PriorFactorVector(v, np.zeros(3), gaussian(P[6:, 6:])),
        _aux_prior(problem.motion, layout),
    ]


def _aux_prior(motion: Motion, layout: Layout) -> gtsam.NonlinearFactor:
    """Return ``rows @ (aux - mean, constants)``, white, as a linear factor."""
    mean, rows = motion.prior(layout.constants.width)
    aux, n = layout.keyframe(0)[2], motion.aux
    point = gtsam.Values()
    point.insert(aux, as_bias(mean) if layout.gyroscope else mean)
    terms = [(aux, rows[:, :n])]
    for key, size, first in _parts(layout.constants):
        block = rows[:, n + first : n + first + size]
        if block.any():
            terms.append((key, block))
            point.insert(key, np.zeros(size))
    return gtsam.LinearContainerFactor(linear_factor(terms, np.zeros(len(rows))), point)


def constant_priors(constants: Parameters) -> list[gtsam.NonlinearFactor]:
    """Build the priors of the constants."""
    covariance = gtsam.noiseModel.Gaussian.Covariance
    return [
        gtsam.PriorFactorVector(keys.constant(i), parameter.mean, covariance(parameter.covariance))
        for i, parameter in enumerate(constants.parts)
    ]


def flight_values(
    problem: Problem, at: States, arcs: Mapping[int, FloatArray] | None = None
) -> gtsam.Values:
    """Return all variables of a flight where states stand; arcs by key, else at zero."""
    values, layout = gtsam.Values(), Layout.of(problem)
    insert_constants(values, layout, at.constants)
    for j, block in enumerate(() if problem.phase is None else problem.phase.blocks):
        key = keys.arcs(j)
        values.insert(key, np.zeros(block.size) if arcs is None else arcs[key])
    for k in range(len(problem.t_s)):
        insert_keyframe(values, layout, k, at, k)
    return values


def _parts(constants: Parameters) -> Iterator[tuple[int, int, int]]:
    """Yield key, size and first column of each constant."""
    for i, (parameter, first) in enumerate(zip(constants.parts, constants.first, strict=True)):
        yield keys.constant(i), parameter.size, first
