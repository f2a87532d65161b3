"""The nominal noise of a flight: what is stated, what is usual, and the same with factors on it."""

from collections.abc import Mapping
from dataclasses import replace

from fgnav.assembly.settings import ProblemSettings
from fgnav.noise.components import AT_REST, INSTRUMENTS
from fgnav.types.flight import Fixes, Flight, Imu

# Fields of ``Imu`` by component.
FIELDS = {
    "accelerometer": "accelerometer_noise_mps2_per_sqrt_hz",
    "gyroscope": "gyroscope_noise_radps_per_sqrt_hz",
    "accelerometer bias": "accelerometer_bias_walk_mps2_per_sqrt_s",
    "gyroscope bias": "gyroscope_bias_walk_radps_per_sqrt_s",
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
        names += tuple(part for part, name in FIELDS.items() if name in flight.imu.unstated)
    if flight.observations is not None:
        return (*names, "velocity") if "doppler_mps" in flight.gnss_noise.unstated else names
    of_receivers = (*(one.unstated for one in flight.fixes),)
    of_receivers += (*(one.unstated for one in flight.baselines),)
    return names + tuple(dict.fromkeys(name for part in of_receivers for name in part))


def with_factors(flight: Flight, factors: Mapping[str, float]) -> Flight:
    """Return a flight with standard deviations multiplied by factors of components."""
    imu, fixes, noise = flight.imu, flight.fixes, flight.gnss_noise
    position, velocity, baseline = (
        factors.get(name, 1.0) for name in ("position", "velocity", "baseline")
    )
    if imu is not None:
        imu = _scaled(imu, factors)
    if flight.observations is not None:
        noise = replace(noise, doppler_mps=noise.doppler_mps * velocity)
    else:
        fixes = tuple(_fixes(one, position, velocity) for one in fixes)
    baselines = tuple(
        replace(one, covariance_m2=one.covariance_m2 * baseline**2) for one in flight.baselines
    )
    changed = replace(flight, imu=imu, gnss_noise=noise, fixes=fixes, baselines=baselines)
    return _instruments(changed, factors)


def _fixes(fixes: Fixes, position: float, velocity: float) -> Fixes:
    sigma = fixes.velocity_sigma_mps
    return replace(
        fixes,
        position_sigma_m=fixes.position_sigma_m * position,
        velocity_sigma_mps=None if sigma is None else sigma * velocity,
    )


def with_standstill(settings: ProblemSettings, factors: Mapping[str, float]) -> ProblemSettings:
    """Return settings with the noise at standstill relative to that in motion."""
    names = {name.removesuffix(AT_REST) for name in factors}
    at_rest = {n: factors.get(n + AT_REST, 1.0) / factors.get(n, 1.0) for n in names}
    return replace(settings, at_rest=at_rest)


def _scaled(imu: Imu, factors: Mapping[str, float]) -> Imu:
    changed = {}
    for component, name in FIELDS.items():
        value = getattr(imu, name)
        if value is not None:
            changed[name] = value * factors.get(component, 1.0)
    return replace(imu, **changed)


def _instruments(flight: Flight, factors: Mapping[str, float]) -> Flight:
    """Return a flight with factors on the noise of barometer, detector and magnetometer."""
    height, sight, field = (factors.get(name, 1.0) for name in INSTRUMENTS)
    barometer, photodetector, magnetometer = (
        flight.barometer,
        flight.photodetector,
        flight.magnetometer,
    )
    if barometer is not None:
        barometer = replace(barometer, noise_m=barometer.noise_m * height)
    if photodetector is not None:
        sigma_rad = photodetector.line_of_sight_sigma_rad * sight
        photodetector = replace(photodetector, line_of_sight_sigma_rad=sigma_rad)
    if magnetometer is not None:
        magnetometer = replace(magnetometer, noise_ut=magnetometer.noise_ut * field)
    return replace(
        flight, barometer=barometer, photodetector=photodetector, magnetometer=magnetometer
    )
