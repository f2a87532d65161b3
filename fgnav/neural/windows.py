"""Windows of samples that end at keyframes, and what keeps a network from answering them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.neural.manifest import Input
from fgnav.neural.records import Record

_LATE = 1.5  # sample intervals: a sample lasts one, and times of two clocks' ticks vary
_SAME_S = 1e-6  # times of files are written to the microsecond


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Windows:
    """Inputs of a network at k times."""

    # (k, window, channels) each; in the manifest's units, not yet normalised; of rows that are not
    # usable anything
    inputs: tuple[FloatArray, ...]
    usable: BoolArray  # (k,)
    # (k,); why others are not: each row under the first reason that holds
    lost: dict[str, BoolArray]


def windows(inputs: Sequence[Input], records: Sequence[Record], t_s: FloatArray) -> Windows:
    """Return the newest samples by times, (k,), none later: what is known by then.

    Parameters
    ----------
    inputs : sequence of Input
    records : sequence of Record
        Of each input.
    t_s : ndarray, shape (k,)
    """
    usable, lost, samples = np.ones(len(t_s), dtype=np.bool_), {}, []
    for spec, record in zip(inputs, records, strict=True):
        last = np.searchsorted(record.t_s, t_s + _SAME_S, side="right") - 1
        rows = last[:, None] + np.arange(1 - spec.window, 1)
        complete = rows[:, 0] >= 0
        rows = rows.clip(0)
        values = record.values[rows] if len(record.t_s) else _none(len(t_s), spec, record)
        samples.append(values)
        complete &= _covered(spec, record, t_s, rows)
        reasons = {
            f"{spec.sensor} has no window of {spec.window} samples at {spec.rate_hz:g} Hz": complete
        }
        inside = spec.inside(values)
        for c in np.flatnonzero(~inside.all(axis=0)):
            low, high = spec.range[c]
            what = f"{spec.sensor} channel {c} outside {low:.4g} to {high:.4g} {spec.unit}"
            reasons[f"{what}, the network's training domain"] = inside[:, c]
        for reason, well in reasons.items():
            lost[reason] = usable & ~well
            usable = usable & well
    return Windows(inputs=tuple(samples), usable=usable, lost=lost)


def _covered(spec: Input, record: Record, t_s: FloatArray, rows: np.ndarray) -> BoolArray:
    """Return True where windows lack no sample and end at their times, (k,)."""
    if not len(record.t_s):
        return np.zeros(len(t_s), dtype=np.bool_)
    step_s = 1 / spec.rate_hz
    fresh = t_s - record.t_s[rows[:, -1]] < _LATE * step_s
    gaps = np.concatenate([[0], np.cumsum(np.diff(record.t_s) > _LATE * step_s)])
    return np.asarray(fresh & (gaps[rows[:, -1]] == gaps[rows[:, 0]]))


def _none(k: int, spec: Input, record: Record) -> FloatArray:
    return np.zeros((k, spec.window, record.values.shape[1] or len(spec.range)))
