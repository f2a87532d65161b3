"""The problem that hyperparameters are identified on: fewer keyframes of the same flight.

With a gyroscope keyframes are a second apart, and the motion between them is summed up, so that
nothing of it is lost. Without one no keyframe can be left out: a run of them from the middle of the
flight stands for all. Arcs of phases begin and end with these keyframes.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fgnav.assembly.position.phases import antenna_phase
from fgnav.assembly.prepared import PreparedFlight
from fgnav.checks import FloatArray, IntArray
from fgnav.graph.factors.vehicle.resting_rate import NAME as RESTING_RATE
from fgnav.graph.factors.vehicle.standstill import NAME as STANDSTILL
from fgnav.graph.factors.vehicle.wheels import NAME as WHEELS
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.sensor_rows import WrappedSensor
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.sensor import Linearised, Sensor
from fgnav.graph.types.states import States

_KEYFRAMES = 200  # tell the logarithm of a standard deviation to 3 %
_INTERVAL_S = 1.0
_VEHICLE = (WHEELS, STANDSTILL, RESTING_RATE)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Subset(WrappedSensor):
    """Some of a sensor's measurements, numbered by the keyframes of a decimated problem."""

    indices: IntArray  # (k,): of its rows
    keyframes: IntArray  # (k,)

    @classmethod
    def at(cls, measurement: Sensor, keyframes: IntArray) -> "Subset":
        """Return the measurements of some keyframes."""
        indices = np.flatnonzero(np.isin(measurement.row, keyframes))
        keyframe_indices = np.searchsorted(keyframes, measurement.row[indices])
        return cls(measurement=measurement, indices=indices, keyframes=keyframe_indices)

    @property
    def row(self) -> IntArray:
        """Keyframes, (k,)."""
        return self.keyframes

    @property
    def freedom(self) -> IntArray:
        """Degrees of freedom of each measurement, (k,)."""
        return self.measurement.freedom[self.indices]

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of some, (j,); see ``Sensor``."""
        return self.measurement.linearise(at, self.indices[indices])

    def factor(self, i: int, key: int) -> Any:  # noqa: ANN401  # GTSAM's
        """Return measurement i as a factor of keyframe ``key``."""
        return self.measurement.factor(int(self.indices[i]), key)

    def move(self, row: IntArray) -> "Subset":
        """Move the measurements to other keyframes, (k,)."""
        return replace(self, keyframes=row)


def decimated(prepared: PreparedFlight) -> tuple[Problem, IntArray]:
    """Return a problem of fewer keyframes, and which they are, (k,).

    Constraints of vehicles are left out: slip of wheels has no noise that is to be identified.
    """
    problem = prepared.problem
    sensors = tuple(sensor for sensor in problem.sensors if sensor.name not in _VEHICLE)
    keyframes = _keyframes(problem, sensors)
    start = problem.start.at(keyframes)
    t_s = problem.t_s[keyframes]
    observed = []
    for observation in prepared.observed:
        kept = np.isin(observation.row, keyframes)
        row = np.searchsorted(keyframes, observation.row[kept])
        observed.append(observation._replace(row=row, epoch=observation.epoch[kept]))
    return (
        Problem(
            t_s=t_s,
            start=start,
            motion=_motion_between(problem.motion, keyframes),
            sensors=tuple(
                Subset.at(sensor, keyframes)
                for sensor in sensors
                if np.isin(sensor.row, keyframes).any()
            ),
            constants=problem.constants,
            attitude_known=problem.attitude_known[keyframes],
            phase=antenna_phase(tuple(observed), t_s, start.R_nb, problem.constants).phase,
        ),
        keyframes,
    )


def _keyframes(problem: Problem, sensors: tuple[Sensor, ...]) -> IntArray:
    n = len(problem.t_s)
    if not isinstance(problem.motion, Inertial):
        first = max(0, (n - _KEYFRAMES) // 2)
        return np.arange(first, min(n, first + _KEYFRAMES))
    rows = [sensor.row for sensor in (*sensors, problem.phase) if sensor is not None]
    measured = np.unique(np.concatenate(rows))
    t_s = problem.t_s[measured]
    step_s = min(_INTERVAL_S, (t_s[-1] - t_s[0]) / _KEYFRAMES)
    slot = np.floor((t_s - t_s[0]) / max(step_s, 1e-9) + 1e-6)
    return np.asarray(measured[np.concatenate([[True], np.diff(slot) > 0])])


def _motion_between(motion: Motion, keyframes: IntArray) -> Motion:
    """Return the motion between some of its keyframes."""
    if isinstance(motion, Inertial):
        span_s = np.diff(motion.t_s)

        def mean(density: FloatArray) -> FloatArray:
            total = np.concatenate([[0.0 * density[0]], np.cumsum(density.T * span_s, axis=-1).T])
            sums = (total[keyframes[1:]] - total[keyframes[:-1]]).T
            return np.asarray((sums / np.diff(motion.t_s[keyframes])).T)

        return replace(
            motion,
            t_s=motion.t_s[keyframes],
            sub_steps=1,
            gravity_n_mps2=motion.gravity_n_mps2[keyframes],
            accelerometer_noise=mean(motion.accelerometer_noise),
            gyroscope_noise=mean(motion.gyroscope_noise),
            bias_steps=None if motion.bias_steps is None else mean(motion.bias_steps),
        )
    return motion.at_times(motion.t_s[keyframes])
