"""GPS time in files: dates, and whole ticks of the 1e-7 s that RINEX writes."""

import math

import numpy as np

GPS_EPOCH = np.datetime64("1980-01-06T00:00:00", "us")
TICKS_PER_S = 10_000_000
BDT_BEHIND_GPS_S = 14  # fixed since 2006-01-01
UNIX_OF_GPS_S = 315_964_800  # 1980-01-06 in POSIX time, leap seconds not counted


def to_ticks(gps_s: float) -> int:
    """Return seconds since 1980-01-06 in ticks; a product in double precision would lose one."""
    whole = math.floor(gps_s)
    return whole * TICKS_PER_S + round((gps_s - whole) * TICKS_PER_S)
