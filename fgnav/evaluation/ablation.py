"""A flight without some of what it measured: what a sensor is worth is what is lost without it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fgnav.checks import BadInputError
from fgnav.types.estimate import Estimate, Estimator
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

GRAVITY = "gravity"  # of a method, where KINDS are of a flight


@dataclass(frozen=True, slots=True, kw_only=True)
class Restricted:
    """A method under another name, on flights without some of their measurements."""

    name: str
    estimator: Estimator
    without: tuple[str, ...] = ()

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate what is left of a flight."""
        return replace(self.estimator(without(flight, self.without)), method=self.name)


def restricted(name: str, estimator: Any, kinds: Sequence[str]) -> Estimator:  # noqa: ANN401
    """Return a method by another name, without some kinds of measurement.

    Gravity may be among them where the method takes it.

    Raises
    ------
    BadInputError
        If a kind is unknown, or the method has no source of gravity.
    """
    measured = tuple(kind for kind in kinds if kind != GRAVITY)
    check_kinds(measured)
    if len(measured) < len(kinds):
        if not has_gravity(estimator):
            raise BadInputError(f"without gravity: {estimator.name} has none; name a source of it")
        others = tuple(source for source in estimator.factors or () if not _is_gravity(source))
        estimator = replace(estimator, gravity=None, factors=others)
    if not measured and "name" in getattr(estimator, "__dataclass_fields__", ()):
        renamed: Estimator = replace(estimator, name=name)  # it may share its preparation
        return renamed
    return Restricted(name=name, estimator=estimator, without=measured)


def has_gravity(estimator: Any) -> bool:  # noqa: ANN401  # an estimator
    """Return True if a method has a source of gravity directions, or may ask the network."""
    if not hasattr(estimator, "factors"):
        return False
    factors = estimator.factors
    return estimator.gravity is not None or factors is None or any(map(_is_gravity, factors))


def _is_gravity(source: Any) -> bool:  # noqa: ANN401  # a name or a network
    return str(getattr(source, "name", source)).startswith(GRAVITY)


def without(flight: Flight, kinds: Sequence[str]) -> Flight:
    """Return a flight as if some kinds of measurement had never been made.

    Parameters
    ----------
    kinds : sequence of str
        Of ``KINDS``.

    Raises
    ------
    BadInputError
        If a kind is unknown, or the flight has nothing of it to leave out.
    """
    check_kinds(kinds)
    for kind in kinds:
        less = KINDS[kind](flight)
        if less is None:
            raise BadInputError(f"without {kind}: flight {flight.name!r} has none")
        flight = less
    return flight


def check_kinds(kinds: Sequence[str]) -> None:
    """Raise unless all are of ``KINDS``."""
    for kind in kinds:
        if kind not in KINDS:
            raise BadInputError(f"without {kind}: not one of {', '.join((*KINDS, GRAVITY))}")


def _none(name: str) -> Callable[[Flight], Flight | None]:
    """Return the function that removes a whole record."""

    def less(flight: Flight) -> Flight | None:
        record = getattr(flight, name)
        gone: dict[str, Any] = {name: () if isinstance(record, tuple) else None}
        return replace(flight, **gone) if record else None

    return less


def _unmeasured(name: str) -> Callable[[Flight], Flight | None]:
    """Return the function that removes one kind of GNSS observation, of vehicle and base."""

    def less(flight: Flight) -> Flight | None:
        observations, base = flight.observations, flight.base
        if observations is None or np.isnan(getattr(observations, name)).all():
            return None
        if base is not None:
            base = replace(base, observations=_nan(base.observations, name))
        return replace(flight, observations=_nan(observations, name), base=base)

    return less


def _nan(observations: Observations, name: str) -> Observations:
    unmeasured: dict[str, Any] = {name: np.full(getattr(observations, name).shape, np.nan)}
    return replace(observations, **unmeasured)


def _no_gyroscope(flight: Flight) -> Flight | None:
    if flight.imu is None or flight.imu.w_b_radps is None:
        return None
    lost: dict[str, Any] = dict.fromkeys(
        (
            "w_b_radps",
            "gyroscope_noise_radps_per_sqrt_hz",
            "gyroscope_bias_radps",
            "gyroscope_bias_walk_radps_per_sqrt_s",
        )
    )
    return replace(flight, imu=replace(flight.imu, **lost))


def _no_baselines(flight: Flight) -> Flight | None:
    """Return a flight without receivers' baselines, and whose reference antenna is alone."""
    observed = flight.observations
    if observed is None or len(flight.antennas) < 2:
        return replace(flight, baselines=()) if flight.baselines else None
    truth, antenna = flight.truth, flight.antennas[0]
    return replace(
        flight,
        fixes=tuple(fixes for fixes in flight.fixes if fixes.antenna == antenna.name),
        baselines=(),
        antennas=(antenna,),
        observations=observed.of_antennas(slice(1)),
        truth=None if truth is None else replace(truth, integers=None),
    )


KINDS: dict[str, Callable[[Flight], Flight | None]] = {
    "baselines": _no_baselines,
    "phase": _unmeasured("phase_cycles"),
    "doppler": _unmeasured("doppler_hz"),
    "gnss": _none("observations"),
    "fixes": _none("fixes"),
    "gyroscope": _no_gyroscope,
    "inertial": _none("imu"),
    "line-of-sight": _none("photodetector"),
    "barometer": _none("barometer"),
    "magnetometer": _none("magnetometer"),
    "vehicle": _none("vehicle"),
    "networks": _none("networks"),
}
