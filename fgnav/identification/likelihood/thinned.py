"""The problem that noise is identified on: keyframes that measured something, a second apart.

Between them the motion is summed up, and nothing is lost by it: what no keyframe measures only
adds states to integrate over. Of measurements denser than a second some are left out.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.factors.vehicle.resting_rate import NAME as RESTING_RATE
from fgnav.graph.factors.vehicle.standstill import NAME as STANDSTILL
from fgnav.graph.factors.vehicle.wheels import NAME as WHEELS
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.constants import Constants, FlightConstant
from fgnav.graph.types.measurement import Linearised, Measurement, OfSensor
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.types.flight import Imu

# Keyframes with a gyroscope: a second apart, or as many as tell noise to 5 %. Without one, where no
# keyframe can be left out, a stretch of 20 s at 10 Hz.
_ENOUGH = 150
APART_S = 1.0
_STRETCH = 200
_OF_VEHICLES = (WHEELS, STANDSTILL, RESTING_RATE)
# Fields of ``Imu`` by component.
FIELDS = {
    "accelerometer": "accelerometer_noise_mps2_per_sqrt_hz",
    "gyroscope": "gyroscope_noise_radps_per_sqrt_hz",
    "accelerometer bias": "accelerometer_bias_walk_mps2_per_sqrt_s",
    "gyroscope bias": "gyroscope_bias_walk_radps_per_sqrt_s",
}


@dataclass(frozen=True, eq=False, slots=True)
class Some(OfSensor):
    """Some of a sensor's measurements; the chain reads them, GTSAM does not.

    Attributes
    ----------
    measurement : Measurement
    which : ndarray of int, shape (k,)
        Of its rows.
    row : ndarray of int, shape (k,)
        Keyframes.
    sigma_factor : float
        On their standard deviations.
    """

    measurement: Measurement
    which: IntArray
    sigma_factor: float = 1.0

    @classmethod
    def of(cls, measurement: Measurement, rows: IntArray) -> "Some":
        """Return the measurements of some keyframes, numbered anew."""
        which = np.flatnonzero(np.isin(measurement.row, rows))
        return cls(measurement, which, row=np.searchsorted(rows, measurement.row[which]))

    @property
    def name(self) -> str:
        """What reports call it."""
        return self.measurement.name

    @property
    def freedom(self) -> IntArray:
        """Directions that are known, (k,)."""
        return self.measurement.freedom[self.which]

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of some, (j,), see ``Measurement``."""
        whitened = self.measurement.linearise(at, self.which[which])
        return Linearised._make(part / self.sigma_factor for part in whitened)

    def factor(self, i: int, key: int) -> Any:  # noqa: ANN401  # GTSAM's
        """Return measurement i as a factor of keyframe ``key``."""
        return self.measurement.factor(int(self.which[i]), key)


def thinned(
    problem: SmoothingProblem,
    extra: tuple[FlightConstant, ...] = (),
    apart_s: float = APART_S,
) -> SmoothingProblem:
    """Return a problem of fewer keyframes, with constants beside its own.

    Of instruments alone: how wheels slip or stand tells no noise, and noise stated far too small
    makes them contradict what is measured.

    Parameters
    ----------
    problem : SmoothingProblem
    extra : tuple of FlightConstant
        Appended to its constants; nothing depends on them yet.
    apart_s : float
        With a gyroscope: of keyframes, unless these are too few; 0 keeps all that measured.
    """
    constants = Constants((*problem.constants.parts, *extra))
    instruments = tuple(one for one in problem.measurements if one.name not in _OF_VEHICLES)
    rows = _rows(replace(problem, measurements=instruments), apart_s)
    return SmoothingProblem(
        t_s=problem.t_s[rows],
        start=problem.start.at(rows)._replace(
            constants=np.concatenate([problem.start.constants, *(one.start for one in extra)])
        ),
        motion=_between(problem.motion, rows),
        measurements=tuple(
            Some.of(one, rows) for one in instruments if np.isin(one.row, rows).any()
        ),
        constants=constants,
        attitude_known=problem.attitude_known[rows],
    )


def scaled(imu: Imu, factors: dict[str, float]) -> Imu:
    """Return a unit with noises and walks multiplied by factors of ``INERTIAL_NOISES``."""
    changed = {}
    for component, name in FIELDS.items():
        value = getattr(imu, name)
        if value is not None:
            changed[name] = value * factors.get(component, 1.0)
    return replace(imu, **changed)


def _rows(problem: SmoothingProblem, apart_s: float) -> IntArray:
    n = len(problem.t_s)
    if not isinstance(problem.motion, Inertial):
        first = max(0, (n - _STRETCH) // 2)
        return np.arange(first, min(n, first + _STRETCH))
    measured = np.unique(np.concatenate([one.row for one in problem.measurements]))
    t_s = problem.t_s[measured]
    step_s = min(apart_s, (t_s[-1] - t_s[0]) / _ENOUGH)
    slot = np.floor((t_s - t_s[0]) / max(step_s, 1e-9) + 1e-6)
    return np.asarray(measured[np.concatenate([[True], np.diff(slot) > 0])])


def _between(motion: Motion, rows: IntArray) -> Motion:
    """Return the motion between some of its keyframes."""
    if isinstance(motion, Inertial):
        first = rows[:-1]
        spans = np.diff(motion.t_s)

        def mean(density: FloatArray) -> FloatArray:
            total = np.concatenate([[0.0 * density[0]], np.cumsum(density.T * spans, axis=-1).T])
            sums = (total[rows[1:]] - total[first]).T
            return np.asarray((sums / np.diff(motion.t_s[rows])).T)

        return replace(
            motion,
            t_s=motion.t_s[rows],
            sub_steps=1,
            gravity_n_mps2=motion.gravity_n_mps2[rows],
            accelerometer_noise=mean(motion.accelerometer_noise),
            gyroscope_noise=mean(motion.gyroscope_noise),
            bias_steps=None if motion.bias_steps is None else mean(motion.bias_steps),
        )
    if not isinstance(motion, GyroFree):
        return motion.at_times(motion.t_s[rows])
    changed: dict[str, Any] = {"t_s": motion.t_s[rows]}
    for name in ("poles_per_s", "variance_rad2ps2", "accelerometer_noise"):
        changed[name] = getattr(motion, name)[rows[:-1]]
    changed["gravity_n_mps2"] = motion.gravity_n_mps2[rows]
    if motion.multipath is not None:
        changed["multipath"] = motion.multipath.on(rows)
    return replace(motion, **changed)
