"""Inertial samples that no motion makes: axes stuck, held, or one apart from both neighbours."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import interp1d

from fgnav.checks import BoolArray, FloatArray, Unused
from fgnav.integrity.imu_recording import SENSORS, between_fresh, is_repeated
from fgnav.types.flight import Imu

_NORMAL = 1.4826  # sigma of normal noise over its median size
# Of normal noise one of 1e88; of a vibrating unit, whose tails are long, none of its neighbours is
# that near (Hampel's identifier with its window of three: Pearson, Outliers in process modeling
# and identification, IEEE Trans. Control Systems Technology 10, 2002).
_SIGMAS = 20.0
_NEIGHBOURS = 6.0  # sigmas by which neighbours of a spike may differ
_NEAR = 25  # samples on either side: a median of 51 tells sigma to 16 %, half may be spikes
_MINIMUM = 100
_AXES = "xyz"
_FALSE_ALARM = 1e-4  # of each test on a right record
STUCK = "all axes repeat the sample before, more often than by chance: left out"


def screen_imu(imu: Imu) -> tuple[Imu, tuple[Unused, ...]]:
    """Return a record without samples of a stuck unit, and without spikes, and their numbers."""
    imu, repeated = without_repeated(imu)
    x = _of_all_axes(imu)
    is_constant = (np.diff(x, axis=0) == 0).all()  # all else contradicts it
    is_tested = len(x) >= _MINIMUM and not is_constant
    stuck = stuck_samples(x) if is_tested else np.zeros(len(x), dtype=np.bool_)
    moving, of_all = _without(imu, stuck, STUCK)
    moving, of_axes = without_stuck_axes(moving)
    corrected, of_spikes = without_spikes(moving)
    return corrected, (*repeated, *of_all, *of_axes, *of_spikes)


def _without(imu: Imu, faulty: BoolArray, reason: str) -> tuple[Imu, tuple[Unused, ...]]:
    """Return a record without some samples, (k,), and their number."""
    count = int(faulty.sum())
    if not count:
        return imu, ()
    return imu[~faulty], (Unused(what="inertial sample", reason=reason, count=count),)


def without_repeated(imu: Imu, *, causal: bool = False) -> tuple[Imu, tuple[Unused, ...]]:
    """Return a record without samples of a sensor that repeats all axes at even intervals.

    Cubics through what is not repeated stand in. Causal: nothing does, by samples up to each.
    """
    unused, kept = [], imu
    for name, field, _ in SENSORS:
        x = getattr(kept, field)
        if x is None:
            continue
        repeated = is_repeated(x, causal=causal)
        if repeated.any():
            what = "left out" if causal else "a cubic through the others stands in"
            reason = f"the {name} repeats the sample before at even intervals: {what}"
            unused.append(Unused(what="inertial sample", reason=reason, count=int(repeated.sum())))
            kept = kept[~repeated] if causal else between_fresh(kept, field, repeated)
    return kept, tuple(unused)


def without_stuck_axes(imu: Imu) -> tuple[Imu, tuple[Unused, ...]]:
    """Return a record without samples in which one axis stands still while the others move.

    At the end of its range, or broken: what it measures nobody knows whenever it has that value.
    A record of which hardly anything would be left is kept: all else contradicts it.
    """
    if len(imu.t_s) < _MINIMUM:
        return imu, ()
    stuck, unused = np.zeros(len(imu.t_s), dtype=np.bool_), list[Unused]()
    for name, field, _ in SENSORS:
        x = getattr(imu, field)
        for axis in range(0 if x is None else 3):
            in_run = np.zeros(len(x), dtype=np.bool_)
            run = stuck_axis(x, axis, in_run)
            while run is not None:
                in_run |= x[:, axis] == x[run[0], axis]
                run = stuck_axis(x, axis, in_run)
            reason = f"axis {_AXES[axis]} of the {name} stands still, the others do not: left out"
            unused += _without(imu, in_run, reason)[1]
            stuck |= in_run
    left_s, duration_s = imu.t_s[~stuck], float(np.ptp(imu.t_s))
    is_enough = len(left_s) > max(duration_s, 1.0) and float(np.ptp(left_s)) > duration_s / 2
    if unused and (len(left_s) >= _MINIMUM or is_enough):
        return imu[~stuck], tuple(unused)
    return imu, ()


def stuck_axis(x: FloatArray, axis: int, in_runs: BoolArray) -> tuple[int, int] | None:
    """Return first sample and number of the longest run of equal ones of one axis, or None.

    Rounding at rest repeats samples of all axes, so that the others show how often it does there.
    Of what is within their range, for at its ends any may stand.

    Parameters
    ----------
    x : ndarray, shape (k, 3)
    axis : int
    in_runs : ndarray of bool, shape (k,)
        Samples known to be of such runs.
    """
    same = np.diff(x, axis=0) == 0
    if same[:, axis].all():
        return None
    in_range = ((x > x.min(axis=0)) & (x < x.max(axis=0)))[1:]
    first, length = longest_run(same[:, axis] & ~in_runs[1:])
    inside = np.zeros(len(same), dtype=np.bool_)
    inside[first : first + length] = True
    rows = np.repeat(inside[:, None], 3, axis=1)  # of others those of the run, of this all else
    rows[:, axis] = ~(inside | in_runs[1:])
    rows &= in_range
    # One more repetition than was seen: a share of none is not known to be none.
    share = ((same & rows).sum(axis=0) + 1) / (rows.sum(axis=0) + 2)
    return (first, length) if is_unlikely(length, float(share.max()), len(x)) else None


def stuck_unit(imu: Imu) -> tuple[int, int] | None:
    """Return first sample and number of the longest run of equal ones of all axes, or None."""
    if len(imu.t_s) < _MINIMUM:
        return None
    x = _of_all_axes(imu)
    return None if (np.diff(x, axis=0) == 0).all() else stuck_run(x)


def stuck_samples(x: FloatArray) -> BoolArray:
    """Select samples, (k,), of improbable runs that repeat all axes."""
    stuck = np.zeros(len(x), dtype=np.bool_)
    run = stuck_run(x)
    while run is not None:
        rows = np.flatnonzero(~stuck)
        stuck[rows[run[0] + 1 : run[0] + run[1] + 1]] = True
        run = stuck_run(x[~stuck])
    return stuck


def stuck_run(x: FloatArray) -> tuple[int, int] | None:
    """Return first sample and number of the longest run of equal samples, (k, d), or None.

    One more repetition than was seen elsewhere: a share of none is not known to be none.
    """
    same = (np.diff(x, axis=0) == 0).all(axis=1)
    first, length = longest_run(same)
    others = np.delete(same, slice(first, first + length))
    share = float((others.sum() + 1) / (len(others) + 2))
    return (first, length) if is_unlikely(length, share, len(x)) else None


def _of_all_axes(imu: Imu) -> FloatArray:
    both = (imu.f_b_mps2, imu.w_b_radps)
    return np.hstack([x for x in both if x is not None])


def longest_run(same: BoolArray) -> tuple[int, int]:
    """Return first sample and number of the longest run of samples that equal the one before."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(np.int8), [0]])))
    starts, ends = edges[::2], edges[1::2]
    if not len(starts):
        return 0, 0
    k = int(np.argmax(ends - starts))
    return int(starts[k]), int(ends[k] - starts[k])


def is_unlikely(length: int, share: float, n: int) -> bool:
    """Return True if a run of repeats is improbable among n samples with that share of repeats.

    A run of that length begins at one of n places with probability ``n share**length``.
    """
    return length > 1 and n * share**length < _FALSE_ALARM


def screen_imu_causally(imu: Imu) -> tuple[Imu, tuple[Unused, ...]]:
    """Return a record without samples that, by those up to each, are of a stuck unit."""
    imu, unused = without_repeated(imu, causal=True)
    x = _of_all_axes(imu)
    same = np.append(False, (np.diff(x, axis=0) == 0).all(axis=1))
    k = np.arange(len(x))
    run = k - np.maximum.accumulate(np.where(same, 0, k))  # equal ones in a row, up to each
    share = (np.cumsum(same) - run + 1) / (k - run + 2)  # of those before the row
    stuck = (run > 1) & (run < k) & (k >= _MINIMUM) & (k * share**run < _FALSE_ALARM)
    moving, of_all = _without(imu, stuck, STUCK)
    return moving, (*unused, *of_all)


def without_spikes(imu: Imu) -> tuple[Imu, tuple[Unused, ...]]:
    """Return a record whose spikes are replaced by the means of their neighbours."""
    if len(imu.t_s) < _MINIMUM:
        return imu, ()
    force, of_force = _replaced(imu.f_b_mps2)
    rate, of_rate = (None, of_force[:0]) if imu.w_b_radps is None else _replaced(imu.w_b_radps)
    count = int(of_force.sum() + of_rate.sum())
    if not count:
        return imu, ()
    names = [n for n, s in (("accelerometer", of_force), ("gyroscope", of_rate)) if s.any()]
    reason = f"a spike of the {' and the '.join(names)}: the mean of its neighbours stands in"
    loss = Unused(what="inertial sample", reason=reason, count=count)
    return replace(imu, f_b_mps2=force, w_b_radps=rate), (loss,)


def _replaced(x: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return samples, (k, 3), without spikes of their axes, and which have some, (k,)."""
    middle, change = np.empty_like(x), np.empty_like(x)
    middle[1:-1], change[1:-1] = (x[2:] + x[:-2]) / 2, np.abs(x[2:] - x[:-2])
    for end, one, two in ((0, 1, 2), (-1, -2, -3)):  # by a straight line
        middle[end], change[end] = 2 * x[one] - x[two], 2 * np.abs(x[one] - x[two])
    residual = np.abs(x - middle)
    sigma = _NORMAL * np.median(residual, axis=0)
    spike = (residual > _SIGMAS * sigma) & (residual > _SIGMAS / _NEIGHBOURS * change) & (sigma > 0)
    for i, axis in np.argwhere(spike):  # where all around is louder it is noise
        near = residual[max(i - _NEAR, 0) : i + _NEAR + 1, axis]
        spike[i, axis] = residual[i, axis] > _SIGMAS * _NORMAL * np.median(near)
    k, mended = np.arange(len(x)), x.copy()
    for axis in np.flatnonzero(spike.any(axis=0)):
        bad = spike[:, axis]
        line = interp1d(k[~bad], x[~bad, axis], fill_value="extrapolate", assume_sorted=True)
        mended[bad, axis] = line(k[bad])
    return mended, np.asarray(spike.any(axis=1))
