"""The way from the inertial unit to the antenna, as phases of arcs tell it: to centimetres.

The thinned chain has no arcs and tells it by Doppler alone; what that leaves looks like a clock, or
like noise of the unit.
"""

from collections.abc import Callable

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.frontend.calibration_request import CalibrationRequest, calibration_requests, of_vehicle
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.identification.lasting.error import LastingError
from fgnav.identification.lasting.sight import request_of
from fgnav.solve.chain import solve_batch

LEVER_ARM = "lever-arm"


def arm_errors(
    problem: SmoothingProblem,
    stated: Solution,
    estimating: Callable[[CalibrationRequest], SmoothingProblem],
) -> tuple[LastingError, ...]:
    """Return what it is off; nothing without phases, where it is estimated, or without a minimum.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum, where the search begins.
    estimating : callable
        From what is to be estimated to the problem with it.
    """
    if problem.phase is None or problem.constants.column(LEVER_ARM) >= 0:
        return ()
    (request,) = calibration_requests([LEVER_ARM])
    error = _error(request, problem, stated, estimating)
    if error is not None and np.linalg.norm(error.off) > request.sigma:
        error = _error(request_of(error), problem, stated, estimating)
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
    request: CalibrationRequest,
    problem: SmoothingProblem,
    stated: Solution,
    estimating: Callable[[CalibrationRequest], SmoothingProblem],
) -> LastingError | None:
    try:
        free = estimating(request)
        solution = solve_batch(free, begin=_at_minimum(problem.constants, stated.states, free))
    except NoSolutionError:
        return None
    if not solution.converged:
        return None
    return LastingError.of(of_vehicle(request), free, stated.cost, solution)


def _at_minimum(constants: Constants, states: States, free: SmoothingProblem) -> States:
    """Return states of a problem's minimum for one with more constants."""
    values = free.start.constants.copy()
    for part in constants.parts:
        values[free.constants.columns(part.name)] = states.constants[constants.columns(part.name)]
    return states._replace(constants=values)
