"""The stages before a smoothing problem for a filter: each keyframe by what came before it alone.

What is certain only later is left out: arcs have the integers that epochs so far name, none floats.
"""

import numpy as np

from fgnav.alignment.alignment import Alignment
from fgnav.alignment.array.float_arcs import FloatArcs
from fgnav.alignment.array_attitudes import of_arrays
from fgnav.alignment.gaps import bridged
from fgnav.alignment.in_motion.attitudes import carried_attitudes
from fgnav.alignment.in_motion.windows import EarlierMotion
from fgnav.alignment.initial import level_start
from fgnav.alignment.vector_alignment import of_vectors
from fgnav.assembly.position.by_observations import ByObservations
from fgnav.assembly.settings import ProblemSettings
from fgnav.assembly.stages import Aligned, chosen_keyframes, inertial_record, measured_times_s
from fgnav.attitude.flight_vectors import measured_vectors, track_of, with_velocity
from fgnav.attitude.imu_rotation import spun
from fgnav.checks import FloatArray
from fgnav.geometry.interpolation import interpolate
from fgnav.gravity import causal_gravity
from fgnav.integrity.imu_screen import without_stuck_so_far
from fgnav.types.flight import Flight


def causal_aligned(
    flight: Flight,
    settings: ProblemSettings,
    by: ByObservations | None,
    earlier: EarlierMotion | None = None,
) -> Aligned:
    """Return attitudes at keyframes, each from its own epoch, integers and all.

    Of a flight that goes on, ``earlier`` sums up its beginning.

    Raises
    ------
    BadInputError
        If the resolver or the gravity estimator has no causal form.
    NoSolutionError
        If no epoch has an attitude.
    """
    imu, faulty = without_stuck_so_far(inertial_record(flight.imu))
    record = bridged(imu, causal=True)
    imu = record.imu
    down = None if settings.gravity is None else causal_gravity(settings.gravity)(flight)
    epochs = _epochs(flight, by, earlier)
    start, count, losses = chosen_keyframes(
        imu, epochs, measured_times_s(flight), causal=True, earlier=earlier
    )
    R_open = None
    if start.rotation is not None and not start.valid[0]:
        R_nu = level_start(flight, imu, start.rotation, float(start.t_s[0]))
        R_open = spun(start.rotation, start.t_s, np.tile(R_nu, (len(start.t_s), 1, 1)))
    stretch = np.full(len(start.t_s), -1, dtype=np.int64)
    rates: FloatArray = np.zeros((len(start.t_s), 3))
    if imu.w_b_radps is not None:
        rates = interpolate(start.t_s, imu.t_s, imu.w_b_radps, causal=True)
    no_arcs, losses = FloatArcs(stretch=stretch, count=0), (*faulty, *losses)
    of_start = Aligned(record, down, start, no_arcs, rates, count, losses, by)
    return of_start._replace(causal=True, R_open=R_open)


def _epochs(flight: Flight, by: ByObservations | None, earlier: EarlierMotion | None) -> Alignment:
    """Return attitudes by the array, by motion beside a gyroscope, or by other vectors."""
    if by is not None and len(flight.antennas) > 1:
        return of_arrays(flight, by.array, causal=True)
    imu = flight.imu
    if imu is None or imu.w_b_radps is None or flight.photodetector is not None:
        track = track_of(flight, causal=True)
        pairs, losses = measured_vectors(flight, track, causal=True)
        return of_vectors(track.t_s, with_velocity(pairs, track), losses)
    return carried_attitudes(flight, imu, causal=True, earlier=earlier)
