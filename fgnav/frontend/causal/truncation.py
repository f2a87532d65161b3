"""A flight cut at a time: what a filter has by then, and the test of whether it looks ahead.

A causal estimate of a time does not change when the flight is cut there: that is the
definition.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from fgnav.checks import BoolArray
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

SAMPLED = {
    "imu": ("t_s", "f_b_mps2", "w_b_radps"),
    "fixes": ("t_s", "p_n_m", "v_n_mps", "position_sigma_m", "velocity_sigma_mps"),
    "seeker": ("t_s", "currents"),
    "barometer": ("t_s", "height_m"),
    "magnetometer": ("t_s", "field_b_ut"),
}
BY_EPOCH = ("t_s", "tag_s", "code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")
BY_CHANNEL = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")


def truncated(
    flight: Flight, until_s: float, *, after_s: float = -np.inf, base_s: float = 0.0
) -> Flight:
    """Return a flight with all records cut: samples at ``until_s`` or before remain.

    With ``after_s`` those after it alone: what came since. Channels of satellites that are first
    tracked later are gone, as if they had never been. A record without samples left is None.
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
    cut = {
        name: _until(getattr(flight, name), names, until_s, after_s)
        for name, names in SAMPLED.items()
    }
    return replace(flight, observations=observations, base=base, **cut)


def _until(record: Any, sampled: tuple[str, ...], until_s: float, after_s: float) -> Any:  # noqa: ANN401  # any record
    """Return a record's samples until a time; None without any."""
    rows = None if record is None else (record.t_s <= until_s) & (record.t_s > after_s)
    if rows is None or not rows.any():
        return None
    values = {name: getattr(record, name) for name in sampled}
    return replace(record, **{n: v[rows] for n, v in values.items() if v is not None})


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
