"""A part of a recording: what was measured between two times of a flight."""

from dataclasses import replace

import numpy as np

from fgnav.assembly.truncation import truncated
from fgnav.checks import BadInputError, FloatArray
from fgnav.types.flight import Flight


def within(flight: Flight, from_s: float | None, until_s: float | None) -> Flight:
    """Return a flight as if it had been recorded from one time until another, both included.

    Times keep their zero. The truth keeps a sample on either side, to be interpolated at the ends;
    what is known of the attitude at the flight's start goes where the start does.

    Parameters
    ----------
    from_s, until_s : float or None
        Seconds of the flight; None for its start or end.

    Raises
    ------
    BadInputError
        If the times are in the wrong order, or nothing was measured between them.
    """
    if from_s is None and until_s is None:
        return flight
    low = -np.inf if from_s is None else from_s
    high = np.inf if until_s is None else until_s
    if not low < high:
        raise BadInputError(f"--from {low:g} --until {high:g}: the first must be the earlier")
    cut = truncated(flight, high, after_s=float(np.nextafter(low, -np.inf)))
    if cut.observations is None and not cut.records.keys() - {"truth"}:
        raise BadInputError(
            f"--from {low:g} --until {high:g}: flight {flight.name!r} measured nothing then"
        )
    if flight.truth is not None:
        truth = flight.truth[_around(flight.truth.t_s, low, high)]
        cut = replace(cut, truth=truth if len(truth.t_s) else None)
    return replace(cut, initial=None) if low > _first_s(flight) else cut


def _around(t_s: FloatArray, low: float, high: float) -> slice:
    """Return the samples between two times, and one on either side."""
    first = max(int(np.searchsorted(t_s, low, side="right")) - 1, 0)
    return slice(first, int(np.searchsorted(t_s, high)) + 1)


def _first_s(flight: Flight) -> float:
    """Return when the first measurement was made."""
    records = {**flight.records, "gnss": flight.observations, "truth": None}
    times = (record.t_s for record in records.values() if record is not None and len(record.t_s))
    return min((float(t_s[0]) for t_s in times), default=0.0)
