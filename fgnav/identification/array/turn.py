"""An array turned against the inertial unit: estimated with the flight, and said.

``R_n,array = R_n,unit Exp(c)``: specific force, and the gyroscope's rates, tell the unit's attitude
by motion, phases the array's. Both are stated in body axes, so either may be what is turned, and no
measurement of these two tells which. What else is fixed to the body may: the flight is identified
with the unit turned against all others, and with the array, and each counts by its likelihood.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.calibration_request import CalibrationRequest, turn_of
from fgnav.frontend.prepared import BodyAxes
from fgnav.geometry.rotations import exp, log
from fgnav.graph.turned import ARRAY_TURN, DIRECTIONS, UNIT_TURN, in_turned_axes
from fgnav.graph.types.constants import FlightConstant
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.tested_constants import TestedVector
from fgnav.types.flight import Flight


def tested_turn(problem: SmoothingProblem, turn: str) -> tuple[FlightConstant, ...]:
    """Return the turn to test, ``UNIT_TURN`` or ``ARRAY_TURN``; none without an array.

    Nor where places of antennas are estimated, or a turn has been found.
    """
    has_array = any(one.name == "array phases" for one in problem.measurements)
    names = [part.name for part in problem.constants.parts]
    is_open = any(name in (ARRAY_TURN, UNIT_TURN) or name.startswith("antenna ") for name in names)
    return (turn_of(turn),) if has_array and not is_open else ()


def with_turn(problem: SmoothingProblem, parts: tuple[FlightConstant, ...]) -> SmoothingProblem:
    """Return a whole problem in which a turn is free, if there is one."""
    free = problem.with_constants(parts)
    turned = (in_turned_axes(one, free.constants) for one in problem.measurements)
    return replace(free, measurements=tuple(turned)) if parts else problem


def request_of(turn: TestedVector, axes: BodyAxes) -> CalibrationRequest:
    """Return what to estimate once a turn is taken back: as little known as it is large."""
    angle_rad = float(np.linalg.norm(turn.off))
    name = UNIT_TURN if axes.of_array else ARRAY_TURN
    sigma_rad = float(np.sqrt(turn_of(name).covariance[0, 0]))
    x, y, z = turn.off.tolist()
    return CalibrationRequest(
        kind=name, antenna=None, sigma=max(sigma_rad, angle_rad), turned_rad=(x, y, z)
    )


def turned_back(flight: Flight, turn_rad: FloatArray, *, of_array: bool) -> Flight:
    """Return a flight whose unit stands in the array's axes, or whose antennas in the unit's.

    Parameters
    ----------
    flight : Flight
    turn_rad : ndarray, shape (3,)
        c, from the unit's axes to the array's.
    of_array : bool
        Whether the array's axes are the body's; else the unit's.
    """
    R_ua, imu = exp(turn_rad[None])[0], flight.imu
    if imu is None:
        return flight
    if of_array:
        w = imu.w_b_radps
        rates = None if w is None else w @ R_ua
        return replace(flight, imu=replace(imu, f_b_mps2=imu.f_b_mps2 @ R_ua, w_b_radps=rates))
    about = imu.position_b_m
    antennas = tuple(
        replace(one, position_b_m=about + R_ua @ (one.position_b_m - about))
        for one in flight.antennas
    )
    return replace(flight, antennas=antennas)


def after(before_rad: FloatArray, turn: TestedVector, *, of_array: bool) -> TestedVector:
    """Return a turn that was found once another had been taken back, both together."""
    first, second = exp(before_rad[None])[0], exp(turn.off[None])[0]
    turned = first @ second if of_array else second @ first
    return replace(turn, off=log(turned[None])[0])


def others_tell(problem: SmoothingProblem) -> bool:
    """Return whether anything else is fixed to the body's axes that sees directions."""
    return any(one.name in DIRECTIONS for one in problem.measurements)


def sentence(turn: TestedVector, axes: BodyAxes) -> str:
    """Return what is to be said of a turn."""
    sigma_deg = np.degrees(np.sqrt(np.diag(turn.covariance)))
    along = ", ".join(f"{x:+.2f}" for x in np.degrees(turn.off))
    sigmas = ", ".join(f"{x:.2f}" for x in sigma_deg)
    angle = np.degrees(np.linalg.norm(turn.off))
    which = "the antennas'" if axes.of_array else "the inertial unit's"
    other = "inertial unit" if axes.of_array else "antennas"
    if axes.is_even:
        end = f"nothing tells which of them: attitudes are of {which} axes, and sigmas hold both"
    else:
        end = f"other sensors say that it is the {other}: attitudes are of {which} axes"
    return (
        f"The array and the inertial unit are turned against each other by {angle:.1f} deg: "
        f"{along} deg about x_b, y_b, z_b (± {sigmas} deg), from the unit to the array; {end}."
    )
