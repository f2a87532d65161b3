"""A flight cut at a time: what a filter has by then, and the test of whether it looks ahead.

A causal estimate of a time does not change when the flight is cut there: that is the
definition.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import BoolArray
from fgnav.types.flight import Flight
from fgnav.types.observations import BY_EPOCH, Observations

BY_CHANNEL = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")


def truncated(
    flight: Flight, until_s: float, *, after_s: float = -np.inf, base_s: float = 0.0
) -> Flight:
    """Return a flight with all records cut: samples at ``until_s`` or before remain.

    With ``after_s`` those after it alone: what came since. Channels of satellites that are first
    tracked later are gone, as if they had never been, and records without samples left.
    Orbits stay, which are known beforehand, and truth.

    Parameters
    ----------
    flight : Flight
    until_s : float
        Since the flight's start; observations by their nominal epochs.
    after_s : float
    base_s : float
        How much later the base's epoch may be tagged.
    """
    observations, base = flight.observations, flight.base
    if observations is not None:
        observations = _observations_until(observations, until_s, after_s)
    if base is not None:
        ground = _observations_until(base.observations, until_s + base_s, after_s + base_s)
        base = None if ground is None else replace(base, observations=ground)
    records = {
        name: one if name == "truth" else one[(one.t_s <= until_s) & (one.t_s > after_s)]
        for name, one in flight.records.items()
    }
    kept = {name: one for name, one in records.items() if len(one.t_s)}
    return replace(flight, observations=observations, base=base).with_records(kept)


def _observations_until(
    observations: Observations, until_s: float, after_s: float
) -> Observations | None:
    rows = (observations.t_s <= until_s) & (observations.t_s > after_s)
    if not rows.any():
        return None
    parts = {name: getattr(observations, name)[rows] for name in BY_EPOCH}
    tracked: BoolArray = np.zeros(len(observations.satellites), dtype=np.bool_)
    for name in ("code_m", "phase_cycles", "doppler_hz"):
        tracked |= np.isfinite(parts[name]).any(axis=(0, 1))
    channels = np.flatnonzero(tracked)
    return replace(
        observations,
        satellites=tuple(observations.satellites[j] for j in channels),
        signals=tuple(observations.signals[j] for j in channels),
        **(parts | {name: parts[name][:, :, channels] for name in BY_CHANNEL}),
    )
