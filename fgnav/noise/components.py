"""Noise of a problem as components, each a factor on a standard deviation, and their likelihood.

Component c multiplies its standard deviation by ``exp(theta_c)``. With whitened residuals r at the
minimum of the problem, their Jacobian J, the covariance P of the states, ``M = I - J P J'`` and C
the component's share of the rows' covariance, the logarithm of the marginal likelihood has [1]_

    gradient       r' C r - tr(C M)
    information    2 tr(C M C' M)

What rows of one interval or measurement contribute to the information is computed; products of
distant residuals only add to it, and it is at most ``2 tr(C M)``: the mean of both is used.

White noise of the inertial unit, and that of fixes, has two components where a flight stands still.

References
----------
.. [1] Harville: Maximum likelihood approaches to variance component estimation and to related
   problems, Journal of the American Statistical Association 72, 1977, equation 5.5.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.noise.clock import ClockedMotion
from fgnav.noise.rescaled import RescaledMotion, RescaledSensor

if TYPE_CHECKING:
    from fgnav.graph.types.motion import Motion

AT_REST = " at rest"  # after the name of a component
WHITE = ("accelerometer", "gyroscope")
INSTRUMENTS = ("barometric height", "line of sight", "magnetic field")
_RESTING = ("position", "velocity")
_CHUNK = 128  # intervals at once: 2 MB of their covariances
_KEPT = 4000  # intervals whose covariances are kept from one theta to the next: 60 MB


class Score(NamedTuple):
    """Derivatives of the log marginal likelihood by theta, (c,), at a minimum."""

    squares: FloatArray  # r' C r
    redundancy: FloatArray  # tr(C M)
    information: FloatArray  # (c, c)

    @property
    def gradient(self) -> FloatArray:
        """By theta, (c,)."""
        return self.squares - self.redundancy


class Standstill(NamedTuple):
    """Keyframes of a decimated problem at standstill."""

    keyframes: BoolArray  # (n,)
    share: FloatArray  # (n - 1,), of each interval


class _SensorNoise(NamedTuple):
    name: str
    measurement: int  # its place in the problem
    rows: IntArray  # of its measurements


@dataclass(frozen=True, eq=False, slots=True)
class NoiseComponents:
    """The noise of a problem by its components."""

    problem: Problem  # with the nominal noise
    names: tuple[str, ...]  # of the c components: those of the motion, then those of sensors
    _motion: tuple[str, ...]
    _sensors: tuple[_SensorNoise, ...]
    _standstill: Standstill | None
    _kept: dict[int, tuple[FloatArray, FloatArray]] = field(default_factory=dict, repr=False)

    @classmethod
    def of(
        cls, problem: Problem, sensors: tuple[str, ...], standstill: Standstill | None
    ) -> "NoiseComponents":
        """Return the components of a problem.

        Parameters
        ----------
        problem : Problem
        sensors : tuple of str
            Measurements whose noise is one factor on the nominal.
        standstill : Standstill or None
        """
        motion = problem.motion.noise_parts(slice(0)).names
        if standstill is not None and not standstill.share.any():
            standstill = None
        if standstill is not None:
            motion += tuple(name + AT_REST for name in motion if name in WHITE)
        components: list[_SensorNoise] = []
        for i, sensor in enumerate(problem.sensors):
            if sensor.name not in sensors:
                continue
            rests = np.zeros(len(sensor.row), dtype=np.bool_)
            if standstill is not None and sensor.name in _RESTING:
                rests = standstill.keyframes[sensor.row]
            for name, rows in ((sensor.name, ~rests), (sensor.name + AT_REST, rests)):
                if rows.any():
                    components.append(_SensorNoise(name, i, np.flatnonzero(rows)))
        names = (*motion, *dict.fromkeys(sensor.name for sensor in components))
        return cls(problem, names, motion, tuple(components), standstill)

    def about(self, states: States) -> "NoiseComponents":
        """Return a copy with the clock's derivatives at given states, if the clock is free."""
        motion = self.problem.motion
        if not isinstance(motion, ClockedMotion):
            return self
        return replace(self, problem=replace(self.problem, motion=motion.about(states)))

    def problem_at(self, theta: FloatArray) -> Problem:
        """Return the problem with standard deviations multiplied by ``exp(theta)``, (c,)."""
        factor = {name: float(f) for name, f in zip(self.names, np.exp(theta), strict=True)}
        of_sensor: dict[int, FloatArray] = {}
        for sensor in self._sensors:
            rows = self.problem.sensors[sensor.measurement].row
            of_sensor.setdefault(sensor.measurement, np.ones(len(rows)))[sensor.rows] = factor[
                sensor.name
            ]
        measurements = tuple(
            RescaledSensor(measurement=sensor, factors=of_sensor[i]) if i in of_sensor else sensor
            for i, sensor in enumerate(self.problem.sensors)
        )
        white = [
            np.linalg.inv(np.linalg.cholesky(fixed + np.einsum("c,kcij->kij", variance, parts)))
            for _, parts, fixed, variance in self._intervals(theta)
        ]
        motion = cast("Motion", RescaledMotion(self.problem.motion, np.concatenate(white)))
        return replace(self.problem, motion=motion, sensors=measurements)

    def score(self, theta: FloatArray, problem: Problem, solution: Solution) -> Score:
        """Return the derivatives at the minimum of ``problem_at(theta)``."""
        c = len(self.names)
        total = Score(np.zeros(c), np.zeros(c), np.zeros((c, c)))
        n_motion = len(self._motion)
        for k, C in self._motion_shares(theta, problem):
            r, J, P = _interval_rows(problem, solution, k)
            CM = C @ (np.eye(r.shape[1]) - J @ P @ J.swapaxes(1, 2))[:, None]
            total.squares[:n_motion] += np.einsum("ki,kcij,kj->c", r, C, r)
            total.redundancy[:n_motion] += np.einsum("kcii->c", CM)
            total.information[:n_motion, :n_motion] += 2 * np.einsum("kcij,kdji->cd", CM, CM)
        for sensor in self._sensors:
            i = self.names.index(sensor.name)
            r, M = _measured(problem, solution, sensor)
            total.squares[i] += float((r**2).sum())
            total.redundancy[i] += float(np.einsum("kii->", M))
            total.information[i, i] += 2 * float(np.einsum("kij,kji->", M, M))
        spread = (total.information + np.diag(2 * total.redundancy.clip(0))) / 2
        return total._replace(information=spread)

    def residuals(self, name: str, problem: Problem, solution: Solution) -> FloatArray:
        """Return whitened residuals of a component of a sensor, (k, m), in order of time."""
        (sensor,) = (sensor for sensor in self._sensors if sensor.name == name)
        return _measured(problem, solution, sensor)[0]

    def _motion_shares(
        self, theta: FloatArray, problem: Problem
    ) -> Iterator[tuple[IntArray, FloatArray]]:
        """Yield some intervals, (k,), and shares C of their rows' covariance, (k, c, D, D)."""
        for k, parts, _, variance in self._intervals(theta):
            W = cast("RescaledMotion", problem.motion).white[k][:, None]
            yield k, variance[:, None, None] * (W @ parts @ W.swapaxes(2, 3))

    def _intervals(
        self, theta: FloatArray
    ) -> Iterator[tuple[IntArray, FloatArray, FloatArray, FloatArray]]:
        """Yield some intervals, (k,), shares of their covariance, the rest of it, and variances."""
        variance = np.exp(2 * theta[: len(self._motion)])
        n = len(self.problem.t_s) - 1
        for begin in range(0, n, _CHUNK):
            of = slice(begin, min(begin + _CHUNK, n))
            shares = self._kept.get(begin)
            if shares is None:
                shares = self._shares(of)
                if n <= _KEPT:
                    self._kept[begin] = shares
            yield np.arange(of.start, of.stop), *shares, variance

    def _shares(self, of: slice) -> tuple[FloatArray, FloatArray]:
        """Compute the components of the rows' covariance, (k, c, D, D), and the remainder."""
        names, parts, fixed = self.problem.motion.noise_parts(of)
        if self._standstill is None:
            return parts, fixed
        share = self._standstill.share[of][:, None, None, None]
        white = [names.index(name) for name in names if name in WHITE]
        moving = parts.copy()
        moving[:, white] *= 1.0 - share
        return np.concatenate([moving, parts[:, white] * share], axis=1), fixed


def _interval_rows(
    problem: Problem, solution: Solution, k: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return residuals, (k, D), Jacobians and covariances of both states and the constants."""
    if solution.cross is None:
        raise ValueError("solution: needs covariances of neighbours")
    linear = problem.motion.linearise(solution.states.at(k), solution.states.at(k + 1), k)
    J = np.concatenate([linear.before, linear.after, linear.shared], axis=2)
    between, X = solution.cross[k], solution.constant_cross
    P = np.block(
        [
            [solution.covariance[k], between, X[k]],
            [between.swapaxes(1, 2), solution.covariance[k + 1], X[k + 1]],
            [X[k].swapaxes(1, 2), X[k + 1].swapaxes(1, 2), solution.constant_covariance[k]],
        ]
    )
    return linear.value, J, P


def _measured(
    problem: Problem, solution: Solution, sensor_noise: _SensorNoise
) -> tuple[FloatArray, FloatArray]:
    """Return residuals, (k, m), and ``M``, (k, m, m), of rows that measure something."""
    measurement = problem.sensors[sensor_noise.measurement]
    keyframes = measurement.row[sensor_noise.rows]
    linear: Linearised = measurement.linearise(solution.states.at(keyframes), sensor_noise.rows)
    J = np.concatenate([linear.state, linear.shared], axis=2)
    X = solution.constant_cross[keyframes]
    P = np.block(
        [
            [solution.covariance[keyframes], X],
            [X.swapaxes(1, 2), solution.constant_covariance[keyframes]],
        ]
    )
    measures: BoolArray = np.asarray(linear.state.any(axis=2))
    M = np.eye(J.shape[1]) - J @ P @ J.swapaxes(1, 2)
    M *= measures[:, :, None] & measures[:, None, :]
    return np.where(measures, linear.value, 0.0), M
