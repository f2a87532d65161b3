"""The nominal noise of a flight: what is stated, what is usual, and the same with factors on it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from fgnav.assembly.settings import ProblemSettings
from fgnav.noise.components import AT_REST, INSTRUMENTS
from fgnav.types.flight import Flight


class _Field(NamedTuple):
    """Place of a component's noise in a flight: a kind of record, its field, and the power."""

    kind: str
    name: str
    power: int = 1


FIELDS = {
    "accelerometer": _Field("imu", "accelerometer_noise_mps2_per_sqrt_hz"),
    "gyroscope": _Field("imu", "gyroscope_noise_radps_per_sqrt_hz"),
    "accelerometer bias": _Field("imu", "accelerometer_bias_walk_mps2_per_sqrt_s"),
    "gyroscope bias": _Field("imu", "gyroscope_bias_walk_radps_per_sqrt_s"),
    "position": _Field("fixes", "position_sigma_m"),
    "velocity": _Field("fixes", "velocity_sigma_mps"),
    "baseline": _Field("baseline", "covariance_m2", 2),
    "barometric height": _Field("barometer", "noise_m"),
    "line of sight": _Field("photodetector", "line_of_sight_sigma_rad"),
    "magnetic field": _Field("magnetometer", "noise_ut"),
}


def scalable(flight: Flight) -> tuple[str, ...]:
    """Return sensors whose noise is one factor on the nominal.

    Positions by phase follow the noise of phases, which single epochs determine.
    """
    gnss = ("velocity",) if flight.observations is not None else ("position", "velocity")
    return (*gnss, "baseline", *INSTRUMENTS)


def unstated(flight: Flight) -> tuple[str, ...]:
    """Return components that the flight does not state; a usual figure stands there."""
    names: tuple[str, ...] = ()
    if flight.imu is not None:
        names += tuple(name for name, field in FIELDS.items() if field.name in flight.imu.unstated)
    if flight.observations is not None:
        return (*names, "velocity") if "doppler_mps" in flight.gnss_noise.unstated else names
    of_receivers = (*(fix.unstated for fix in flight.fixes),)
    of_receivers += (*(baseline.unstated for baseline in flight.baselines),)
    return names + tuple(dict.fromkeys(name for receiver in of_receivers for name in receiver))


def with_factors(flight: Flight, factors: Mapping[str, float]) -> Flight:
    """Return a flight with standard deviations multiplied by factors of components."""
    records: dict[str, Any] = flight.records
    nominal = ("fixes",) if flight.observations is not None else ()  # they are not used
    for component in FIELDS.keys() & factors.keys():
        kind, field, power = FIELDS[component]
        for name, record in records.items():
            value = getattr(record, field, None)
            if name.split()[0] == kind and kind not in nominal and value is not None:
                records[name] = replace(record, **{field: value * factors[component] ** power})
    noise = flight.gnss_noise
    if flight.observations is not None:
        noise = replace(noise, doppler_mps=noise.doppler_mps * factors.get("velocity", 1.0))
    return replace(flight.with_records(records), gnss_noise=noise)


def with_standstill(settings: ProblemSettings, factors: Mapping[str, float]) -> ProblemSettings:
    """Return settings with the noise at standstill relative to that in motion."""
    names = {name.removesuffix(AT_REST) for name in factors}
    at_rest = {n: factors.get(n + AT_REST, 1.0) / factors.get(n, 1.0) for n in names}
    return replace(settings, at_rest=at_rest)
