"""Where normalised innovations leave the chi-square band that their number leaves them."""

import numpy as np
from scipy.special import chdtri

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.graph.correlation import SHOWN_BY, correlated
from fgnav.types.estimate import Contradiction

_FALSE_ALARM = 1e-4  # of a sensor of a right flight, by each of the two tests
# As of stated noise (docs/model.md): a standard deviation off by less leaves squared errors of 3
# below 6.8.
TOLERATED = 1.5**2
# Of a second: right noise is not the same all along. A faint beacon, multipath and a UAV's receiver
# reached 3.6, 2.6 and 6; frozen fixes, stuck units and spikes 11 and more.
_TOLERATED_AT_ONCE = 3.0**2
_BLOCK_S, _BLOCK = 1.0, 5  # s and samples of a block at least: few samples have wide bands
_ROUNDING = 1e-6  # of times
_THROUGHOUT = 0.5  # share of blocks


def contradictions(
    t_s: FloatArray, squared: FloatArray, freedom: IntArray
) -> tuple[Contradiction, ...]:
    """Return spans in which one sensor's innovations are larger than its noise can make them.

    All of them are tested against the band of their effective number [1]_, and blocks of a second
    each against their own. Where the rest is out of its band without these, too, all of them are.

    Parameters
    ----------
    t_s : ndarray, shape (k,)
        Increasing.
    squared : ndarray, shape (k,)
        Normalised innovations squared.
    freedom : ndarray of int, shape (k,)

    References
    ----------
    .. [1] Bar-Shalom, Li, Kirubarajan: Estimation with Applications to Tracking and Navigation,
       2001, section 5.4.2: consistency by time averages; the number of samples is that of
       independent ones (``correlated``).
    """
    k, total = len(t_s), int(freedom.sum())
    if total == 0:
        return ()
    nis, out = float(squared.sum()) / total, _out_of_band(squared, freedom)
    step_s = max(float(np.median(np.diff(t_s))) if k > 1 else 1.0, 1e-9)
    begins = np.arange(0, k, max(_BLOCK, round(_BLOCK_S / step_s)))
    own, sums = np.add.reduceat(freedom, begins), np.add.reduceat(squared, begins)
    limits = _limit(own.clip(1).astype(np.float64), _FALSE_ALARM / len(begins), _TOLERATED_AT_ONCE)
    flagged = sums > limits * own.clip(1)
    others = ~np.repeat(flagged, np.diff(np.append(begins, k)))
    if out and (flagged.mean() >= _THROUGHOUT or _out_of_band(squared[others], freedom[others])):
        return (throughout(t_s, total, nis),)
    return tuple(_spans(t_s, (sums, own), begins, flagged))


def _out_of_band(squared: FloatArray, freedom: IntArray) -> bool:
    nis = float(squared.sum()) / max(int(freedom.sum()), 1)
    return nis > max(TOLERATED, limit_of(squared, freedom))


def beyond_s(
    t_s: FloatArray,
    squared: FloatArray,
    freedom: IntArray,
    until_s: float,
    since_s: float = -np.inf,
) -> tuple[float, ...]:
    """Return the whole seconds at which the record so far contradicts what it states.

    Each, from ``since_s`` to ``until_s``, is tested by what was measured before it. Test j has the
    share 1 / (j (j + 1)) of the false alarm. Parameters as in ``contradictions``.
    """
    if not len(t_s):
        return ()
    # Of the flight's time: which sample is the first to test anything may be a matter of rounding.
    seconds = np.floor(np.append(t_s, until_s) / _BLOCK_S + _ROUNDING)
    ends = np.flatnonzero(np.diff(seconds) > 0)
    ends = ends[ends >= _BLOCK - 1]
    at_s = (seconds[ends] + 1) * _BLOCK_S
    suspicious = np.cumsum(squared)[ends] > TOLERATED * np.cumsum(freedom)[ends]
    times_s = []
    for j in np.flatnonzero(suspicious & (at_s >= since_s)):
        so_far = slice(0, ends[j] + 1)
        false_alarm = _FALSE_ALARM / ((j + 1) * (j + 2))
        total = int(freedom[so_far].sum())
        if squared[so_far].sum() > total * limit_of(squared[so_far], freedom[so_far], false_alarm):
            times_s.append(float(at_s[j]))
    return tuple(times_s)


def limit_of(squared: FloatArray, freedom: IntArray, false_alarm: float = _FALSE_ALARM) -> float:
    """Return the largest NIS of innovations, (k,), that noise explains, correlated as they are.

    All of them are worth one where they are too few for any correlation to show.
    """
    total = int(freedom.sum())
    if total == 0:
        return float("inf")
    apart = (squared - freedom) / np.sqrt(2 * freedom.clip(1))
    longer = correlated((apart - apart.mean())[:, None]) if len(apart) > SHOWN_BY else len(apart)
    effective = max(total / longer, 1.0)
    return float(_limit(effective, false_alarm, 0.0))


def limit_of_one(freedom: int) -> float:
    """Return the largest NIS of one innovation that noise explains."""
    return float(_limit(freedom, _FALSE_ALARM, 0.0))


def contradiction_of_one(
    t_s: FloatArray, squared: float, freedom: int
) -> tuple[Contradiction, ...]:
    """Return whether one innovation of a whole flight, of times (n,), is out of its band."""
    nis = squared / freedom
    if nis <= max(TOLERATED, limit_of_one(freedom)):
        return ()
    return (throughout(t_s, freedom, nis),)


def throughout(t_s: FloatArray, freedom: int, nis: float) -> Contradiction:
    """Return a contradiction of all of a record, of times (n,)."""
    begin_s, end_s = float(t_s[0]), float(t_s[-1])
    return Contradiction(from_s=begin_s, until_s=end_s, freedom=freedom, nis=nis, throughout=True)


def _limit(freedom: FloatArray | float, false_alarm: float, tolerated: float) -> FloatArray:
    """Return the largest mean square that is no contradiction."""
    return np.asarray(np.maximum(tolerated, chdtri(freedom, false_alarm) / freedom))


def _spans(
    t_s: FloatArray, sums: tuple[FloatArray, IntArray], begins: IntArray, flagged: BoolArray
) -> list[Contradiction]:
    """Return runs of flagged blocks."""
    edges = np.diff(np.concatenate([[False], flagged, [False]]).astype(np.int8))
    last = np.append(begins[1:], len(t_s)) - 1
    return [
        Contradiction(
            from_s=float(t_s[begins[a]]),
            until_s=float(t_s[last[b - 1]]),
            freedom=int(sums[1][a:b].sum()),
            nis=float(sums[0][a:b].sum() / sums[1][a:b].sum()),
            throughout=False,
        )
        for a, b in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    ]
