"""A part of a recording: what was measured between two times of a flight."""

from dataclasses import replace
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray
from fgnav.types.flight import SENSORS, Flight, Truth


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
    parts: dict[str, Any] = {}
    for name in SENSORS:
        record = getattr(flight, name)
        if record is not None:
            parts[name] = _rows(record, _between(record.t_s, low, high))
    if flight.observations is not None:
        observations = flight.observations
        parts["observations"] = observations[_between(observations.t_s, low, high)]
    if not any(len(part.t_s) for part in parts.values()):
        raise BadInputError(
            f"--from {low:g} --until {high:g}: flight {flight.name!r} measured nothing then"
        )
    if flight.base is not None:
        observations = flight.base.observations
        observations = observations[_between(observations.t_s, low, high)]
        parts["base"] = replace(flight.base, observations=observations)
    if flight.truth is not None:
        parts["truth"] = _truth(flight.truth, low, high)
    if flight.initial is not None and low > _first_s(flight):
        parts["initial"] = None
    empty = {name: None for name in SENSORS if name in parts and not len(parts[name].t_s)}
    return replace(flight, **(parts | empty))


def _between(t_s: FloatArray, low: float, high: float) -> BoolArray:
    return np.asarray((t_s >= low) & (t_s <= high))


def _rows(record: Any, keep: BoolArray) -> Any:  # noqa: ANN401  # any record with a row per sample
    """Return a record with some of its samples."""
    names = [
        name
        for name in record.__dataclass_fields__
        if isinstance(getattr(record, name), np.ndarray)
        and name not in ("calibration", "landmark_n_m", "position_b_m", "field_n_ut")
    ]
    rows: dict[str, Any] = {name: getattr(record, name)[keep] for name in names}
    return replace(record, **rows)


def _truth(truth: Truth, low: float, high: float) -> Truth:
    first = max(int(np.searchsorted(truth.t_s, low, side="right")) - 1, 0)
    last = int(np.searchsorted(truth.t_s, high)) + 1
    rows: dict[str, Any] = {
        name: getattr(truth, name)[first:last] for name in ("t_s", "p_n_m", "v_n_mps", "R_nb")
    }
    return replace(truth, **rows)


def _first_s(flight: Flight) -> float:
    """Return when the first measurement was made."""
    records = [flight.observations, *(getattr(flight, name) for name in SENSORS)]
    return min(
        (float(one.t_s[0]) for one in records if one is not None and len(one.t_s)), default=0.0
    )
