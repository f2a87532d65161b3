"""What orbits, clocks and models of the atmosphere leave in every range to a satellite.

Estimators believe what a message states of its accuracy and what a model of the atmosphere is known
to leave. Flights without such errors would be better than they have a right to expect: positions to
centimetres under a stated metre.
"""

from dataclasses import replace

import numpy as np

from fgnav.flight import Flight
from fgnav.gnss.code_model import atmosphere_m, code_channels, code_ranges
from fgnav.gnss.satellites import angles, signal_paths
from fgnav.gnss.signals import wavelengths_m
from fgnav.observations import Observations


def with_message_errors(flight: Flight, rng: np.random.Generator) -> Flight:
    """Return a flight with one error for each satellite in all its codes and phases.

    Drawn with the standard deviation that estimators will expect of it in the middle of the flight;
    the same at all antennas and at the base, and constant: it drifts over hours.

    Parameters
    ----------
    flight : Flight
        With observations.
    rng : numpy.random.Generator
    """
    observations = flight.observations
    if observations is None:
        return flight
    channels = code_channels(observations, 0)
    middle = np.array([len(observations.t_s) // 2])
    ranges = code_ranges(flight, observations, channels, 0, middle)
    p_e_m = flight.origin.p_e_m[None]
    seen = angles(p_e_m, signal_paths(ranges.states, p_e_m, np.zeros((1, 3))).e_e)
    _, left_m2 = atmosphere_m(flight, channels, p_e_m, seen, ranges.gps_s)
    sigma_m = np.sqrt(np.nan_to_num(ranges.message_variance_m2 + left_m2))[0]
    drawn_m = sigma_m * rng.standard_normal(len(sigma_m))
    names = [observations.satellites[column] for column in channels.column]
    error_m = dict(zip(names, drawn_m.tolist(), strict=True))
    base = flight.base
    return replace(
        flight,
        observations=_further(observations, error_m),
        base=base and replace(base, observations=_further(base.observations, error_m)),
    )


def _further(observations: Observations, error_m: dict[str, float]) -> Observations:
    """Lengthen every range by its satellite's error."""
    longer_m = np.array([error_m.get(satellite, 0.0) for satellite in observations.satellites])
    wavelength_m = wavelengths_m(observations.satellites, observations.signals)
    return replace(
        observations,
        code_m=observations.code_m + longer_m,
        phase_cycles=observations.phase_cycles + longer_m / wavelength_m,
    )
