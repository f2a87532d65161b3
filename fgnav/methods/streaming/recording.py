"""A recording that grows: pieces of a flight, one after another, as one flight."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.frontend.causal.truncation import BY_CHANNEL, BY_EPOCH, SAMPLED, truncated
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

_SAME_S = 1e-3  # epochs of vehicle and base this close are one


def epochs_s(flight: Flight) -> FloatArray:
    """Return the epochs of raw observations, or else of fixes, (n,)."""
    gnss = flight.observations or flight.fixes
    return np.empty(0) if gnss is None else gnss.t_s


def pieces(flight: Flight) -> Iterator[Flight]:
    """Yield a flight epoch by epoch: each with what came since the one before.

    What comes after the last epoch is a piece of its own.
    """
    before_s = -np.inf
    for epoch_s in (*epochs_s(flight).tolist(), np.inf):
        yield truncated(flight, epoch_s, after_s=before_s, base_s=_SAME_S)
        before_s = epoch_s


def joined(record: Flight, piece: Flight) -> Flight:
    """Return a flight with what came since.

    Raises
    ------
    BadInputError
        If a record does not go on where it ended.
    """
    changed: dict[str, Any] = {}
    for name, sampled in SAMPLED.items():
        before, after = getattr(record, name), getattr(piece, name)
        if after is None:
            continue
        if before is None:
            changed[name] = after
            continue
        _follows(name, before.t_s, after.t_s)
        parts = {n: (getattr(before, n), getattr(after, n)) for n in sampled}
        values = {n: np.concatenate(v) for n, v in parts.items() if v[0] is not None}
        changed[name] = replace(before, **values)
    if piece.observations is not None:
        changed["observations"] = _observed(record.observations, piece.observations)
    if piece.base is not None:
        before = None if record.base is None else record.base.observations
        ground = _observed(before, piece.base.observations)
        changed["base"] = replace(piece.base, observations=ground)
    return replace(record, **changed)


def _follows(name: str, before_s: FloatArray, after_s: FloatArray) -> None:
    if not after_s[0] > before_s[-1]:
        raise BadInputError(
            f"stream {name} t_s: must come after {before_s[-1]:.9g}, got {after_s[0]:.9g}"
        )


def _observed(before: Observations | None, after: Observations) -> Observations:
    """Return observations one after the other; channels that are new come last."""
    if before is None:
        return after
    _follows("observations", before.t_s, after.t_s)
    channels = dict.fromkeys((*channels_of(before), *channels_of(after)))
    place = {channel: j for j, channel in enumerate(channels)}
    values: dict[str, Any] = {}
    for name in BY_EPOCH:
        parts = [getattr(one, name) for one in (before, after)]
        if name in BY_CHANNEL:
            parts = [
                _spread(part, [place[channel] for channel in channels_of(of)], len(place))
                for part, of in zip(parts, (before, after), strict=True)
            ]
        values[name] = np.concatenate(parts)
    return replace(
        before,
        satellites=tuple(satellite for satellite, _ in channels),
        signals=tuple(signal for _, signal in channels),
        **values,
    )


def channels_of(observations: Observations) -> list[tuple[str, str]]:
    """Return satellite and signal of each channel."""
    return list(zip(observations.satellites, observations.signals, strict=True))


def _spread(values: np.ndarray, columns: list[int], m: int) -> np.ndarray:
    """Return values of some channels among all m; NaN, or no flag, of the others."""
    nothing = 0 if values.dtype.kind == "u" else np.nan
    out = np.full((*values.shape[:2], m), nothing, dtype=values.dtype)
    out[:, :, columns] = values
    return out
