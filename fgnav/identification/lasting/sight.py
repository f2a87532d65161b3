"""A landmark that is not where its flight has it, or a detector that is turned in the body.

All lines of sight err alike then, and attitudes of an array follow them. What disagrees is the
specific force, which noise explains as well.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fgnav.frontend.calibration_request import CalibrationRequest, calibration_requests, of_vehicle
from fgnav.graph.factors.line_of_sight import LineOfSight
from fgnav.graph.types.constants import Constants, FlightConstant
from fgnav.graph.types.measurement import Measurement
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.identification.lasting.error import LastingError, least_of_use
from fgnav.identification.lasting.quadrants import quadrant_error
from fgnav.identification.likelihood.changed_samples import minimum_below
from fgnav.identification.likelihood.thinned import Some
from fgnav.types.flight import Seeker

KINDS = LANDMARK, BORESIGHT = "landmark", "boresight"
# 1-sigma of each axis of a place read off a map that nobody checked, m: horizontal errors of
# satellite images are 39.7 m RMS (Potere, Sensors 8, 2008, of 436 points of Google Earth).
_READ_OFF_M = 40.0


def sight_errors(
    problem: SmoothingProblem, stated: Solution, seeker: Seeker | None
) -> Iterator[LastingError]:
    """Yield both, and the balance of quadrants, as a problem tells them.

    None where landmark or boresight is estimated.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    seeker : Seeker or None
    """
    kinds = {part.name: part for part in problem.constants.parts}
    if BORESIGHT in kinds or LANDMARK not in kinds or kinds[LANDMARK].reported:
        return
    for kind in (LANDMARK, BORESIGHT):
        part = of_vehicle(_request(kind))
        free = _free(part, problem)
        solution = minimum_below(free, least_of_use(problem, stated.cost))
        if solution is not None:
            yield LastingError.of(part, free, stated.cost, solution)
    unbalanced = None if seeker is None else quadrant_error(problem, stated, seeker)
    if unbalanced is not None:
        yield unbalanced


def request_of(error: LastingError) -> CalibrationRequest:
    """Return what to estimate: as little known as it is large, and begun where it is.

    A window that learns it by itself marginalises factors linearised far from it.
    """
    request, size = _request(error.kind), float(np.linalg.norm(error.off))
    return replace(request, sigma=max(request.sigma, size), off=tuple(error.off.tolist()))


def sentence(error: LastingError) -> str:
    """Return what is to be said of it."""
    off, sigma = error.off, np.sqrt(np.diag(error.covariance))
    what, axes = "The landmark is off where flight.toml has it", "m to north, east and down"
    if error.kind == BORESIGHT:
        off, sigma = np.degrees(off), np.degrees(sigma)
        what, axes = "The detector is turned against the body", "deg about y_b and z_b"
    by, sigmas = ", ".join(f"{x:+.2f}" for x in off), ", ".join(f"{x:.2f}" for x in sigma)
    return f"{what}: {by} {axes} (± {sigmas}); estimated with the flight."


def _request(kind: str) -> CalibrationRequest:
    (request,) = calibration_requests([kind])
    return replace(request, sigma=_READ_OFF_M) if kind == LANDMARK else request


def _free(part: FlightConstant, problem: SmoothingProblem) -> SmoothingProblem:
    """Return a problem in which landmark or boresight is known as well as a part, ± the stated."""
    if part.name == LANDMARK:
        parts = problem.constants.parts
        wide = (replace(o, covariance=part.covariance) if o.name == LANDMARK else o for o in parts)
        return replace(problem, constants=Constants(tuple(wide)))
    extended, column = problem.with_constants((part,)), problem.constants.width
    measurements = tuple(_with_boresight(one, column, extended) for one in problem.measurements)
    return replace(extended, measurements=measurements)


def _with_boresight(one: Measurement, column: int, problem: SmoothingProblem) -> Measurement:
    if isinstance(one, Some):
        return replace(one, measurement=_with_boresight(one.measurement, column, problem))
    if isinstance(one, LineOfSight):
        return replace(one, boresight_column=column, constants=problem.constants)
    return one
