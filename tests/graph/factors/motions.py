"""Motions in closed form, with what instruments measure on them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import from_euler, log, transpose
from fgnav.graph.factors.check import jacobian_misfit, values_of
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.parameters import Parameters
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


def ends(states: States) -> tuple[States, States]:
    """States at the beginning and at the end of every interval."""
    return states.at(slice(0, -1)), states.at(slice(1, None))


def every(motion: Motion) -> np.ndarray:
    """All intervals of a motion."""
    return np.arange(len(motion.t_s) - 1)


def assert_derivatives(motion: Motion, states: States, constants: Parameters) -> None:
    """Hold factors against differences, and the arrays of all intervals against the factors."""
    linear, values = motion.linearise(*ends(states), every(motion)), values_of(states, constants)
    mean = constants.columns("mean rate")
    for k in every(motion).tolist():
        (factor,) = motion.factors(k, k, k + 1, states.at(slice(k, k + 1)))
        assert jacobian_misfit(factor, values) < 1e-6
        A, b = factor.linearize(values).jacobian()
        before, after = linear.before[k], linear.after[k]
        expected = np.hstack([before, after, linear.shared[k, :, mean]])
        if not mean.stop:  # GTSAM's own has both biases last
            parts = before[:, :9], after[:, :9], before[:, 9:], after[:, 9:]
            expected = np.hstack(parts)
        np.testing.assert_allclose(A, expected, rtol=0, atol=1e-9 * np.abs(A).max())
        np.testing.assert_allclose(b, -linear.value[k], rtol=0, atol=1e-9 * np.abs(b).max())
        assert not np.delete(linear.shared[k], np.r_[mean], axis=1).any()
