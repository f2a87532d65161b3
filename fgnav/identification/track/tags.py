"""The inertial unit's time tags: as they stand, moved, and whether they are far off."""

from dataclasses import replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph.delayed_kernel import PPM
from fgnav.identification.tested_constants import Times
from fgnav.types.flight import Flight, Imu

_MOVED_S = 0.01  # a clock off by more is corrected first: beyond, its carrying of states errs


def with_exact_tags(flight: Flight) -> Flight:
    """Return a flight whose tags are in no doubt: the clock is tested whatever that is."""
    imu = flight.imu
    if imu is None or not imu.clock_offset_sigma_s:
        return flight
    return replace(flight, imu=replace(imu, clock_offset_sigma_s=0.0))


def is_far(flight: Flight, times: Times) -> bool:
    """Return whether the clock is or may be off by so much that states are carried too far.

    Or at all, of raw observations: phases of arcs take tags as exact.
    """
    if flight.imu is None or not (times.significant[:2].any() or times.is_clock_in_doubt):
        return False
    if flight.observations is not None:
        return True
    half_s = (flight.imu.t_s[-1] - flight.imu.t_s[0]) / 2
    return bool(abs(times.value[0]) + PPM * abs(times.value[1]) * half_s > _MOVED_S)


def middle_of_tags_s(imu: Imu | None) -> float:
    """Return the middle of a unit's record, for which a clock's offset is stated."""
    return 0.0 if imu is None else float(imu.t_s[[0, -1]].mean())


def with_tags_moved(flight: Flight, by: FloatArray, middle_s: float) -> Flight:
    """Return a flight whose unit's tags are moved by an offset in a middle, s, and a rate, ppm."""
    imu = flight.imu
    if imu is None or not by.any():
        return flight
    return replace(flight, imu=replace(imu, t_s=tags_moved_s(imu, by, middle_s)))


def tags_moved_s(imu: Imu, by: FloatArray, middle_s: float) -> FloatArray:
    """Return a unit's tags moved by an offset in a middle, s, and a rate, ppm."""
    return np.asarray(imu.t_s + by[0] + PPM * by[1] * (imu.t_s - middle_s))
