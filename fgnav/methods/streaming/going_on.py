"""A flight without its beginning: what later keyframes need of it, summed up, and the last of it.

In motion alignment looks back for half a minute, positions are bridged for as long, fixes are held
against those of seconds before; all else of the past is a few numbers (``Earlier``). So a stream
keeps ``KEPT_S`` of records, and what it asks of them costs the same however long it has run.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fgnav.alignment.in_motion.windows import WINDOW_S
from fgnav.assembly.prepared import Earlier, PreparedFlight
from fgnav.assembly.truncation import truncated
from fgnav.gnss.signals import band, select
from fgnav.gnss.single_point.model import code_channels
from fgnav.gnss.single_point.solution import code_solution
from fgnav.types.flight import Flight
from fgnav.types.observations import EarlierEpochs, Observations

KEPT_S = WINDOW_S + 4.0  # and the span of four seconds between fixes that a window begins with
_LEAST_S = 1.0  # less is not worth the copying
_FIRST = 2  # samples of instruments
_MARGIN_S = 0.5  # of inertial samples before the first epoch that is kept


class GoingOn(NamedTuple):
    """The last of a flight, and what is needed of its beginning; None where that is kept, too."""

    flight: Flight
    earlier: Earlier | None = None


def going_on(flight: Flight, prepared: PreparedFlight) -> GoingOn | None:
    """Return a flight without its beginning; None as long as that still decides anything.

    Parameters
    ----------
    flight : Flight
    prepared : PreparedFlight
        Its problem.
    """
    earlier, imu, opening = prepared.goes_on, flight.imu, prepared.opening
    if earlier is None or imu is None:
        return None
    from_s = _solved_s(flight) - KEPT_S
    known_s = -np.inf if opening is None else opening.until_s
    if from_s - _MARGIN_S < max(known_s, earlier.motion.first_s, float(imu.t_s[0])) + _LEAST_S:
        return None
    observations = flight.observations
    kept = truncated(flight, np.inf, after_s=from_s)
    samples = truncated(flight, np.inf, after_s=from_s - _MARGIN_S).imu
    kept = replace(kept, imu=samples, **_surroundings(flight, from_s))
    if observations is not None:
        kept = replace(kept, observations=_without_beginning(observations, from_s))
    rotation = earlier.motion.windows.rotation
    first = int(np.searchsorted(imu.t_s, from_s - _MARGIN_S, side="right"))
    motion = earlier.motion.after(from_s, rotation.R_ub[first])
    return GoingOn(kept, earlier._replace(motion=motion))


def _surroundings(flight: Flight, from_s: float) -> dict[str, Any]:
    """Return records of barometer and magnetometer after a time, and how they began.

    Their first samples are kept for their start and interval.
    """
    kept: dict[str, Any] = {}
    for name in ("barometer", "magnetometer"):
        record = getattr(flight, name)
        if record is not None:
            rows = (record.t_s > from_s) | (np.arange(len(record.t_s)) < _FIRST)
            kept[name] = record[rows]
    return kept


def _solved_s(flight: Flight) -> float:
    """Return the last epoch with a position."""
    if flight.observations is not None:
        return float(code_solution(flight, causal=True).t_s[-1])
    return float(flight.fixes[0].t_s[-1]) if flight.fixes else -np.inf


def _without_beginning(observations: Observations, from_s: float) -> Observations:
    """Return the epochs after a time, and what those before have decided."""
    channels = code_channels(observations, 0, causal=True)
    named = zip(channels.satellites, channels.signals, strict=True)
    chosen = select(observations, causal=True).chosen
    gone = observations.t_s[observations.t_s <= from_s]
    before = observations.earlier
    earlier = EarlierEpochs(
        t_s=gone if before is None else np.append(before.t_s, gone),
        bands={satellite[0]: band(satellite, signal) for satellite, signal in named},
        signals={key: signals for key, signals in chosen.items() if all(signals)},
    )
    return replace(observations[observations.t_s > from_s], earlier=earlier)
