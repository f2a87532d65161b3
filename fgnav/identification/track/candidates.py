"""Clocks of the inertial unit from which to begin: the stated one, and what fits the track.

A chain finds a clock that is off by less than half a swing of the motion; from further off it ends
in another valley, and no alignment finds a heading.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import BoolArray
from fgnav.identification.track.clock import NEAR_S, STEP_S, clock, searched
from fgnav.identification.track.integrals import integrated
from fgnav.identification.track.series import series_of, where_it_moves
from fgnav.identification.track.windows import FEWEST
from fgnav.types.flight import Flight


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
        if is_new and 2 * _common(flight, (*late_s, one)).sum() >= len(fixes.t_s):
            late_s.append(float(one))
    return tuple(late_s)


def over_common_span(flight: Flight, late_s: tuple[float, ...]) -> Flight:
    """Return a flight with the fixes that lie within the unit's record at and near every clock."""
    if flight.fixes is None:
        return flight
    return replace(flight, fixes=flight.fixes[_common(flight, late_s)])


def _common(flight: Flight, late_s: tuple[float, ...]) -> BoolArray:
    """Return which fixes these are, (k,)."""
    imu, fixes = flight.imu, flight.fixes
    if imu is None or fixes is None:
        return np.zeros(0, dtype=np.bool_)
    first_s = imu.t_s[0] + max(late_s) + NEAR_S
    last_s = imu.t_s[-1] + min(late_s) - NEAR_S
    return np.asarray((fixes.t_s >= first_s) & (fixes.t_s <= last_s))
