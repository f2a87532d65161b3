"""Motions in closed form, with what instruments measure on them."""

from collections.abc import Callable
from dataclasses import dataclass

import gtsam
import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import from_euler, log, transpose
from fgnav.graph import keys
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.states import DERIVATIVE_SCALE_S, States
from fgnav.types.flight import Imu
from tests.imu import imu_of

EARTH_N_RADPS = 7.292115e-5 * np.array([np.cos(0.85), 0.0, -np.sin(0.85)])
GRAVITY_N_MPS2 = np.array([1e-4, 0.0, 9.81])
_STEP_S = 1e-3  # of central differences


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TrueMotion:
    """Euler angles, (n, 3), and position, (n, 3), as functions of time, (n,)."""

    angles_rad: Callable[[FloatArray], FloatArray]
    p_n_m: Callable[[FloatArray], FloatArray]

    def R_nb(self, t_s: FloatArray) -> FloatArray:
        return from_euler(*self.angles_rad(t_s).T)

    def rates(self, t_s: FloatArray) -> FloatArray:
        """Body rate against n, (n, 3), to about 1e-10 rad/s."""
        h, R = _STEP_S, self.R_nb

        def turned(step_s: float) -> FloatArray:
            return log(transpose(R(t_s - step_s)) @ R(t_s + step_s)) / (2 * step_s)

        one, two, three = turned(h), turned(2 * h), turned(3 * h)
        return 1.5 * one - 0.6 * two + 0.1 * three

    def inertial_rates(self, t_s: FloatArray) -> FloatArray:
        """Body rate against inertial space, (n, 3)."""
        return self.rates(t_s) + np.einsum("nji,j->ni", self.R_nb(t_s), EARTH_N_RADPS)

    def force(self, t_s: FloatArray) -> FloatArray:
        """Specific force, (n, 3), body axes."""
        v, a = _slope(self.p_n_m, t_s), _bend(self.p_n_m, t_s)
        f_n = a - GRAVITY_N_MPS2 + 2 * np.cross(EARTH_N_RADPS, v)
        return np.einsum("nji,nj->ni", self.R_nb(t_s), f_n)

    def imu(self, until_s: float, hz: float, *, gyroscope: bool) -> Imu:
        """Point values without noise; densities of a good unit."""
        t_s = np.arange(round(until_s * hz) + 1) / hz
        return imu_of(
            t_s,
            self.force(t_s),
            self.inertial_rates(t_s) if gyroscope else None,
            accelerometer=(1e-3, 0.02, 1e-4),
        )

    def states(self, t_s: FloatArray, *, gyroscope: bool, constants: FloatArray) -> States:
        """True states at keyframes, no biases."""
        n, T0 = len(t_s), DERIVATIVE_SCALE_S
        w = np.zeros((n, 3)) if gyroscope else self.rates(t_s)
        parts = [np.zeros((n, 3)), w]
        if not gyroscope:
            parts += [T0 * _slope(self.rates, t_s), T0**2 * _bend(self.rates, t_s)]
        return States(
            R_nb=self.R_nb(t_s),
            p_n_m=self.p_n_m(t_s),
            v_n_mps=_slope(self.p_n_m, t_s),
            aux=np.hstack(parts),
            constants=constants,
        )


def _slope(of: Callable[[FloatArray], FloatArray], t_s: FloatArray) -> FloatArray:
    h = _STEP_S
    one, two = of(t_s + h) - of(t_s - h), of(t_s + 2 * h) - of(t_s - 2 * h)
    return (8 * one - two) / (12 * h)


def _bend(of: Callable[[FloatArray], FloatArray], t_s: FloatArray) -> FloatArray:
    h = 4 * _STEP_S
    one, two = of(t_s + h) + of(t_s - h), of(t_s + 2 * h) + of(t_s - 2 * h)
    return (16 * one - two - 30 * of(t_s)) / (12 * h**2)


def sine(amplitude_deg: float, rate_radps: float = 1.0) -> TrueMotion:
    """Three unlike angles that swing, on a path that winds."""

    def angles(t_s: FloatArray) -> FloatArray:
        a = np.radians(amplitude_deg)
        phases = np.outer(t_s, np.array([1.0, 0.8, 0.6]) * rate_radps) + np.array([0.3, 1.1, 2.0])
        return a * np.sin(phases) + np.array([0.1, -0.2, 0.5])

    return TrueMotion(angles_rad=angles, p_n_m=_winding)


def spin(hz: float) -> TrueMotion:
    """A roll at a constant rate and a swing of pitch and yaw."""

    def angles(t_s: FloatArray) -> FloatArray:
        roll = 2 * np.pi * hz * t_s
        return np.stack([roll, 0.05 * np.sin(t_s), 0.3 + 0.05 * np.cos(0.7 * t_s)], axis=1)

    return TrueMotion(angles_rad=angles, p_n_m=_winding)


def _winding(t_s: FloatArray) -> FloatArray:
    along = np.outer(t_s, [60.0, 25.0, -4.0])
    return along + 3.0 * np.sin(np.outer(t_s, [0.7, 0.9, 0.5]) + np.array([0.0, 1.0, 2.0]))


def moved_at_random(states: States, rng: np.random.Generator, sigma: float) -> States:
    """States a random step away."""
    n, b = len(states.p_n_m), len(states.constants)
    steps = sigma * rng.standard_normal((n, states.width))
    return states.moved(steps, sigma * rng.standard_normal(b))


def steps_of_all(width: int, column: int, step: float, n: int) -> FloatArray:
    """One column of each of n tangents, (n, width)."""
    out = np.zeros((n, width))
    out[:, column] = step
    return out


def by_differences(motion: Motion, before: States, after: States) -> list[FloatArray]:
    """Derivatives of a motion's residuals by both states and the constants, numerically."""
    n, D, b = len(before.p_n_m), before.width, len(before.constants)
    every, none = np.arange(n), np.zeros(b)

    def slopes(width: int, value: Callable[[int, float], FloatArray]) -> FloatArray:
        h = 1e-5
        columns = [(value(i, h) - value(i, -h)) / (2 * h) for i in range(width)]
        return np.stack(columns, axis=2) if width else np.zeros((n, D, 0))

    def value(first: States, second: States) -> FloatArray:
        return motion.linearise(first, second, every).value

    def step(i: int, h: float) -> FloatArray:
        return steps_of_all(D, i, h, n)

    still = np.zeros((n, D))
    return [
        slopes(D, lambda i, h: value(before.moved(step(i, h), none), after)),
        slopes(D, lambda i, h: value(before, after.moved(step(i, h), none))),
        slopes(b, lambda i, h: value(before.moved(still, h * np.eye(b)[i]), after)),
    ]


def ends(states: States) -> tuple[States, States]:
    """States at the beginning and at the end of every interval."""
    return states.at(slice(0, -1)), states.at(slice(1, None))


def every(motion: Motion) -> np.ndarray:
    """All intervals of a motion."""
    return np.arange(len(motion.t_s) - 1)


def assert_derivatives(motion: Motion, states: States) -> None:
    """Hold the Jacobians of all intervals against central differences, row by row."""
    before, after = ends(states)
    linear = motion.linearise(before, after, every(motion))
    size = np.abs(linear.before).max(axis=2, keepdims=True)
    for exact, numeric in zip(linear[1:], by_differences(motion, before, after), strict=True):
        np.testing.assert_allclose(exact / size, numeric / size, rtol=0, atol=1e-6)


def linear_system(motion: Motion, states: States, constants: FloatArray | None = None):
    """GTSAM's ``A, b`` of interval 3, its factor's error, and the kernel's of the same states."""
    linear = motion.linearise(*ends(states), every(motion))
    values = gtsam.Values()
    for row, key in ((3, 7), (4, 2)):
        values.insert(keys.pose(key), gtsam.Pose3(gtsam.Rot3(states.R_nb[row]), states.p_n_m[row]))
        values.insert(keys.velocity(key), states.v_n_mps[row])
        if constants is None:
            bias = gtsam.imuBias.ConstantBias(states.aux[row, :3], states.aux[row, 3:])
            values.insert(keys.imu_bias(key), bias)
        else:
            values.insert(keys.angular_motion(key), states.aux[row])
    if constants is not None:
        values.insert(keys.constant(1), constants)
    (factor,) = motion.factors(3, 7, 2, states.at(slice(3, 4)))
    return *factor.linearize(values).jacobian(), factor.error(values), linear
