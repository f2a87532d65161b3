"""The records of an observation file's scan, spread over epochs and channels."""

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import IntArray, Loss
from fgnav.io.antennas import nominal_epochs
from fgnav.io.gps_time import (
    BDT_BEHIND_GPS_S,
    TICKS_PER_S,
    UNIX_OF_GPS_S,
    gps_of_utc,
    to_ticks,
)
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.scan import Scan
from fgnav.types.observations import LOST_LOCK, Observations


def to_observations(header: Header, scan: Scan, start_gps_s: float) -> Observations:
    """Return the observations of one antenna."""
    ticks = scan.ticks + _time_shift(header, scan.ticks)
    tag_s = (ticks - to_ticks(start_gps_s)) / TICKS_PER_S
    epoch, letter, number = scan.records.T
    row, carrier = np.nonzero((scan.values != 0).any(axis=2) | (scan.locks != 0))
    keys = (letter * 100 + number)[row] * len(scan.names) + scan.signals[row, carrier]
    tracked = (scan.values[row, carrier, :2] != 0).any(axis=1)  # code or phase
    channel_keys = np.unique(keys[tracked])
    column = np.searchsorted(channel_keys, keys)
    kept = np.isin(keys, channel_keys)
    alone = int((scan.values[row[~kept], carrier[~kept]] != 0).sum())
    reason = "neither code nor phase of its carrier is in the file"
    losses = [Loss(what="Doppler or density", reason=reason, count=alone)] if alone else []
    row, carrier, column = row[kept], carrier[kept], column[kept]
    satellites, signals = np.divmod(channel_keys, len(scan.names))
    channels = [
        (f"{chr(satellite // 100)}{satellite % 100:02d}", scan.names[name])
        for satellite, name in zip(satellites.tolist(), signals.tolist(), strict=True)
    ]
    order = sorted(range(len(channels)), key=channels.__getitem__)
    where = epoch[row], np.argsort(order)[column] if order else column
    shape = (len(tag_s), len(channels))
    arrays: dict[str, NDArray[np.floating]] = {}
    for k, name in enumerate(("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz")):
        dense = np.full(shape, np.nan, np.float32 if name == "cn0_dbhz" else np.float64)
        some = scan.values[row, carrier, k]
        dense[where] = np.where(some != 0, some, np.nan)
        arrays[name] = dense[:, None]
    flags = np.zeros(shape, np.uint8)
    flags[where] = scan.locks[row, carrier]
    flags[scan.power_failure] |= LOST_LOCK
    return Observations(
        t_s=nominal_epochs(tag_s, start_gps_s),
        tag_s=tag_s[:, None],
        satellites=tuple(channels[k][0] for k in order),
        signals=tuple(channels[k][1] for k in order),
        losses=(*scan.losses, *losses),
        earlier=None,
        lock_flags=flags[:, None],
        **arrays,
    )


def _time_shift(header: Header, ticks: IntArray) -> IntArray:
    """Return what to add to the file's epochs for GPS time."""
    if header.time_system == "BDT":
        return np.full(len(ticks), BDT_BEHIND_GPS_S * TICKS_PER_S)
    if header.time_system != "GLO":
        return np.zeros(len(ticks), np.int64)
    utc_s = ticks // TICKS_PER_S + float(UNIX_OF_GPS_S)  # GLONASS's time is UTC in RINEX
    return (gps_of_utc(utc_s) + UNIX_OF_GPS_S - utc_s).astype(np.int64) * TICKS_PER_S
