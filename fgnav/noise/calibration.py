"""Clock, velocity latency and lever arm: what the most probable noise of a flight shows of them.

They are constants of the problem on which noise is identified. One that is beyond its sigma is
estimated with the flight. A report gives the log-likelihood that each gains alone beside that of
the others, so that a reader sees the runner-up.
"""

from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from fgnav.assembly.calibration_request import calibration_requests
from fgnav.checks import FloatArray
from fgnav.graph.delayed import CLOCK_OFFSET, CLOCK_RATE, VELOCITY_DELAY, TimedMotion, on_clock
from fgnav.graph.factors.position import LEVER_ARM
from fgnav.graph.factors.velocity import Velocity
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.sensor import Sensor
from fgnav.graph.types.solution import Solution
from fgnav.messages import Note, note
from fgnav.noise.decimation import Subset

_FALSE_ALARM = 6e-5  # of a constant that is zero: 4 sigma
CLOCK, LATENCY = "clock", "velocity-delay"
_COLUMNS = {CLOCK: (CLOCK_OFFSET, CLOCK_RATE), LATENCY: (VELOCITY_DELAY,), LEVER_ARM: (LEVER_ARM,)}


class Calibrated(NamedTuple):
    """One constant of set-up."""

    kind: str  # {"clock", "velocity-delay", "lever-arm"}
    value: FloatArray  # (d,)
    sigma: FloatArray  # (d,)
    alone: float  # log-likelihood that it gains alone, the others zero
    is_significant: bool
    prior_sigma: float  # 1-sigma before the flight, of the first of its axes


def with_latency_and_lever_arm(
    problem: Problem, timed: TimedMotion, kinds: tuple[str, ...]
) -> Problem:
    """Return a decimated problem with constants that its measurements of fixes depend on.

    Parameters
    ----------
    problem : Problem
        Decimated.
    timed : TimedMotion
        At its keyframes.
    kinds : tuple of str
        Of ``"velocity-delay"`` and ``"lever-arm"``.
    """
    parts = [request.parameters() for request in calibration_requests(kinds)]
    extended = problem.with_constants(tuple(chain.from_iterable(parts)))
    sensors: list[Sensor] = []
    for sensor in extended.sensors:
        if sensor.name == Velocity.name and LATENCY in kinds and isinstance(sensor, Subset):
            led = timed.led[sensor.row]
            delayed = replace(sensor, indices=sensor.indices[led], keyframes=sensor.row[led])
            sensors.append(on_clock(delayed, timed, delay=VELOCITY_DELAY, clock=False))
        else:
            sensors.append(sensor)
    return replace(extended, sensors=tuple(sensors))


def calibrated(constants: Parameters, solution: Solution) -> tuple[Calibrated, ...]:
    """Return clock, latency and lever arm by a solution, those of its constants."""
    every_column, columns = np.arange(constants.width), dict[str, list[int]]()
    for kind, names in _COLUMNS.items():
        of_kind = [every_column[constants.columns(name)] for name in names]
        if of := np.concatenate(of_kind).tolist():
            columns[kind] = of
    every = [i for of in columns.values() for i in of]
    x, P = solution.states.constants, solution.constant_covariance[-1]

    def is_beyond(of: list[int]) -> bool:
        return _squares(x, P, of) > float(chdtri(len(of), _FALSE_ALARM))

    significant = {kind for kind, of in columns.items() if is_beyond(of)}
    # Clock and latency may be significant together where neither is alone.
    times = [kind for kind in (CLOCK, LATENCY) if kind in columns]
    of_times = [i for kind in times for i in columns[kind]]
    if len(times) == 2 and not significant.intersection(times) and is_beyond(of_times):
        significant.update(times)
    total = _squares(x, P, every)
    return tuple(
        Calibrated(
            kind=kind,
            value=x[of],
            sigma=np.sqrt(np.diag(P)[of]),
            alone=(total - _squares(x, P, [i for i in every if i not in of])) / 2,
            is_significant=kind in significant,
            prior_sigma=float(np.sqrt(constants.covariance[of[0], of[0]])),
        )
        for kind, of in columns.items()
    )


def calibration_notes(calibrated: tuple[Calibrated, ...]) -> tuple[Note, ...]:
    """Return a message on each constant that is estimated because it is significant."""
    notes = []
    for estimated in (parameter for parameter in calibrated if parameter.is_significant):
        others = (other for other in calibrated if other is not estimated)
        runner_up, comparison = max(others, key=lambda other: other.alone, default=None), ""
        if runner_up is not None:
            comparison = f"; runner-up: {_NAMES[runner_up.kind]}, {runner_up.alone:.0f}"
        name = _NAMES[estimated.kind]
        parameter = f"{name[:1].upper()}{name[1:]}"
        of = {"value": _value(estimated), "gain": estimated.alone, "runner_up": comparison}
        notes.append(note("I303", parameter=parameter, **of))
    return tuple(notes)


_NAMES = {CLOCK: "IMU clock", LATENCY: "velocity latency", LEVER_ARM: "lever-arm error"}


def _value(calibrated: Calibrated) -> str:
    values, sigmas = calibrated.value.tolist(), calibrated.sigma.tolist()
    if calibrated.kind == CLOCK:
        return (
            f"offset {values[0]:+.4f} ± {sigmas[0]:.4f} s, "
            f"rate {values[1]:+.0f} ± {sigmas[1]:.0f} ppm"
        )
    if calibrated.kind == LATENCY:
        return f"{values[0]:.3f} ± {sigmas[0]:.3f} s"
    return ", ".join(f"{v:+.3f} ± {s:.3f}" for v, s in zip(values, sigmas, strict=True)) + " m"


def _squares(x: FloatArray, P: FloatArray, of: list[int]) -> float:
    return float(x[of] @ np.linalg.solve(P[np.ix_(of, of)], x[of])) if of else 0.0
