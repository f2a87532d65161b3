"""An accelerometer and a gyroscope turned against each other, or of other scales or biases.

``x_a = Exp(c)' x_g`` of any vector x: samples of the accelerometer in its own axes a, and in those
of the gyroscope, g. Where no other sensor sees directions in the body nothing tells which of the
two is turned: attitudes are of the gyroscope's axes, and as likely of the accelerometer's.

``x = diag(1 + c) x_measured`` of either, or ``x = x_measured - c``: a bias far beyond its stated
size.

c is a constant of the whole problem, sought by steps, each about what the steps before have undone.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import product
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
from fgnav.graph.types.states import States
from fgnav.identification.lasting.error import LastingError, least_of_use
from fgnav.identification.likelihood.changed_samples import (
    Change,
    ChangedBy,
    Promise,
    solved_with_changes,
)
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.spans.beside_phases import is_throughout
from fgnav.identification.spans.errors import ANY_BIAS, ANY_SHARE, SAMPLES
from fgnav.identification.track.windows import EXCLUDED, FALSE_ALARM
from fgnav.types.flight import Flight, Imu

_AXES = ("x_b", "y_b", "z_b")
_STEPS = 4  # at most: each leaves a few hundredths of what is left
_STEP = {"turn": np.radians(1.0), "scale": 0.01, "bias": 1e-3}  # of difference quotients
_UNIT = {"accelerometer": "m/s2", "gyroscope": "rad/s"}
_TELL = (*DIRECTIONS, "array phases")


class _Error(NamedTuple):
    """A turn of a sensor, its scale factors or its bias."""

    sensor: str
    shape: str

    @property
    def kind(self) -> str:
        """What it is called."""
        return self.sensor if self.shape == "turn" else f"{self.shape} of {self.sensor}"

    @property
    def part(self) -> FlightConstant:
        """The constant, sought about none."""
        if self.shape == "turn":
            return turn_of(self.sensor)
        sigma, unit = ANY_SHARE, ""
        if self.shape == "bias":
            sigma, unit = ANY_BIAS[self.sensor], _UNIT[self.sensor]
        return flight_constant(self.kind, _AXES, unit, sigma, reported=False)

    def put_right(self, imu: Imu, c: FloatArray) -> Imu:
        """Return a unit with a sensor's samples without it."""
        name = SAMPLES[self.sensor]
        x = getattr(imu, name)
        if self.shape == "turn":
            return replace(imu, **{name: x @ exp(c[None])[0].T})
        return replace(imu, **{name: x - c if self.shape == "bias" else x * (1.0 + c)})

    def further(self, c: FloatArray, step: FloatArray) -> FloatArray:
        """Return what undoes both, first c."""
        if self.shape == "turn":
            return np.asarray(log(exp(step[None]) @ exp(c[None]))[0])
        return c + step if self.shape == "bias" else (1.0 + step) * (1.0 + c) - 1.0

    def is_possible(self, c: FloatArray) -> bool:
        """Return whether samples may be off so: an axis that is reversed is no scale.

        Two of them are a turn by 180 degrees, which may as well be an array's.
        """
        return self.shape != "scale" or bool((c > -1.0).all())

    @property
    def steps(self) -> FloatArray:
        """Of difference quotients of its numbers, (3,)."""
        return np.full(3, _STEP[self.shape])

    @property
    def changes(self) -> tuple[Change, ...]:
        """What a step of each of its numbers does."""
        return tuple(partial(self.put_right, c=c) for c in np.diag(self.steps))

    @property
    def how(self) -> ChangedBy:
        """How samples change by it."""
        return ChangedBy((self.part,), self.changes, self.steps)


_OF_UNIT = {one.kind: one for one in (_Error(*of) for of in product(WHITE, _STEP))}
KINDS = tuple(_OF_UNIT)


def tested(problem: SmoothingProblem) -> dict[str, ChangedBy]:
    """Return how samples change by each that is tested, by kind.

    Turns of each sensor that may be the turned one: of the accelerometer alone where nothing tells
    which it is, none without a gyroscope.
    """
    return {one.kind: one.how for one in _errors(problem)}


def unit_errors(
    problem: SmoothingProblem, stated: Solution, promises: Mapping[str, Promise]
) -> Iterator[LastingError]:
    """Yield turns, scale factors and biases of the unit's sensors, as a problem tells them.

    None where a step from the stated promises none.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    promises : mapping of str to Promise
        Of these steps.
    """
    for one in _errors(problem):
        nats, step = promises[one.kind]
        if nats > EXCLUDED - LIKELY:
            error = _sought(one, problem, stated.cost, step)
            if error is None and stated.cost / 4 < nats < np.inf:  # half of the cost: led too far
                error = _sought(one, problem, stated.cost, step / 2)
            if error is not None and one.is_possible(error.off):
                yield error


def are_distinguished(problem: SmoothingProblem) -> bool:
    """Return whether anything else that is fixed to the body sees directions."""
    return any(one.name in _TELL for one in problem.measurements)


def is_of_span(error: LastingError, problem: SmoothingProblem, stated: Solution) -> bool:
    """Return whether scale factors or a bias are likelier off for a while than all along."""
    one = _OF_UNIT.get(error.kind)
    if one is None or one.shape == "turn":
        return False
    shape = "offset" if one.shape == "bias" else one.shape
    return not is_throughout(problem, stated.states, (one.sensor, shape))


def put_right(flight: Flight, error: LastingError) -> Flight:
    """Return a flight without an error of its unit: a sensor's turn, scale factors or bias."""
    if flight.imu is None:
        return flight
    return replace(flight, imu=_OF_UNIT[error.kind].put_right(flight.imu, error.off))


def sentence(error: LastingError, share: float) -> str:
    """Return what is to be said of it; ``share``: probability that it is this sensor."""
    sensor, shape = _OF_UNIT[error.kind]
    sigma = np.sqrt(np.diag(error.covariance))
    if shape != "turn":
        times, unit = (1.0, _UNIT[sensor]) if shape == "bias" else (100.0, "%")
        off = error.off if shape == "bias" else 1.0 / (1.0 + error.off) - 1.0
        by = ", ".join(f"{times * x:+.3g}" for x in off)
        sigmas = ", ".join(f"{times * x:.2g}" for x in sigma)
        what = "bias is larger than stated:" if shape == "bias" else "scale factors are off by"
        return f"The {sensor}'s {what} {by} {unit} along x_b, y_b, z_b (± {sigmas}); taken out."
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
        return tuple(_Error("accelerometer", shape) for shape in ("scale", "bias"))
    if not isinstance(motion, Inertial):
        return ()
    turned = WHITE if are_distinguished(problem) else WHITE[:1]
    return (
        *(_Error(one, "turn") for one in turned),
        *(_Error(*of) for of in product(WHITE, ("scale", "bias"))),
    )


def _sought(
    one: _Error, problem: SmoothingProblem, stated: float, begin: FloatArray
) -> LastingError | None:
    """Return an error, sought from where a step has led: of ten degrees none leads from zero."""
    off, error, cost = begin, None, stated
    states: States | None = None  # those of the step before
    for _ in range(_STEPS):
        part = replace(one.part, mean=-off)
        undone = replace(problem, motion=_put_right(problem.motion, one, off))
        by = ChangedBy((part,), one.changes, one.steps)
        enough = least_of_use(problem, cost, 2 if error is None else 1)
        solution = solved_with_changes(undone, by, enough, states)
        if solution is None:
            return None
        step, cost = solution.states.constants[-3:], solution.cost
        rest = np.append(solution.states.constants[:-3], np.zeros(3))
        states = solution.states._replace(constants=rest)
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
