"""An accelerometer and a gyroscope whose axes are turned against each other, or of other scales.

``x_a = Exp(c)' x_g`` of any vector x: samples of the accelerometer in its own axes a, and in those
of the gyroscope, g. Where no other sensor sees directions in the body nothing tells which of the
two is turned: attitudes are of the gyroscope's axes, and as likely of the accelerometer's.

``x = diag(1 + c) x_measured`` of either.

c is a constant of the whole problem, sought by steps, each about what the steps before have undone.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple, cast

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.calibration_request import turn_of
from fgnav.geometry.rotations import exp, log
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.turned import DIRECTIONS
from fgnav.graph.types.constants import FlightConstant, flight_constant
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
from fgnav.identification.spans.errors import ANY_SHARE, SAMPLES
from fgnav.identification.track.windows import EXCLUDED, FALSE_ALARM
from fgnav.types.flight import Imu

_AXES = ("x_b", "y_b", "z_b")
_STEPS = 4  # at most: each leaves a few hundredths of what is left
_STEP = {"turn": np.radians(1.0), "scale": 0.01}  # of difference quotients
_TELL = (*DIRECTIONS, "array phases")
SCALES = {sensor: f"scale of {sensor}" for sensor in WHITE}


class _Error(NamedTuple):
    """A turn or a scale of a sensor."""

    sensor: str
    shape: str

    @property
    def part(self) -> FlightConstant:
        """The constant, sought about none."""
        if self.shape == "turn":
            return turn_of(self.sensor)
        return flight_constant(SCALES[self.sensor], _AXES, "", ANY_SHARE, reported=False)

    def put_right(self, imu: Imu, c: FloatArray) -> Imu:
        """Return a unit with a sensor's samples without it."""
        name = SAMPLES[self.sensor]
        by = exp(c[None])[0].T if self.shape == "turn" else np.diag(1.0 + c)
        return replace(imu, **{name: getattr(imu, name) @ by})

    def further(self, c: FloatArray, step: FloatArray) -> FloatArray:
        """Return what undoes both, first c."""
        if self.shape == "turn":
            return log(exp(step[None]) @ exp(c[None]))[0]
        return (1.0 + step) * (1.0 + c) - 1.0

    @property
    def changes(self) -> tuple[Change, ...]:
        """What a step of each of its numbers does."""
        return tuple(partial(self.put_right, c=c) for c in _STEP[self.shape] * np.eye(3))


def unit_errors(problem: SmoothingProblem, stated: Solution) -> Iterator[LastingError]:
    """Yield turns and scales of the unit's sensors, as a problem tells them.

    Turns of each sensor that may be the turned one: of the accelerometer alone where nothing tells
    which it is, none without a gyroscope. None where a step from the stated promises none.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    """
    for one in _errors(problem):
        how = (one.part,), one.changes, np.full(3, _STEP[one.shape])
        nats, step = promised(problem, stated.states, *how)
        if nats > EXCLUDED - LIKELY:
            error = _sought(one, problem, stated.cost, step)
            if error is None and stated.cost / 4 < nats < np.inf:  # half of the cost: led too far
                error = _sought(one, problem, stated.cost, step / 2)
            if error is not None:
                yield error


def are_distinguished(problem: SmoothingProblem) -> bool:
    """Return whether anything else that is fixed to the body sees directions."""
    return any(one.name in _TELL for one in problem.measurements)


def put_right(imu: Imu, error: LastingError) -> Imu:
    """Return a unit with a sensor's samples in the axes of the other, or of another scale."""
    return _named(error.kind).put_right(imu, error.off)


def sentence(error: LastingError, share: float) -> str:
    """Return what is to be said of it; ``share``: probability that it is this sensor."""
    sensor, shape = _named(error.kind)
    sigma = np.sqrt(np.diag(error.covariance))
    if shape == "scale":
        by = ", ".join(f"{100 * x:+.2f}" for x in 1.0 / (1.0 + error.off) - 1.0)
        sigmas = ", ".join(f"{100 * x:.2f}" for x in sigma)
        axes = "along x_b, y_b, z_b"
        return f"The {sensor}'s scale factors are off by {by} % {axes} (± {sigmas} %); taken back."
    sigmas = ", ".join(f"{x:.2f}" for x in np.degrees(sigma))
    by = ", ".join(f"{x:+.2f}" for x in np.degrees(error.off))
    (other,) = (one for one in WHITE if one != sensor)
    end = f"other sensors say that it is the {sensor}"
    if share < 1.0 - FALSE_ALARM:
        axes = f"attitudes are of the {other}'s axes, and sigmas hold both"
        end = f"nothing tells which of them: {axes}"
    return (
        f"The {sensor}'s axes are turned against the {other}'s by "
        f"{np.degrees(np.linalg.norm(error.off)):.1f} deg: {by} deg about x_b, y_b, z_b "
        f"(± {sigmas} deg); taken back; {end}."
    )


def _errors(problem: SmoothingProblem) -> tuple[_Error, ...]:
    motion = problem.motion
    if isinstance(motion, GyroFree):
        return (_Error("accelerometer", "scale"),)
    if not isinstance(motion, Inertial):
        return ()
    turned = WHITE if are_distinguished(problem) else WHITE[:1]
    return (*(_Error(one, "turn") for one in turned), *(_Error(one, "scale") for one in WHITE))


def _named(kind: str) -> _Error:
    scaled = {name: sensor for sensor, name in SCALES.items()}
    return _Error(scaled[kind], "scale") if kind in scaled else _Error(kind, "turn")


def _sought(
    one: _Error, problem: SmoothingProblem, stated: float, begin: FloatArray
) -> LastingError | None:
    """Return an error, sought from where a step has led: of ten degrees none leads from zero."""
    off, error = begin, None
    for _ in range(_STEPS):
        part = replace(one.part, mean=-off)
        undone = replace(problem, motion=_put_right(problem.motion, one, off))
        how = (part,), one.changes, np.full(3, _STEP[one.shape])
        solution = solved_with_changes(undone, *how)
        if solution is None:
            return None
        step = solution.states.constants[-3:]
        off = one.further(off, step)
        error = LastingError.of(part, undone.with_constants((part,)), stated, solution)
        error = error._replace(off=off)
        if np.abs(step).max() < np.sqrt(error.covariance.diagonal().min()):
            return error
    return error


def _put_right(motion: Motion, one: _Error, c: FloatArray) -> Motion:
    """Return a motion of samples put right; of all of it a chain reads no more."""
    inertial = cast("Inertial | GyroFree", motion)
    return cast("Motion", replace(inertial, imu=one.put_right(inertial.imu, c)))
