"""A detector whose quadrants have unlike gains: its spot is off by what is no angle.

True logarithms of currents are ``l = (ln I4 / I2, ln I1 / I3) - c``. With A the whitening rows
across the direction e that is seen so, lines of sight err by ``-A de/dc`` for each of c, sought by
steps, each about the currents that the steps before have put right.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.frontend.sensors.directional import sight
from fgnav.graph.factors.directions import Directions
from fgnav.graph.factors.line_of_sight import LineOfSight
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.measurement_factor import of_measurement, parts_of
from fgnav.graph.types.constants import Constants, FlightConstant, flight_constant
from fgnav.graph.types.measurement import Linearised, Measurement, OfAnother
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.identification.lasting.error import LastingError, least_of_use
from fgnav.identification.likelihood.changed_samples import minimum_below
from fgnav.identification.likelihood.thinned import Some
from fgnav.identification.spans.errors import ANY_SHARE
from fgnav.optional_gtsam import gtsam
from fgnav.types.flight import Flight, Seeker

QUADRANTS = "quadrants"
KINDS = (QUADRANTS,)
_STEPS = 4  # at most: each leaves a few hundredths of what is left
_STEP = 1e-3  # of difference quotients


def quadrant_error(
    problem: SmoothingProblem, stated: Solution, seeker: Seeker
) -> LastingError | None:
    """Return by how much pairs of quadrants are out of balance; None without a minimum.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    seeker : Seeker
    """
    part = flight_constant(QUADRANTS, ("I4 / I2", "I1 / I3"), "", ANY_SHARE, reported=False)
    off, error, cost = np.zeros(2), None, stated.cost
    for _ in range(_STEPS):
        free = _freed(problem, replace(part, mean=-off), in_balance(seeker, off), stated.states)
        if free is None:
            return None
        solution = minimum_below(free, least_of_use(problem, cost, 2 if error is None else 1))
        if solution is None:
            return None
        step, cost = solution.states.constants[-2:], solution.cost
        off = off + step
        error = LastingError.of(part, free, stated.cost, solution)._replace(off=off)
        if (step**2 < error.covariance.diagonal()).all():
            return error
    return error


def in_balance(seeker: Seeker, off: FloatArray) -> Seeker:
    """Return a detector with currents of like gains, by what logarithms of ratios are off, (2,)."""
    gains = np.exp([-off[1], 0.0, 0.0, -off[0]])
    return replace(seeker, currents=seeker.currents * gains)


def put_right(flight: Flight, error: LastingError) -> Flight:
    """Return a flight whose quadrants have like gains."""
    if flight.seeker is None:
        return flight
    return replace(flight, seeker=in_balance(flight.seeker, error.off))


def sentence(error: LastingError) -> str:
    """Return what is to be said of it."""
    ratios = np.exp(error.off)
    sigma = ratios * np.sqrt(np.diag(error.covariance))
    return (
        f"The detector's quadrants have unlike gains: I4 / I2 is {ratios[0]:.3f} ± {sigma[0]:.3f}, "
        f"I1 / I3 {ratios[1]:.3f} ± {sigma[1]:.3f} times what it should be; taken out."
    )


def _freed(
    problem: SmoothingProblem, part: FlightConstant, seeker: Seeker, at: States
) -> SmoothingProblem | None:
    """Return a problem in which the balance is free; None where the spot leaves the detector."""
    free, column, measurements = problem.with_constants((part,)), problem.constants.width, []
    for one in problem.measurements:
        inner = one.measurement if isinstance(one, Some) else one
        if not isinstance(inner, LineOfSight):
            measurements.append(one)
            continue
        seen = _seen(problem, seeker, one, at)
        if seen is None:
            return None
        by = np.zeros((len(one.row), 2, 2))
        for i, step in enumerate(np.diag([_STEP, _STEP])):
            stepped = _seen(problem, in_balance(seeker, step), one, at)
            if stepped is None:
                return None
            change = (stepped.e_b - seen.e_b) / _STEP
            by[:, :, i] = -np.einsum("kij,kj->ki", seen.across_b, change)
        constants = free.constants
        again = replace(inner, row=one.row, across_b=seen.across_b, constants=constants)
        measurements.append(
            Unbalanced(measurement=again, by=by, column=column, constants=constants)
        )
    return replace(free, measurements=tuple(measurements))


def _seen(
    problem: SmoothingProblem, seeker: Seeker, one: Measurement, at: States
) -> Directions | None:
    """Return directions at a measurement's keyframes; None unless all are seen."""
    motion, rows = problem.motion, one.row
    if not isinstance(motion, GyroFree | Inertial):
        return None
    seen, _ = sight(seeker, motion.imu, problem.t_s[rows], at.p_n_m[rows])
    return seen if seen is not None and np.isfinite(seen.e_b).all() else None


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Unbalanced(OfAnother):
    """Lines of sight of a detector whose pairs of quadrants are out of balance.

    Attributes
    ----------
    measurement : Measurement
    by : ndarray, shape (k, 2, 2)
        How residuals change by each pair's balance.
    column : int
        First of the two constants c.
    constants : Constants
    """

    measurement: Measurement
    by: FloatArray
    column: int
    constants: Constants

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of some, (j,), see ``Measurement``."""
        value, state, shared = self.measurement.linearise(at, which)
        columns, shared = slice(self.column, self.column + 2), shared.copy()
        shared[:, :, columns] += self.by[which]
        return Linearised(value + self.by[which] @ at.constants[columns], state, shared)

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return measurement i as a factor of keyframe ``key``."""
        parts = parts_of(self.constants, self.constants.first)
        return of_measurement(self, i, key, ("pose",), parts, rows=2)

    def on(self, row: IntArray) -> "Unbalanced":
        """Return the same measurements at other rows, (k,)."""
        return replace(self, measurement=self.measurement.on(row))
