"""Antennas that the array's own phases contradict: estimated with the flight, and said."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.attitude.array import AttitudeSolution, maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray
from fgnav.frontend.array.misplaced import misplaced
from fgnav.frontend.calibration_request import CalibrationRequest, calibration_requests
from fgnav.frontend.prepared import PreparedFlight
from fgnav.graph.innovation.band import throughout
from fgnav.types.estimate import Consistency
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
    tests : tuple of Consistency
        Of phases that no misplaced antenna and no noise explains.
    """

    reference: int
    requests: tuple[CalibrationRequest, ...]
    notes: tuple[str, ...]
    tests: tuple[Consistency, ...]


def places_of(
    flight: Flight, asked: tuple[CalibrationRequest, ...], prepared: PreparedFlight
) -> Places:
    """Return what phases say of places; nothing of an array whose places are asked for."""
    if prepared.array is None:
        return Places(0, (), (), ())
    differences, ranges_m = prepared.array
    attitude = maximum_likelihood(RotationQuadratic.of_ranges(differences, ranges_m))
    is_asked = any(one.kind == "antenna" for one in asked)
    found = () if is_asked else misplaced(differences, ranges_m, attitude)
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
    tests = () if found else _tests(differences.t_s, attitude)
    return Places(reference, tuple(requests), tuple(notes), tests)


def _tests(t_s: FloatArray, attitude: AttitudeSolution) -> tuple[Consistency, ...]:
    """Return by how much phases of most epochs contradict each other, where that is no noise."""
    nis, freedom = attitude.misfit(), int(attitude.degrees_of_freedom[attitude.solved].sum())
    if nis == 1.0:
        return ()
    return (
        Consistency(
            what="array",
            count=int(attitude.solved.sum()),
            freedom=freedom,
            nis=nis,
            beyond_99=1.0,
            contradictions=(throughout(t_s, freedom, nis),),
        ),
    )


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


def exchanged_columns(seen: Observations, rows: BoolArray, pair: tuple[int, int]) -> Observations:
    """Return observations with those of two antennas exchanged at some epochs, (n,)."""
    order = np.arange(seen.tag_s.shape[1])
    order[list(pair)] = pair[::-1]
    exchanged = _ordered(seen, order.tolist())
    return replace(
        seen,
        **{
            name: np.where(
                rows.reshape(-1, *[1] * (getattr(seen, name).ndim - 1)),
                getattr(exchanged, name),
                getattr(seen, name),
            )
            for name in _BY_ANTENNA
        },
    )
