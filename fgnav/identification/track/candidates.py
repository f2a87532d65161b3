"""Clocks of the inertial unit from which to begin: the stated one, and what fits the track.

A chain finds a clock that is off by less than half a swing of the motion; from further off it ends
in another valley, and no alignment finds a heading.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.identification.track.clock import NEAR_S, STEP_S, clock, searched
from fgnav.identification.track.integrals import integrated
from fgnav.identification.track.series import series_of, where_it_moves
from fgnav.identification.track.windows import FEWEST
from fgnav.types.flight import Flight, Imu


def clock_candidates(flight: Flight) -> tuple[float, ...]:
    """Return by what the unit's times are to be raised, s: what to try, the stated clock first.

    Without a gyroscope, or without fixes, that alone; where the track tells the clock, no other.
    """
    imu, fixes = flight.imu, flight.fixes
    if imu is None or imu.w_b_radps is None or fixes is None or flight.observations is not None:
        return (0.0,)
    series = series_of(flight.origin, where_it_moves(fixes))[0]
    if len(series.windows) < FEWEST:
        return (0.0,)
    integrals = integrated(imu.t_s, imu.f_b_mps2, imu.w_b_radps)
    arm_b_m = flight.antenna(fixes.antenna).position_b_m - imu.position_b_m
    best = clock(series, integrals, imu, arm_b_m)
    if best is not None and abs(best.late_s) > max(best.reach_s, STEP_S):
        return (best.late_s,)
    late_s = [0.0]
    candidates = (*searched(series, integrals), *([] if best is None else [best.late_s]))
    for one in sorted(candidates, key=abs):
        is_new = all(abs(one - other) > STEP_S for other in late_s)
        if is_new and 2 * _common(imu, fixes.t_s, (*late_s, one)).sum() >= len(fixes.t_s):
            late_s.append(float(one))
    return tuple(late_s)


def over_common_span(flight: Flight, late_s: tuple[float, ...]) -> Flight:
    """Return a flight with what GNSS has within the unit's record at and near every clock."""
    if flight.imu is None:
        return flight
    fixes, observations = flight.fixes, flight.observations
    if fixes is not None:
        fixes = fixes[_common(flight.imu, fixes.t_s, late_s)]
    if observations is not None:
        observations = observations[_common(flight.imu, observations.t_s, late_s)]
    return replace(flight, fixes=fixes, observations=observations)


def _common(imu: Imu, t_s: FloatArray, late_s: tuple[float, ...]) -> BoolArray:
    """Return which times these are, (k,)."""
    first_s = imu.t_s[0] + max(late_s) + NEAR_S
    last_s = imu.t_s[-1] + min(late_s) - NEAR_S
    return np.asarray((t_s >= first_s) & (t_s <= last_s))
