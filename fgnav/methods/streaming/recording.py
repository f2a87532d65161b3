"""A recording that grows: pieces of a flight, one after another, as one flight."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from fgnav.assembly.truncation import BY_CHANNEL, truncated
from fgnav.checks import BadInputError, FloatArray
from fgnav.types.flight import Flight
from fgnav.types.instruments import Samples
from fgnav.types.instruments import joined as concatenate_samples
from fgnav.types.observations import BY_EPOCH, Observations

_SAME_S = 1e-3  # epochs of vehicle and base this close are one


def epochs_s(flight: Flight) -> FloatArray:
    """Return the epochs of raw observations, or else of fixes, (n,)."""
    if flight.observations is not None:
        return flight.observations.t_s
    times = [fix.t_s for fix in flight.fixes]
    return np.unique(np.concatenate([np.empty(0), *times]))


def pieces(flight: Flight) -> Iterator[Flight]:
    """Yield a flight epoch by epoch: each with what came since the one before.

    What comes after the last epoch is a piece of its own.
    """
    before_s = -np.inf
    for epoch_s in (*epochs_s(flight).tolist(), np.inf):
        yield truncated(flight, epoch_s, after_s=before_s, base_s=_SAME_S)
        before_s = epoch_s


def concatenate_flights(*parts: Flight) -> Flight:
    """Return pieces of a flight, in their order, as one.

    All but records is of the first; orbits are those of the last that has any.

    Raises
    ------
    BadInputError
        If a record does not go on where it ended.
    """
    records: dict[str, Samples] = {}
    for name in dict.fromkeys(name for flight in parts for name in flight.records):
        of = [flight.records[name] for flight in parts if name in flight.records]
        filled = [record for record in of if len(record.t_s)] or of[:1]
        records[name] = of[0]
        if name != "truth":
            _follow(name, filled)
            records[name] = concatenate_samples(filled)
    changed: dict[str, Any] = {}
    for name in ("broadcast", "precise"):
        orbits = [record for flight in parts if (record := getattr(flight, name)) is not None]
        changed[name] = orbits[-1] if orbits else None
    changed["observations"] = _observed([flight.observations for flight in parts])
    bases = [flight.base for flight in parts if flight.base is not None]
    if bases:
        ground = _observed([base.observations for base in bases])
        changed["base"] = None if ground is None else replace(bases[0], observations=ground)
    return replace(parts[0], **changed).with_records(records)


def _follow(name: str, records: Sequence[Any]) -> None:
    for before, after in pairwise(records):
        if not after.t_s[0] > before.t_s[-1]:
            raise BadInputError(
                f"stream {name} t_s: must come after {before.t_s[-1]:.9g}, got {after.t_s[0]:.9g}"
            )


def _observed(parts: Sequence[Observations | None]) -> Observations | None:
    """Return observations one after the other; channels that are new come last."""
    records = [part for part in parts if part is not None]
    if len(records) < 2:
        return records[0] if records else None
    _follow("observations", records)
    channels = dict.fromkeys(channel for record in records for channel in channels_of(record))
    column_of = {channel: j for j, channel in enumerate(channels)}
    columns = [[column_of[channel] for channel in channels_of(record)] for record in records]
    values: dict[str, Any] = {}
    for name in BY_EPOCH:
        of = [getattr(record, name) for record in records]
        if name in BY_CHANNEL:
            of = [_spread(v, c, len(column_of)) for v, c in zip(of, columns, strict=True)]
        values[name] = np.concatenate(of)
    return replace(
        records[0],
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
