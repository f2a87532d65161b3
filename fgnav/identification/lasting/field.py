"""A magnetometer turned in the body or drifting, or a field of another declination than stated.

They are constants of its measurements, of the direction of m_n in the magnetometer's axes:

    turned: Exp(c)' R_nb' m_n    declination: R_nb' Exp(d e_down) m_n    drift: R_nb' m_n + o + u t

t from the first sample, o the hard iron.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.frontend.calibration_request import turn_of
from fgnav.geometry.rotations import exp
from fgnav.graph.factors.magnetometer import MagneticField
from fgnav.graph.measurement_factor import of_measurement, parts_of
from fgnav.graph.turned import Turned
from fgnav.graph.types.constants import Constants, FlightConstant, flight_constant
from fgnav.graph.types.measurement import Linearised, Measurement, OfAnother
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import ROTATION, States
from fgnav.identification.lasting.error import LastingError, least_of_use
from fgnav.identification.likelihood.changed_samples import minimum_below, step_promises
from fgnav.identification.likelihood.thinned import Some
from fgnav.identification.track.windows import FALSE_ALARM
from fgnav.optional_gtsam import gtsam
from fgnav.types.flight import Flight

KINDS = MAGNETOMETER, DECLINATION, DRIFT = "magnetometer", "declination", "drift of hard iron"
_FIELD = "magnetic field"
_FIXED = 1e-4  # of what is known of a constant: next to nothing moves it
# 1-sigma of a field that is stated without its declination, rad: that of the Earth's field is 16
# degrees RMS between 60 degrees south and north (IGRF-13 of 2020, to degree 4, by area).
_DECLINATION_RAD = np.radians(16.0)


def field_errors(problem: SmoothingProblem, stated: Solution) -> Iterator[LastingError]:
    """Yield all three, as a problem tells them; as far as they have a minimum.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    """
    if not any(one.name == _FIELD for one in problem.measurements):
        return
    for part in (
        turn_of(MAGNETOMETER),
        flight_constant(DECLINATION, ("east",), "rad", _DECLINATION_RAD),
    ):
        error = _error(problem, stated, part)
        if error is not None:
            yield error
    (iron,) = (one for one in problem.constants.parts if one.name == "hard iron")
    # In all of the record as much as it may be off throughout, or as much as it is.
    sigma = float(np.sqrt(iron.covariance[0, 0]) / np.ptp(problem.t_s))
    error = _error(problem, stated, flight_constant(DRIFT, iron.axes, "uT/s", sigma), 2)
    if error is not None and np.abs(error.off).max() > sigma:
        sigma = float(np.linalg.norm(error.off))
        error = _error(problem, stated, flight_constant(DRIFT, iron.axes, "uT/s", sigma))
    if error is not None:
        yield error


def _error(
    problem: SmoothingProblem, stated: Solution, part: FlightConstant, left: int = 1
) -> LastingError | None:
    """Return an error by the minimum of the problem in which it is free; None without one."""
    free, column = problem.with_constants((part,)), problem.constants.width
    since_s = problem.t_s - problem.t_s[0]

    def freed(one: Measurement) -> Measurement:
        if one.name != _FIELD:
            return one
        if part.name == DRIFT:
            return _drifting(one, column, since_s[one.row])
        kind = Turned if part.name == MAGNETOMETER else Declined
        return kind(measurement=one, column=column, constants=free.constants)

    free = replace(free, measurements=tuple(map(freed, free.measurements)))
    enough = least_of_use(problem, stated.cost, left)
    solution = minimum_below(free, enough)
    if solution is None:
        part_way = least_of_use(problem, stated.cost, left + 1)
        at_step = _at_step(free, stated.states, part, part_way)
        solution = None if at_step is None else minimum_below(free, enough, at_step.states)
    return None if solution is None else LastingError.of(part, free, stated.cost, solution)


def _at_step(
    free: SmoothingProblem, at: States, part: FlightConstant, enough: float
) -> Solution | None:
    """Return the minimum of states with a constant held where its score's own step leads.

    None without one of at most a cost.

    Of ten degrees at once with states bent to none of them a step leads to no less (variable
    projection: Golub, Pereyra, SIAM Journal on Numerical Analysis 10, 1973).
    """
    first = free.constants.width - part.size
    begin = at._replace(constants=np.append(at.constants, part.start))
    step = part.start + step_promises(free, begin, first)[1]
    fixed = replace(part, mean=step, covariance=_FIXED**2 * part.covariance)
    problem = replace(free, constants=Constants((*free.constants.parts[:-1], fixed)))
    begin = at._replace(constants=np.append(at.constants, step))
    return minimum_below(problem, enough, begin)


def _drifting(one: Measurement, column: int, since_s: FloatArray) -> Measurement:
    if isinstance(one, Some):
        all_s = np.zeros(len(one.measurement.row))
        all_s[one.which] = since_s
        return replace(one, measurement=_drifting(one.measurement, column, all_s))
    return replace(cast("MagneticField", one), drift_column=column, since_s=since_s)


def put_right(flight: Flight, error: LastingError) -> Flight:
    """Return a flight with samples in the body's axes, or a field of that declination."""
    field = flight.magnetometer
    if field is None:
        return flight
    if error.kind == MAGNETOMETER:
        R = exp(error.off[None])[0]
        return replace(flight, magnetometer=replace(field, field_b_ut=field.field_b_ut @ R.T))
    if error.kind == DRIFT:
        steady = field.field_b_ut - np.outer(field.t_s - field.t_s[0], error.off)
        return replace(flight, magnetometer=replace(field, field_b_ut=steady))
    m_n_ut = exp(np.array([[0.0, 0.0, error.off[0]]]))[0] @ field.field_n_ut
    return replace(flight, magnetometer=replace(field, field_n_ut=m_n_ut))


def sentence(error: LastingError, share: float) -> str:
    """Return what is to be said of it; ``share``: probability that no sensor is turned instead."""
    unit = 1.0 if error.kind == DRIFT else np.degrees(1.0)
    off, sigma = unit * error.off, unit * np.sqrt(np.diag(error.covariance))
    by, sigmas = ", ".join(f"{x:+.2f}" for x in off), ", ".join(f"{x:.2f}" for x in sigma)
    if error.kind == DRIFT:
        axes = "along x_b, y_b, z_b"
        return f"The magnetometer's hard iron drifts by {by} uT/s {axes} (± {sigmas}); taken out."
    what = f"The magnetic field's declination is off what flight.toml states: {by} deg east"
    if error.kind == MAGNETOMETER:
        size = np.linalg.norm(off)
        what = f"The magnetometer's axes are turned in the body by {size:.1f} deg: {by} deg about "
        what += "x_b, y_b, z_b"
    end = "" if share > 1.0 - FALSE_ALARM else "; or another sensor is turned, and sigmas hold both"
    return f"{what} (± {sigmas} deg); taken back{end}."


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Declined(OfAnother):
    """Directions of a field whose declination is off by a constant.

    Attributes
    ----------
    measurement : Measurement
    column : int
        Of the constant d, rad.
    constants : Constants
    """

    column: int

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of some, (j,), see ``Measurement``."""
        R = exp(np.array([[0.0, 0.0, -at.constants[self.column]]]))[0]
        turned = at._replace(R_nb=np.ascontiguousarray(R @ at.R_nb))
        value, state, shared = self.measurement.linearise(turned, which)
        shared = shared.copy()
        shared[:, :, self.column] -= np.einsum("kij,kj->ki", state[:, :, ROTATION], at.R_nb[:, 2])
        return Linearised(value, state, shared)

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return measurement i as a factor of keyframe ``key``."""
        parts = parts_of(self.constants, (self.column,))
        return of_measurement(self, i, key, ("pose",), parts, rows=2)
