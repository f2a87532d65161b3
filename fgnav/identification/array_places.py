"""Antennas that the array's own phases contradict: estimated with the flight, and said."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.frontend.array.misplaced import misplaced
from fgnav.frontend.calibration_request import CalibrationRequest, calibration_requests
from fgnav.frontend.problem import PreparedFlight
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

_BY_ANTENNA = ("tag_s", "code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")


class Places(NamedTuple):
    """What to estimate of an array's places.

    Attributes
    ----------
    reference : int
        Antenna against which the others are: one that is at its place.
    requests : tuple of CalibrationRequest
    notes : tuple of str
    """

    reference: int
    requests: tuple[CalibrationRequest, ...]
    notes: tuple[str, ...]


def places_of(
    flight: Flight, asked: tuple[CalibrationRequest, ...], prepared: PreparedFlight
) -> Places:
    """Return what phases say of places; nothing of an array whose places are asked for."""
    is_asked = any(one.kind == "antenna" for one in asked)
    found = () if is_asked or prepared.array is None else misplaced(*prepared.array)
    off = {one.antenna for one in found}
    requests, notes = [], []
    for one in found:
        name, off_m = flight.antennas[one.antenna].name, float(np.linalg.norm(one.off_b_m))
        request = calibration_requests([f"antenna:{name}"])[0]
        requests.append(replace(request, sigma=max(request.sigma, off_m)))
        along = ", ".join(f"{x:+.3f}" for x in one.off_b_m)
        sigma_m = ", ".join(f"{x:.3f}" for x in one.sigma_m)
        notes.append(
            f"Antenna {name} is off its place among the others, by their phases: {along} m along "
            f"x_b, y_b, z_b (± {sigma_m} m); estimated with the flight."
        )
    reference = min(set(range(len(flight.antennas))) - off, default=0)
    return Places(reference, tuple(requests), tuple(notes))


def with_reference(flight: Flight, reference: int) -> Flight:
    """Return a flight whose antennas are against another: places of the others can be estimated."""
    seen = flight.observations
    if reference == 0 or seen is None:
        return flight
    order = [reference, *(a for a in range(len(flight.antennas)) if a != reference)]
    truth = flight.truth
    return replace(
        flight,
        antennas=tuple(flight.antennas[a] for a in order),
        observations=_ordered(seen, order),
        truth=None if truth is None else replace(truth, integers=None),
    )


def _ordered(seen: Observations, order: list[int]) -> Observations:
    return replace(seen, **{name: getattr(seen, name)[:, order] for name in _BY_ANTENNA})
