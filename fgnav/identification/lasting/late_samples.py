"""Specific forces or rates that are late: a low pass of the accelerometer, or of the gyroscope.

It delays one sensor alone, which no clock of the whole unit and no delay of velocities stands for:
forces point where the body pointed before, or the body turned before it is said to. Of samples x
that follow ``x_k = x_k-1 + (u_k - x_k-1) / (1 + d / T)``, T apart, u is ``x_k + d (x_k - x_k-1) /
T``: to first order the samples a time d later, whatever delays them. In d the rows of the motion
are linear.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.constants import flight_constant
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.identification.lasting.error import LastingError, least_of_use
from fgnav.identification.likelihood.changed_samples import (
    ChangedBy,
    Promise,
    solved_with_changes,
)
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.spans.errors import SAMPLES
from fgnav.identification.track.windows import EXCLUDED
from fgnav.types.flight import Flight, Imu

KINDS = {f"late {sensor}": sensor for sensor in WHITE}
_SENSED = {"accelerometer": "forces", "gyroscope": "rates"}
# 1-sigma, s: low passes of small units delay by up to 19 ms (InvenSense MPU-6000, register map 4.2,
# DLPF_CFG).
_DELAY_S = 0.02
_STEP_S = 0.01  # of a difference quotient


def tested(problem: SmoothingProblem) -> dict[str, ChangedBy]:
    """Return how samples of each sensor change by its delay, by kind."""
    motion = problem.motion
    if not isinstance(motion, GyroFree | Inertial):
        return {}
    sensors = WHITE[:1] if isinstance(motion, GyroFree) else WHITE
    return {kind: _how(kind, _DELAY_S) for kind, sensor in KINDS.items() if sensor in sensors}


def late_samples(
    problem: SmoothingProblem, stated: Solution, promises: Mapping[str, Promise]
) -> Iterator[LastingError]:
    """Yield by how much a sensor is late as a problem tells it, if a step from the stated says so.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    promises : mapping of str to Promise
        Of these steps.
    """
    for kind in tested(problem):
        if promises[kind].nats < EXCLUDED - LIKELY:
            continue
        error = _late(problem, stated, kind, _DELAY_S, 2)
        if error is not None and error.off[0] > _DELAY_S:  # as little is known as it is large
            error = _late(problem, stated, kind, float(error.off[0]), 1)
        if error is not None and error.off[0] > 0.0:  # no filter foresees
            yield error


def put_right(flight: Flight, error: LastingError) -> Flight:
    """Return a flight whose unit's late sensor is in time."""
    if flight.imu is None:
        return flight
    early = _taken_early(flight.imu, KINDS[error.kind], float(error.off[0]))
    return replace(flight, imu=early)


def sentence(error: LastingError) -> str:
    """Return what is to be said of it."""
    sensor = KINDS[error.kind]
    return (
        f"The {sensor}'s {_SENSED[sensor]} are late, as behind a low pass: by "
        f"{error.off[0]:.4f} ± {np.sqrt(error.covariance[0, 0]):.4f} s; they are taken as early as "
        "that."
    )


def _taken_early(imu: Imu, sensor: str, by_s: float) -> Imu:
    """Return a unit with samples of a sensor ahead of a first-order low pass of so much delay."""
    name = SAMPLES[sensor]
    x = getattr(imu, name)
    slope = np.diff(x, axis=0, prepend=x[:1]) / np.median(np.diff(imu.t_s))
    return replace(imu, **{name: x + by_s * slope})


def _late(
    problem: SmoothingProblem, stated: Solution, kind: str, sigma_s: float, left: int
) -> LastingError | None:
    how = _how(kind, sigma_s)
    solution = solved_with_changes(problem, how, least_of_use(problem, stated.cost, left))
    if solution is None:
        return None
    (part,) = how.parts
    return LastingError.of(part, problem.with_constants((part,)), stated.cost, solution)


def _how(kind: str, sigma_s: float) -> ChangedBy:
    part = flight_constant(kind, ("delay",), "s", sigma_s, reported=False)
    early = partial(_taken_early, sensor=KINDS[kind], by_s=_STEP_S)
    return ChangedBy((part,), (early,), np.array([_STEP_S]))
