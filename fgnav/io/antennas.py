"""Several receivers' observations on one set of epochs and channels."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray, Unused
from fgnav.io.gps_time import TICKS_PER_S, to_ticks
from fgnav.types.observations import Observations

_GRID_S = 1e-3  # nominal intervals are whole milliseconds
_TOLERANCE = 0.25  # of the interval
_VALUES = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz")
_LARGEST_TOLERANCE_S = 0.02  # a receiver whose clock errs by more is not comparable anyway


def interval_s(t_s: FloatArray) -> float:
    """Return the usual time between epochs, 1 s where there is only one."""
    return float(np.median(np.diff(t_s))) if len(t_s) > 1 else 1.0


def tolerance_s(t_s: FloatArray) -> float:
    """Return the largest difference of two receivers' timestamps of an epoch."""
    return min(_TOLERANCE * interval_s(t_s), _LARGEST_TOLERANCE_S)


def nominal_epochs(tag_s: FloatArray, start_gps_s: float) -> FloatArray:
    """Return the epochs a receiver aimed at, (n,): timestamps on the grid of their interval.

    The grid is that of GPS time, of 1 s at most; timestamps that keep none of whole milliseconds
    stay as they are.
    """
    step_s = min(max(round(interval_s(tag_s) / _GRID_S), 1) * _GRID_S, 1.0)
    step = round(step_s * TICKS_PER_S)
    start = to_ticks(start_gps_s)
    ticks = start + np.round(tag_s * TICKS_PER_S).astype(np.int64)
    nominal_s = ((ticks + step // 2) // step * step - start) / TICKS_PER_S
    on_grid = (np.abs(nominal_s - tag_s) <= tolerance_s(tag_s)).all()
    return nominal_s if on_grid and (np.diff(nominal_s) > 0).all() else tag_s


def merge(per_antenna: Sequence[Observations], names: Sequence[str]) -> Observations:
    """Merge observations of one antenna each; the first is the reference and gives the epochs.

    They have the union of channels. An antenna without an epoch has gaps there, and the epoch
    itself as its timestamp. Epochs that the reference lacks are counted.
    """
    if not per_antenna:
        raise BadInputError("antennas: at least one is needed")
    if len(per_antenna) == 1:
        only = per_antenna[0]
        return replace(only, unused=_named(only.unused, names[0]))
    t_s = per_antenna[0].t_s
    pairs = [list(zip(some.satellites, some.signals, strict=True)) for some in per_antenna]
    channels = sorted({pair for some in pairs for pair in some})
    shape = (len(t_s), len(per_antenna), len(channels))
    arrays: dict[str, Any] = {name: np.full(shape, np.nan) for name in _VALUES}
    arrays["lock_flags"] = np.zeros(shape, np.uint8)
    tag_s = np.repeat(t_s[:, None], len(per_antenna), axis=1)
    unused: list[Unused] = []
    for a, (receiver, name) in enumerate(zip(per_antenna, names, strict=True)):
        rows, common = _matched(t_s, receiver.t_s)
        if not len(rows):
            raise BadInputError(f"antenna {name}: shares no epoch with antenna {names[0]}")
        columns = np.array([channels.index(pair) for pair in pairs[a]], int)
        for field, array in arrays.items():
            array[np.ix_(common, np.array([a]), columns)] = getattr(receiver, field)[rows]
        tag_s[common, a] = receiver.tag_s[rows, 0]
        unused += _named(receiver.unused, name)
        if len(rows) < len(receiver.t_s):
            reason = f"the reference antenna {names[0]} has no such epoch"
            unused.append(
                Unused(what=f"{name} epoch", reason=reason, count=len(receiver.t_s) - len(rows))
            )
    return Observations(
        t_s=t_s,
        tag_s=tag_s,
        satellites=tuple(satellite for satellite, _ in channels),
        signals=tuple(signal for _, signal in channels),
        unused=tuple(unused),
        **arrays,
    )


def _matched(reference_s: FloatArray, t_s: FloatArray) -> tuple[IntArray, IntArray]:
    """Return rows of ``t_s`` and the rows of ``reference_s`` they match, nearest in tolerance."""
    after = np.searchsorted(reference_s, t_s).clip(1, max(len(reference_s) - 1, 1))
    before = after - 1
    after = after.clip(max=len(reference_s) - 1)
    nearer = np.abs(reference_s[after] - t_s) < np.abs(reference_s[before] - t_s)
    nearest = np.where(nearer, after, before)
    mine = np.flatnonzero(np.abs(reference_s[nearest] - t_s) <= tolerance_s(reference_s))
    # Two epochs of one receiver within the tolerance of one of the reference: the first counts.
    _, first = np.unique(nearest[mine], return_index=True)
    return mine[first], nearest[mine[first]]


def _named(unused: tuple[Unused, ...], name: str) -> tuple[Unused, ...]:
    return tuple(replace(loss, what=f"{name} {loss.what}") for loss in unused)
