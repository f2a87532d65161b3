"""Specific forces that are late against the rates of their unit: a filter's delay.

A low pass of the accelerometer alone delays forces, which no clock of the whole unit and no delay
of velocities stands for: their sum shows as a delay, and the forces point where the body pointed
before. The delay is the likeliest of a parabola through the flight with forces as they are, early
by what clock and velocities say, and by twice that.
"""

from dataclasses import replace

import numpy as np

from fgnav.identification.tested_constants import SIGMAS
from fgnav.identification.time_tags import AtTags, TagSearch
from fgnav.types.flight import Flight


def with_late_forces(search: TagSearch, at_tags: AtTags) -> tuple[TagSearch, AtTags, float]:
    """Return a search with forces in time, what the flight says then, and by what they are late.

    As they were, and 0, where the tags are in no doubt, or no delay is likelier than what was found
    of them.
    """
    doubted, imu = at_tags.doubted, search.flight.imu
    if doubted is None or imu is None or imu.w_b_radps is None:
        return search, at_tags, 0.0
    value, tags = doubted.identified.times.value, (doubted.moved, at_tags.moved)

    def likelihood(late_s: float) -> float:
        early = _early(search, late_s)
        return early.without_clock(doubted.moved, tags, delay=False).likelihood

    step_s = -float(value[0] + np.nan_to_num(value[2]))
    first, second, third = (likelihood(k * step_s) for k in range(3))
    curvature = first - 2 * second + third
    if not curvature < 0.0:  # neither NaN, without solutions
        return search, at_tags, 0.0
    late_s = step_s * (1.0 + float(np.clip((first - third) / (2 * curvature), -1.0, 1.0)))
    least = max(first, *(search.without_clock(by, tags).likelihood for by in tags))
    if not doubted.identified.times.are_one_or_the_other:  # else something of time is off
        least += SIGMAS**2 / 2
    if likelihood(late_s) <= least:
        return search, at_tags, 0.0
    early = _early(search, late_s)
    again = early.identified(doubted.moved)
    return (search, at_tags, 0.0) if again is None else (early, again, late_s)


def with_forces_early(flight: Flight, by_s: float) -> Flight:
    """Return a flight whose forces are those that its unit recorded later."""
    imu = flight.imu
    if imu is None or by_s == 0.0:
        return flight
    columns = [np.interp(imu.t_s + by_s, imu.t_s, axis) for axis in imu.f_b_mps2.T]
    return replace(flight, imu=replace(imu, f_b_mps2=np.stack(columns, axis=1)))


def sentences(late_s: float) -> tuple[str, ...]:
    """Return what is to be said of late forces."""
    if late_s == 0.0:
        return ()
    return (
        f"The accelerometer is {late_s:.3f} s late against the gyroscope, as of a low pass: its "
        "forces are taken as early as that.",
    )


def _early(search: TagSearch, by_s: float) -> TagSearch:
    return search._replace(flight=with_forces_early(search.flight, by_s))
