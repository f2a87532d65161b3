"""The clock of the inertial unit as constants of a problem: offset and rate of its timestamps.

Timestamps that need ``o + r (t - t_0)`` added to agree with GNSS time make the residuals of an
interval, to first order,

    r(o, r) = r(0) + dr/do (o + r (t - t_0))

with the derivative by central differences of the same motion with moved timestamps, about the
states that a search has reached. That is exact where the clock is right; so timestamps are moved by
what is found, until nothing is left to move.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple, cast

import numpy as np

from fgnav.assembly.calibration_request import calibration_requests
from fgnav.checks import FloatArray, IntArray
from fgnav.graph.delayed import CLOCK_OFFSET, PPM
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.motion import LinearisedMotion, Motion
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import States
from fgnav.noise.rescaled import WrappedMotion
from fgnav.types.flight import Flight, Imu

# Half of the time over which samples are averaged into the derivative: several samples of any unit,
# so that their noise is small beside the change of force and rate.
_STEP_S = 0.05


class ClockCorrection(NamedTuple):
    """Correction of an IMU's timestamps: offset at mid-record and rate."""

    offset_s: float = 0.0
    rate_ppm: float = 0.0

    def __bool__(self) -> bool:
        """Return True if timestamps change."""
        return any(self)

    def at(self, later_s: float) -> "ClockCorrection":
        """Return the correction with its offset at a later time."""
        return ClockCorrection(self.offset_s + PPM * self.rate_ppm * later_s, self.rate_ppm)

    def applied(self, flight: Flight, middle_s: float) -> Flight:
        """Return a flight with corrected timestamps."""
        imu = flight.imu
        if imu is None or not self:
            return flight
        t_s = imu.t_s + self.offset_s + PPM * self.rate_ppm * (imu.t_s - middle_s)
        return replace(flight, imu=replace(imu, t_s=t_s))


def middle_of_record_s(imu: Imu) -> float:
    """Return the time for which a clock's offset is stated."""
    return float(imu.t_s[[0, -1]].mean())


@dataclass(frozen=True, eq=False, slots=True)
class ClockedMotion(WrappedMotion):
    """A motion that depends on two constants of the flight, offset and rate of the unit's clock."""

    # The same motion with timestamps ``_STEP_S`` earlier and later.
    early: Motion
    late: Motion
    column: int  # of the offset among the constants; the rate follows
    since_s: FloatArray  # (n - 1,): of intervals, from the middle of the record
    slope: FloatArray = field(default_factory=lambda: np.zeros((0, 0, 2)))  # of residuals

    def about(self, states: States) -> "ClockedMotion":
        """Return a copy with the slope, (n - 1, D, 2), of whitened residuals at given states."""
        intervals = np.arange(len(self.since_s))
        before, after = states.at(intervals), states.at(intervals + 1)
        early, late = (
            one.linearise(before, after, intervals).value for one in (self.early, self.late)
        )
        offset = (late - early) / (2 * _STEP_S)
        rate = offset * PPM * self.since_s[:, None]
        return replace(self, slope=np.stack([offset, rate], axis=2))

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        """Return whitened residuals of some intervals, (j,)."""
        linear, slope = self.motion.linearise(before, after, intervals), self.slope[intervals]
        columns = slice(self.column, self.column + 2)
        shared = linear.shared.copy()
        shared[:, :, columns] += slope
        value = linear.value + slope @ before.constants[columns]
        return linear._replace(value=value, shared=shared)


def with_clock(problem: Problem) -> Problem:
    """Return a problem with the unit's clock among its constants, if it has none yet."""
    if problem.constants.column(CLOCK_OFFSET) >= 0:
        return problem
    motion = problem.motion
    if not isinstance(motion, Inertial | GyroFree):
        return problem
    (request,) = calibration_requests(["clock"])
    column = problem.constants.width
    imu = motion.imu
    early, late = (
        replace(motion, imu=replace(imu, t_s=imu.t_s + by_s)) for by_s in (-_STEP_S, _STEP_S)
    )
    since_s = (motion.t_s[:-1] + motion.t_s[1:]) / 2 - middle_of_record_s(imu)
    clocked = ClockedMotion(motion, early, late, column, since_s).about(problem.start)
    return replace(problem.with_constants(request.parameters()), motion=cast("Motion", clocked))
