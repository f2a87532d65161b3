"""An accelerometer and a gyroscope whose axes are turned against each other.

``x_a = Exp(c)' x_g`` of any vector x: samples of the accelerometer in its own axes a, and in those
of the gyroscope, g. c is a constant of the whole problem, sought by steps, each about the turn that
the steps before have undone. Where no other sensor sees directions in the body nothing tells which
of the two is turned: attitudes are of the gyroscope's axes, and as likely of the accelerometer's.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import cast

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.calibration_request import turn_of
from fgnav.geometry.rotations import exp, log
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.turned import DIRECTIONS
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.identification.lasting.error import LastingError
from fgnav.identification.likelihood.changed_samples import (
    Change,
    promised,
    solved_with_changes,
)
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.spans.errors import SAMPLES
from fgnav.identification.track.windows import EXCLUDED, FALSE_ALARM
from fgnav.types.flight import Imu

_STEPS = 4  # at most: each leaves a few hundredths of what is left
_STEP_RAD = np.radians(1.0)  # of difference quotients
_TELL = (*DIRECTIONS, "array phases")


def unit_turns(problem: SmoothingProblem, stated: Solution) -> Iterator[LastingError]:
    """Yield the turn of each sensor that may be the turned one, as a problem tells it.

    That of the accelerometer alone where nothing tells which it is; none without a gyroscope, nor
    where a step from the stated promises none.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    """
    if not isinstance(problem.motion, Inertial):
        return
    for sensor in WHITE if are_distinguished(problem) else WHITE[:1]:
        how = (turn_of(sensor),), _changes(sensor), np.full(3, _STEP_RAD)
        nats, step_rad = promised(problem, stated.states, *how)
        if nats > EXCLUDED - LIKELY:
            error = _turn(problem, stated.cost, sensor, step_rad)
            if error is None and stated.cost / 4 < nats < np.inf:  # half of the cost: led too far
                error = _turn(problem, stated.cost, sensor, step_rad / 2)
            if error is not None:
                yield error


def are_distinguished(problem: SmoothingProblem) -> bool:
    """Return whether anything else that is fixed to the body sees directions."""
    return any(one.name in _TELL for one in problem.measurements)


def turned_back(imu: Imu, error: LastingError) -> Imu:
    """Return a unit with a sensor's samples in the axes of the other."""
    return _turning(error.kind, error.off)(imu)


def sentence(error: LastingError, share: float) -> str:
    """Return what is to be said of it; ``share``: probability that it is this sensor."""
    sigmas = ", ".join(f"{x:.2f}" for x in np.degrees(np.sqrt(np.diag(error.covariance))))
    by = ", ".join(f"{x:+.2f}" for x in np.degrees(error.off))
    (other,) = (one for one in WHITE if one != error.kind)
    end = f"other sensors say that it is the {error.kind}"
    if share < 1.0 - FALSE_ALARM:
        axes = f"attitudes are of the {other}'s axes, and sigmas hold both"
        end = f"nothing tells which of them: {axes}"
    return (
        f"The {error.kind}'s axes are turned against the {other}'s by "
        f"{np.degrees(np.linalg.norm(error.off)):.1f} deg: {by} deg about x_b, y_b, z_b "
        f"(± {sigmas} deg); taken back; {end}."
    )


def _turn(
    problem: SmoothingProblem, stated: float, sensor: str, begin_rad: FloatArray
) -> LastingError | None:
    """Return a turn, sought from where a step has led: of ten degrees none leads from zero."""
    off_rad, error = begin_rad, None
    for _ in range(_STEPS):
        part = replace(turn_of(sensor), mean=-off_rad)
        undone = replace(problem, motion=_turned_back(problem.motion, sensor, off_rad))
        solution = solved_with_changes(undone, (part,), _changes(sensor), np.full(3, _STEP_RAD))
        if solution is None:
            return None
        step_rad = solution.states.constants[-3:]
        off_rad = log(exp(step_rad[None]) @ exp(off_rad[None]))[0]
        error = LastingError.of(part, undone.with_constants((part,)), stated, solution)
        error = error._replace(off=off_rad)
        if np.abs(step_rad).max() < np.sqrt(error.covariance.diagonal().min()):
            return error
    return error


def _changes(sensor: str) -> tuple[Change, ...]:
    return tuple(_turning(sensor, by_rad) for by_rad in _STEP_RAD * np.eye(3))


def _turning(sensor: str, by_rad: FloatArray) -> Change:
    """Return what turns a sensor's samples, x' = Exp(c) x."""
    R, name = exp(by_rad[None])[0], SAMPLES[sensor]
    return lambda imu: replace(imu, **{name: getattr(imu, name) @ R.T})


def _turned_back(motion: Motion, sensor: str, by_rad: FloatArray) -> Motion:
    """Return a motion of samples so turned; of all of it a chain reads no more."""
    inertial = cast("Inertial", motion)
    return cast("Motion", replace(inertial, imu=_turning(sensor, by_rad)(inertial.imu)))
