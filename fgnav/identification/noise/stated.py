"""What a flight states of its sensors' noise, and the same with factors on it."""

from dataclasses import replace

from fgnav.frontend.sensors.rest import AT_REST
from fgnav.frontend.settings import ProblemSettings
from fgnav.identification.likelihood.thinned import FIELDS, scaled
from fgnav.types.flight import Flight

# Beside position and velocity. What they say less loudly than stated contradicts nothing: what is
# stated of them stands for more than samples show, such as a drift between its estimated values.
INSTRUMENTS = ("barometric height", "line of sight", "magnetic field")


def scalable(flight: Flight) -> tuple[str, ...]:
    """Return measurements whose noise is one factor on what the flight states.

    Of raw observations the phases' noise is told by the epochs themselves (``attitude.array``), and
    positions follow it.
    """
    gnss = ("velocity",) if flight.observations is not None else ("position", "velocity")
    return (*gnss, *INSTRUMENTS)


def unstated(flight: Flight) -> tuple[str, ...]:
    """Return the components that the flight does not state."""
    names: tuple[str, ...] = ()
    if flight.imu is not None:
        names += tuple(part for part, name in FIELDS.items() if name in flight.imu.unstated)
    if flight.observations is not None:
        return (*names, "velocity") if "doppler_mps" in flight.gnss_noise.unstated else names
    return names + (() if flight.fixes is None else flight.fixes.unstated)


def with_factors(flight: Flight, factors: dict[str, float]) -> Flight:
    """Return a flight with standard deviations multiplied by factors of components."""
    imu, fixes, noise = flight.imu, flight.fixes, flight.gnss_noise
    position, velocity = (factors.get(name, 1.0) for name in ("position", "velocity"))
    if imu is not None:
        imu = scaled(imu, factors)
    if flight.observations is not None:
        noise = replace(noise, doppler_mps=noise.doppler_mps * velocity)
    elif fixes is not None:
        sigma = fixes.velocity_sigma_mps
        fixes = replace(
            fixes,
            position_sigma_m=fixes.position_sigma_m * position,
            velocity_sigma_mps=None if sigma is None else sigma * velocity,
        )
    return replace(_instruments(flight, factors), imu=imu, gnss_noise=noise, fixes=fixes)


def with_rest(settings: ProblemSettings, factors: dict[str, float]) -> ProblemSettings:
    """Return settings with what noises at rest are of those in motion."""
    names = {name.removesuffix(AT_REST) for name in factors}
    at_rest = {n: factors.get(n + AT_REST, 1.0) / factors.get(n, 1.0) for n in names}
    return replace(settings, at_rest=at_rest)


def _instruments(flight: Flight, factors: dict[str, float]) -> Flight:
    """Return a flight with factors on the noise of barometer, detector and magnetometer."""
    height, sight, field = (factors.get(name, 1.0) for name in INSTRUMENTS)
    barometer, seeker, magnetometer = flight.barometer, flight.seeker, flight.magnetometer
    if barometer is not None:
        barometer = replace(barometer, noise_m=barometer.noise_m * height)
    if seeker is not None:
        sigma_rad = seeker.line_of_sight_sigma_rad * sight
        seeker = replace(seeker, line_of_sight_sigma_rad=sigma_rad)
    if magnetometer is not None:
        magnetometer = replace(magnetometer, noise_ut=magnetometer.noise_ut * field)
    return replace(flight, barometer=barometer, seeker=seeker, magnetometer=magnetometer)
