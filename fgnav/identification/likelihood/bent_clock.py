"""Clocks to which states bend, where accelerometers are loud: what determinants say of them."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.frontend.calibration_request import CalibrationRequest
from fgnav.frontend.prepared import PreparedFlight
from fgnav.graph.types.constants import Constants, FlightConstant
from fgnav.identification.likelihood.clock_determinant import NAMES, ClockDeterminant
from fgnav.identification.likelihood.linear_chain import Covariances
from fgnav.solve.chain import solve_batch

_FIXED = 1e-9  # 1-sigma, s and ppm: next to no time


def informed(
    constants: Iterable[FlightConstant], determinant: ClockDeterminant | None
) -> tuple[FlightConstant, ...]:
    """Return constants, those of a clock with what a determinant says."""
    if determinant is None:
        return tuple(constants)
    added = dict(zip(NAMES, np.transpose(determinant).tolist(), strict=True))
    return tuple(one.informed(*added[one.name]) if one.name in added else one for one in constants)


def informed_requests(
    requests: tuple[CalibrationRequest, ...], determinant: ClockDeterminant
) -> tuple[CalibrationRequest, ...]:
    """Return requests, that of a clock with what a determinant says."""
    added, excess = (tuple(one.tolist()) for one in determinant)
    return tuple(
        replace(one, added=added, excess=excess) if one.kind == "clock" else one for one in requests
    )


def determinant_of(prepared: PreparedFlight) -> ClockDeterminant | None:
    """Return what the determinant of a whole problem says of its clock; None without a minimum."""
    problem = prepared.problem
    fixed = Constants(tuple(_with_clock_fixed(one) for one in problem.constants.parts))
    try:
        solution = solve_batch(replace(problem, constants=fixed))
    except NoSolutionError:
        return None
    if solution.cross is None:
        return None
    covariances = Covariances(
        solution.covariance,
        solution.cross,
        solution.constant_cross,
        solution.constant_covariance[-1],
    )
    ones = tuple(np.ones(len(one.row)) for one in problem.measurements)
    since_s = prepared.timed.since_s
    return ClockDeterminant.of(problem, solution.states, covariances, since_s, ones)


def _with_clock_fixed(constant: FlightConstant) -> FlightConstant:
    """Return a constant, that of a clock at zero: tags are as they are."""
    if constant.name not in NAMES:
        return constant
    return replace(constant, mean=np.zeros(1), covariance=np.array([[_FIXED**2]]))
