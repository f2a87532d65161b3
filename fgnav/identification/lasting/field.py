"""A magnetometer that is turned in the body, or a field of another declination than is stated.

Both are constants of its measurements, of the direction of m_n in the magnetometer's axes:

    turned: Exp(c)' R_nb' m_n        declination: R_nb' Exp(d e_down) m_n
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import IntArray, NoSolutionError
from fgnav.frontend.calibration_request import turn_of
from fgnav.geometry.rotations import exp
from fgnav.graph.measurement_factor import of_measurement, parts_of
from fgnav.graph.turned import Turned
from fgnav.graph.types.constants import Constants, flight_constant
from fgnav.graph.types.measurement import Linearised, Measurement, OfAnother
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import ROTATION, States
from fgnav.identification.lasting.error import LastingError
from fgnav.identification.track.windows import FALSE_ALARM
from fgnav.optional_gtsam import gtsam
from fgnav.solve.chain import solve_batch
from fgnav.types.flight import Flight

MAGNETOMETER, DECLINATION = "magnetometer", "declination"
_FIELD = "magnetic field"
# 1-sigma of a field that is stated without its declination, rad: that of the Earth's field is 16
# degrees RMS between 60 degrees south and north (IGRF-13 of 2020, to degree 4, by area).
_DECLINATION_RAD = np.radians(16.0)


def field_errors(problem: SmoothingProblem, stated: float) -> Iterator[LastingError]:
    """Yield both, as a problem tells them; parameters as of ``sight.sight_errors``."""
    if not any(one.name == _FIELD for one in problem.measurements):
        return
    turn = turn_of(MAGNETOMETER)
    for part in (turn, flight_constant(DECLINATION, ("east",), "rad", _DECLINATION_RAD)):
        free, kind = problem.with_constants((part,)), Turned if part is turn else Declined
        wrapped = tuple(
            kind(measurement=one, column=problem.constants.width, constants=free.constants)
            if one.name == _FIELD
            else one
            for one in problem.measurements
        )
        free = replace(free, measurements=wrapped)
        with suppress(NoSolutionError):
            solution = solve_batch(free)
            if solution.converged:
                yield LastingError.of(part, free, stated, solution)


def put_right(flight: Flight, error: LastingError) -> Flight:
    """Return a flight with samples in the body's axes, or a field of that declination."""
    field = flight.magnetometer
    if field is None:
        return flight
    if error.kind == MAGNETOMETER:
        R = exp(error.off[None])[0]
        return replace(flight, magnetometer=replace(field, field_b_ut=field.field_b_ut @ R.T))
    m_n_ut = exp(np.array([[0.0, 0.0, error.off[0]]]))[0] @ field.field_n_ut
    return replace(flight, magnetometer=replace(field, field_n_ut=m_n_ut))


def sentence(error: LastingError, share: float) -> str:
    """Return what is to be said of it; ``share``: probability that no sensor is turned instead."""
    off, sigma = np.degrees(error.off), np.degrees(np.sqrt(np.diag(error.covariance)))
    by, sigmas = ", ".join(f"{x:+.2f}" for x in off), ", ".join(f"{x:.2f}" for x in sigma)
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

    measurement: Measurement
    column: int
    constants: Constants

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

    def on(self, row: IntArray) -> "Declined":
        """Return the same measurements at other rows, (k,)."""
        return replace(self, measurement=self.measurement.on(row))
