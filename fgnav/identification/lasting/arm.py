"""The way from the inertial unit to the antenna, by phases of arcs to centimetres, or by fixes.

The thinned chain has no arcs and tells it by Doppler alone, or beside a clock and a delay of
velocities; what that leaves looks like a clock, or like noise of the unit.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.calibration_request import calibration_requests, of_vehicle
from fgnav.graph.delayed import Delayed
from fgnav.graph.factors.position import Position
from fgnav.graph.factors.velocity import Velocity
from fgnav.graph.types.constants import Constants, FlightConstant
from fgnav.graph.types.measurement import Measurement
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.identification.lasting.error import LastingError, least_of_use
from fgnav.identification.lasting.sight import request_of
from fgnav.identification.likelihood.changed_samples import Promise, minimum_below
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.likelihood.thinned import Some
from fgnav.identification.track.windows import EXCLUDED

LEVER_ARM = "lever-arm"


def tested(problem: SmoothingProblem) -> tuple[str, SmoothingProblem] | None:
    """Return what it is called, and the problem with it; None where it is estimated."""
    if problem.constants.column(LEVER_ARM) >= 0:
        return None
    (request,) = calibration_requests([LEVER_ARM])
    return LEVER_ARM, _with_arm(problem, of_vehicle(request))


def arm_errors(
    problem: SmoothingProblem, stated: Solution, promises: Mapping[str, Promise]
) -> tuple[LastingError, ...]:
    """Return what it is off, if a step from the stated says so.

    Nothing where it is estimated, or without a minimum.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum, where the search begins.
    promises : mapping of str to Promise
        Of this step.
    """
    if LEVER_ARM not in promises or promises[LEVER_ARM].nats < EXCLUDED - LIKELY:
        return ()
    (request,) = calibration_requests([LEVER_ARM])
    error = _error(of_vehicle(request), problem, stated, 2)
    if error is not None and np.linalg.norm(error.off) > request.sigma:
        error = _error(of_vehicle(request_of(error)), problem, stated, 1) or error
    return () if error is None else (error,)


def sentence(off_m: FloatArray, covariance_m2: FloatArray) -> str:
    """Return what is to be said of it, (3,), and its covariance, (3, 3)."""
    off = ", ".join(f"{x:+.3f}" for x in off_m)
    sigma_m = ", ".join(f"{x:.3f}" for x in np.sqrt(np.diag(covariance_m2)))
    return (
        f"The antenna is off where flight.toml has it beside the inertial unit: {off} m along "
        f"x_b, y_b, z_b (± {sigma_m} m); estimated with the flight."
    )


def _error(
    part: FlightConstant, problem: SmoothingProblem, stated: Solution, left: int
) -> LastingError | None:
    free, at = _with_arm(problem, part), stated.states
    begin = at._replace(constants=np.append(at.constants, part.start))
    solution = minimum_below(free, least_of_use(problem, stated.cost, left), begin)
    return None if solution is None else LastingError.of(part, free, stated.cost, solution)


def _with_arm(problem: SmoothingProblem, part: FlightConstant) -> SmoothingProblem:
    """Return a problem whose antennas are off by one more constant."""
    column, free = problem.constants.width, problem.with_constants((part,))
    measurements = tuple(_on_arm(one, column, free.constants) for one in problem.measurements)
    phase = problem.phase
    if phase is not None:
        phase = replace(phase, lever_column=column, constants=free.constants)
    return replace(free, measurements=measurements, phase=phase)


def _on_arm(one: Measurement, column: int, constants: Constants) -> Measurement:
    if isinstance(one, Some | Delayed):
        return replace(one, measurement=_on_arm(one.measurement, column, constants))
    if isinstance(one, Position | Velocity):
        return replace(one, lever_column=column, constants=constants)
    return one
