"""A measurement of another time than its keyframe's: clocks that disagree, values that are late.

A keyframe is where the inertial unit's samples lead by its tags up to the measurement's tag. If
the unit's clock needs ``o + r (t - t_0)`` added to agree with the measurement's, and the
measurement is of ``d`` before its tag, it is of the state ``s = -(o + r (t - t_0) + d)`` later,
where [1]_, with the body rate w, specific force f less its bias, and gravity g,

    R' = R Exp(s w)     v' = v + s a     p' = p + s v + s^2 a / 2     w' = w + s dw/dt
    a = R f + g

A gyroscope's rate is carried in its bias: measured less ``b - s dw/dt``.

References
----------
.. [1] Nilsson, Skog, Handel: Joint state and measurement time-delay estimation of nonlinear state
   space systems, 10th ISSPA, 2010; Groves: Principles of GNSS, Inertial, and Multisensor
   Integrated Navigation Systems, 2nd edition, 2013, section 14.3.1 (synchronisation).
"""

from dataclasses import dataclass, fields, replace

import gtsam
import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry.rotations import transpose
from fgnav.graph import delayed_kernel
from fgnav.graph.sensor_rows import WrappedSensor, rate_variables, sensor_factor
from fgnav.graph.types.arrays import contiguous
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.sensor import Linearised, Sensor
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States

CLOCK_OFFSET, CLOCK_RATE, VELOCITY_DELAY = "clock offset", "clock rate", "velocity delay"
_NO_GYROSCOPE = np.empty((0, 3))
PPM = 1e-6


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TimedMotion:
    """Kinematics at keyframes, by which states are propagated over small delays."""

    since_s: FloatArray  # (n,): from the time at which the clock's offset holds
    # Mean specific forces just before and after each keyframe.
    force_before_b_mps2: FloatArray  # (n, 3)
    force_after_b_mps2: FloatArray  # (n, 3)
    # Keyframes before which forces were recorded so long: what is late there can be carried.
    led: BoolArray  # (n,)
    measured_b_radps: FloatArray | None  # (n, 3): the gyroscope's rates; None: the state's
    slope_b_radps2: FloatArray | None  # (n, 3): how those rates change; None: as the state's do
    gravity_n_mps2: FloatArray  # (n, 3)
    earth_rate_n_radps: FloatArray  # (3,)

    def __post_init__(self) -> None:
        """Make the arrays as the kernel is compiled for."""
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and not value.flags.carray:
                object.__setattr__(self, field.name, np.require(value, value.dtype, ["C", "W"]))

    def at(self, row: IntArray) -> "TimedMotion":
        """Select keyframes, (k,)."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        del given["earth_rate_n_radps"]
        return replace(self, **{name: v[row] for name, v in given.items() if v is not None})


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Delayed(WrappedSensor):
    """Measurements of other times than their keyframes'."""

    motion: TimedMotion  # at the keyframes of the k measurements
    # Names of the unit's clock, s and parts per million, and of the measurement's delay, s.
    times: tuple[str, str, str]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the constants in the model."""
        return (*self.times, *self.measurement.parameters)

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of some, (j,), see ``Sensor``."""
        later_s, by_constant = _delays(
            self.constants, self.times, at.constants, self.motion.since_s[indices]
        )
        moved, Phi, by_time = _carried(*contiguous(at, indices), later_s, self.motion)
        value, state, shared = self.measurement.linearise(moved, indices)
        by_delay = np.einsum("kmd,kd->km", state, by_time)[:, :, None]
        return Linearised(value, state @ Phi, shared + by_delay * by_constant[:, None])

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return measurement i as a factor of keyframe ``key``."""
        return sensor_factor(self, i, key, rate_variables(self.motion.measured_b_radps))


def on_gnss_time(solution: Solution, motion: TimedMotion, constants: Parameters) -> Solution:
    """Return a solution whose keyframes, (n,), are at their tags by GNSS, not by the unit's clock.

    Both are the same where no clock is among the constants.
    """
    if constants.column(CLOCK_OFFSET) < 0:
        return solution
    at = solution.states
    values = at.constants if solution.constants is None else solution.constants
    times = CLOCK_OFFSET, CLOCK_RATE, ""
    later_s, by_constant = _delays(constants, times, values, motion.since_s)
    moved, Phi, by_time = _carried(*contiguous(at, np.arange(len(later_s))), later_s, motion)
    B = by_time[:, :, None] * by_constant[:, None, :]
    X, S = solution.constant_cross, solution.constant_covariance
    cross = Phi @ X @ transpose(B)
    return replace(
        solution,
        states=moved,
        covariance=Phi @ solution.covariance @ transpose(Phi)
        + cross
        + transpose(cross)
        + B @ S @ transpose(B),
        cross=None,
        constant_cross=Phi @ X + B @ S,
    )


def _delays(
    constants: Parameters, times: tuple[str, str, str], values: FloatArray, since_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Compute how much later j states are, (j,), and the derivatives by the constants, (j, b).

    Parameters
    ----------
    constants : Parameters
    times : tuple of str
        Names of the clock's offset, its rate, and a delay; none of those that are not estimated.
    values : ndarray, shape (b,) or (j, b)
    since_s : ndarray, shape (j,)
        From the time at which the offset holds.
    """
    by_constant = np.zeros((len(since_s), constants.width))
    slopes = np.stack([-np.ones(len(since_s)), -PPM * since_s, -np.ones(len(since_s))])
    for name, slope in zip(times, slopes, strict=True):
        if (column := constants.column(name)) >= 0:
            by_constant[:, column] = slope
    return (by_constant * values).sum(axis=1), by_constant


def _carried(
    at: States, indices: IntArray, later_s: FloatArray, motion: TimedMotion
) -> tuple[States, FloatArray, FloatArray]:
    """Return states a time later, (j,), their derivatives by the states, (j, D, D), and by time."""
    measured, slope = motion.measured_b_radps, motion.slope_b_radps2
    R_nb, p_n_m, v_n_mps, aux, Phi, by_time = delayed_kernel.carried(
        at,
        later_s,
        indices,
        (motion.force_before_b_mps2, motion.force_after_b_mps2),
        _NO_GYROSCOPE if measured is None else measured,
        _NO_GYROSCOPE if slope is None else slope,
        motion.gravity_n_mps2,
        motion.earth_rate_n_radps,
    )
    moved = States(R_nb=R_nb, p_n_m=p_n_m, v_n_mps=v_n_mps, aux=aux, constants=at.constants)
    return moved, Phi, by_time


def on_clock(
    measurement: Sensor, motion: TimedMotion, *, delay: str = "", clock: bool = True
) -> Sensor:
    """Return a measurement of a problem with its delay, and the unit's clock, if it has any.

    Parameters
    ----------
    measurement : Sensor
    motion : TimedMotion
        At all keyframes.
    delay : str
        Name of the measurement's own delay.
    clock : bool
        Whether it is to depend on the clock.
    """
    wanted = (CLOCK_OFFSET, CLOCK_RATE, delay) if clock else ("", "", delay)
    constants = measurement.constants
    offset, rate, late = (name if constants.column(name) >= 0 else "" for name in wanted)
    if not (offset or rate or late):
        return measurement
    times = offset, rate, late
    return Delayed(measurement=measurement, motion=motion.at(measurement.row), times=times)
