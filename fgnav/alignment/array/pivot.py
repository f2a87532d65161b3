"""Replace the reference antenna by another one where it tracks nothing.

Differences and code hang on the first antenna. While it is gone, another one can be the first: the
flight with its antennas in another order is a flight like any other.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.alignment.gaps import gap_notes, spans
from fgnav.checks import IntArray, Unused, unused_of
from fgnav.messages import Note
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

_SATELLITES = 4  # of a position
_AGAINST = "not tracked by the reference antenna"


class View(NamedTuple):
    """A flight by one reference antenna."""

    flight: Flight  # its first antenna is the reference
    rows: IntArray  # (k,): its epochs among those of the whole flight


def pivot_views(flight: Flight, *, causal: bool = False) -> tuple[View, ...]:
    """Return a flight with raw observations by its reference, then where others stand in for it.

    The first view has all epochs, and the flight's own reference unless that one never tracks four
    satellites. Each other has the epochs at which no reference before it tracks four and its own
    does. Next comes the antenna with most such epochs; causal, whichever is next in the flight.
    """
    observations = flight.observations
    if observations is None:
        return (View(flight=flight, rows=np.empty(0, dtype=np.int64)),)
    enough = np.isfinite(observations.code_m).sum(axis=2) >= _SATELLITES  # (n, a)
    everything = np.arange(len(observations.t_s))
    tracked = enough.any(axis=0) if causal else enough.sum(axis=0)
    first = 0 if enough[:, :1].any() or not enough.any() else int(tracked.argmax())
    by_first = flight if first == 0 else _with_reference(flight, observations, first, everything)
    views = [View(flight=by_first, rows=everything)]
    missing = ~enough[:, first] if enough.size else np.zeros(0, dtype=np.bool_)
    while (enough & missing[:, None]).any():
        remaining = (enough & missing[:, None]).sum(axis=0)
        best = int((remaining > 0).argmax() if causal else remaining.argmax())
        rows = np.flatnonzero(missing & enough[:, best])
        views.append(View(flight=_with_reference(flight, observations, best, rows), rows=rows))
        missing[rows] = False
    return tuple(views)


def pivot_unused(views: tuple[View, ...], unused: tuple[Unused, ...]) -> tuple[Unused, ...]:
    """Return the unused of all views, added up, less what one loses and another makes up for."""
    flight, observations = views[0].flight, views[0].flight.observations
    counts: Counter[tuple[str, str]] = Counter()
    for loss in unused:
        counts[loss.what, loss.reason] += loss.count
    for view in views[1:]:
        if observations is None:
            break
        tracked = np.isfinite(observations.code_m[view.rows])
        used = (tracked & ~tracked[:, :1]).sum(axis=(0, 2))
        for antenna, count in zip(flight.antennas, used, strict=True):
            counts[f"{antenna.name} link", _AGAINST] -= int(count)
    return unused_of(counts)


def pivot_notes(views: tuple[View, ...]) -> Iterator[Note]:
    """Yield a message on each span in which the reference antenna is gone."""
    flight = views[0].flight
    if flight.observations is None or len(views) == 1:
        return
    gone = np.zeros(len(flight.observations.t_s), dtype=np.bool_)
    for view in views[1:]:
        gone[view.rows] = True
    names = " and ".join(view.flight.antennas[0].name for view in views[1:])
    what = f"observations of the reference antenna {flight.antennas[0].name}"
    gone_s = spans(flight.observations.t_s, gone)
    yield from gap_notes(what, gone_s, "W103", instead=names)


def _with_reference(
    flight: Flight, observations: Observations, reference: int, rows: IntArray
) -> Flight:
    """Select epochs of a flight and make an antenna the first one."""
    order = [reference, *(k for k in range(len(flight.antennas)) if k != reference)]
    selected = replace(observations[rows].of_antennas(np.array(order)), unused=())
    antennas = tuple(flight.antennas[k] for k in order)
    return replace(flight, antennas=antennas, observations=selected, unused=())
