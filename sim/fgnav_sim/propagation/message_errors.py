"""Errors of orbits, clocks and models of the atmosphere in every range to a satellite.

Estimators believe what a message states of its accuracy and what a model of the atmosphere is known
to leave. Flights without such errors would be better than they have a right to expect: positions to
centimetres under a stated metre.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.gnss.orbits.satellites import angles, signal_paths
from fgnav.gnss.signals import wavelengths_m
from fgnav.gnss.single_point.model import atmosphere_m, code_channels, code_ranges
from fgnav.types.flight import Flight, GnssNoise
from fgnav.types.observations import Observations


def with_message_errors(flight: Flight, rng: np.random.Generator) -> Flight:
    """Return a flight with an error of each satellite in all its codes and phases.

    Drawn with the standard deviation that estimators will expect of it in the middle of the flight;
    the same at all antennas and at the base. It moves from there at a constant rate and in a random
    walk, of the sizes that the flight states (``flight.gnss_noise``); one that stated to have none
    states the usual ones from then on.

    Parameters
    ----------
    flight : Flight
        With observations.
    """
    observations = flight.observations
    if observations is None:
        return flight
    if not flight.gnss_noise.message_errors:
        usual = GnssNoise()
        noise = replace(
            flight.gnss_noise,
            message_errors=True,
            satellite_error_rate_mps=usual.satellite_error_rate_mps,
            satellite_error_walk_m_per_sqrt_s=usual.satellite_error_walk_m_per_sqrt_s,
        )
        flight = replace(flight, gnss_noise=noise)
    channels = code_channels(observations, 0)
    middle = np.array([len(observations.t_s) // 2])
    ranges = code_ranges(flight, observations, channels, 0, middle)
    p_e_m = flight.origin.p_e_m[None]
    viewed = angles(p_e_m, signal_paths(ranges.states, p_e_m, np.zeros((1, 3))).e_e)
    _, left_m2 = atmosphere_m(flight, channels, p_e_m, viewed, ranges.gps_s)
    sigma_m = np.sqrt(np.nan_to_num(ranges.message_variance_m2 + left_m2))[0]
    drawn_m = sigma_m * rng.standard_normal(len(sigma_m))
    base, noise = flight.base, flight.gnss_noise
    t_s = observations.t_s if base is None else np.union1d(observations.t_s, base.observations.t_s)
    step_s = np.diff(t_s, prepend=t_s[0])[:, None]
    walk_m = np.sqrt(step_s) * rng.standard_normal((len(t_s), len(sigma_m)))
    walk_m = noise.satellite_error_walk_m_per_sqrt_s * np.cumsum(walk_m, axis=0)
    index = int(np.searchsorted(t_s, observations.t_s[middle[0]]))
    rate_mps = noise.satellite_error_rate_mps * rng.standard_normal(len(sigma_m))
    moved_m = walk_m - walk_m[index] + (t_s - t_s[index])[:, None] * rate_mps
    errors = _Errors(
        t_s=t_s,
        satellites=tuple(observations.satellites[column] for column in channels.column),
        error_m=drawn_m + moved_m,
        rate_mps=rate_mps,
    )
    return replace(
        flight,
        observations=_further(observations, errors),
        base=base and replace(base, observations=_further(base.observations, errors)),
    )


class _Errors(NamedTuple):
    """Errors of satellites' ranges."""

    t_s: FloatArray  # (k,)
    satellites: tuple[str, ...]  # (s,)
    error_m: FloatArray  # (k, s)
    rate_mps: FloatArray  # (s,)


def _further(observations: Observations, errors: _Errors) -> Observations:
    """Lengthen every range by its satellite's error."""
    columns = {satellite: k for k, satellite in enumerate(errors.satellites)}
    column = np.array([columns.get(satellite, -1) for satellite in observations.satellites])
    row, has = np.searchsorted(errors.t_s, observations.t_s), column >= 0
    longer_m = np.where(has, errors.error_m[row][:, column], 0.0)[:, None]
    faster_mps = np.where(has, errors.rate_mps[column], 0.0)
    wavelength_m = wavelengths_m(observations.satellites, observations.signals)
    return replace(
        observations,
        code_m=observations.code_m + longer_m,
        phase_cycles=observations.phase_cycles + longer_m / wavelength_m,
        doppler_hz=observations.doppler_hz - faster_mps / wavelength_m,
    )
