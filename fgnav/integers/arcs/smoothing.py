"""Code smoothed by carrier phase over arcs, as precise as its correlated noise allows.

Phase minus code of a link is constant over an arc, whatever moves: a constant of the arc, one of
the epoch that is common to all links of an antenna (clocks, and the reference of the differences),
and noise. Both constants are fitted together, so a change of reference loses nothing. Phase minus
the constant of its arc is code again, with the noise of a mean: of n epochs whose noise has the
autocorrelation ``r(h)``, that of ``n / (1 + 2 sum (1 - h / n) r(h))`` independent ones [1]_.

References
----------
.. [1] G. E. P. Box, G. M. Jenkins, G. C. Reinsel, "Time Series Analysis", chapter 2.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.integers.ils.affine import code_residuals
from fgnav.kernels.compiled import inlined, inner, kernel
from fgnav.types.differences import DoubleDifferences

_ROUNDS = 100
_SETTLED_M = 1e-3  # an arc's constant, from one round to the next
_STATED = 10.0  # degrees of freedom that the stated code noise counts as
_LAGS = 40  # at which the autocorrelation is measured
_PAIRS = 30  # of epochs, least, for one lag to count


class Smoothed(NamedTuple):
    """Differences with smoothed code, and what was found of the noise of the code as it was."""

    differences: DoubleDifferences
    variance_factor: float  # of code, against what was stated
    correlation: FloatArray  # (n,): autocorrelation of the code noise, by lag in epochs


def smoothed(
    differences: DoubleDifferences, arc: IntArray, correlation_s: float | None = None
) -> Smoothed:
    """Return double differences whose code is smoothed over whole arcs, before and after.

    Code there was none of, in an arc that has some, is filled in.

    Parameters
    ----------
    arc : ndarray of int, shape (n, b, m)
        Numbers of the arcs of single differences, references included; -1 without phase.
    correlation_s : float or None
        Time after which the correlation of code noise has fallen to 1 / e, exponentially; None
        measures the correlation, whatever its shape. What does not vary within arcs counts as
        correlated without end: it shows in the residuals of the epochs all the same.
    """
    gap_m = np.where(arc >= 0, differences.phase_m - differences.code_m, np.nan)
    weight = np.where(np.isfinite(gap_m), 1.0 / differences.code_variance_m2[:, None], 0.0)
    gap_m = np.nan_to_num(gap_m)
    constant_m, residual_m, count = _fit(gap_m, weight, np.array(arc), differences.group)
    squares, degrees = code_residuals(differences)
    factor = (_STATED + squares) / (_STATED + degrees)
    if correlation_s is None:
        normalised = np.where(weight > 0, residual_m * np.sqrt(weight), np.nan)
        sill = 2.0 * factor * _share(weight, differences.group)  # two antennas
        correlation = _measured(normalised, arc, sill)
        # a constant error shows in the sill alone, and that is known no better than this
        doubt = np.sqrt(2.0 / (_STATED + degrees) / effective(correlation)[-1] * len(arc))
        correlation = np.minimum(1.0, correlation + doubt * (1.0 - correlation))
    else:
        interval_s = np.median(np.diff(differences.t_s)) if len(arc) > 1 else 0.0
        correlation = np.exp(-np.arange(len(arc)) * interval_s / correlation_s)
    mean_variance = 1.0 / effective(correlation)  # by the number of epochs
    of_reference = differences.reference[:, differences.group].clip(0)[:, None]
    grouped = (differences.reference[:, differences.group] >= 0)[:, None]
    valid = (count > 0) & np.isfinite(differences.phase_m) & grouped
    valid &= np.take_along_axis(valid, of_reference, axis=2)
    of_link = constant_m - np.take_along_axis(constant_m, of_reference, axis=2)
    code_m = np.where(valid, differences.phase_m - of_link, np.nan)
    # a channel's variance is that of its youngest arc
    longest = np.where(valid, mean_variance[count.clip(1) - 1], 0.0).max(axis=1)
    variance = differences.code_variance_m2 * factor * longest + differences.phase_variance_m2
    channels = valid.any(axis=1)
    smooth = replace(
        differences,
        code_m=code_m,
        code_variance_m2=np.where(channels, variance, differences.code_variance_m2),
    )
    return Smoothed(smooth, factor, correlation)


def effective(correlation: FloatArray) -> FloatArray:
    """Return how many independent epochs 1, 2, …, n correlated ones are worth, (n,)."""
    n = np.arange(1, len(correlation) + 1)
    lag = n - 1
    rho = np.where(lag > 0, correlation, 0.0)
    inflation = 1.0 + 2.0 * (np.cumsum(rho) - np.cumsum(lag * rho) / n)
    return np.asarray(n / inflation)


def _share(weight: FloatArray, group: IntArray) -> float:
    """Return the share of the variance that is left after the epochs' constants are fitted."""
    fitted = total = 0.0
    for g in range(group.max(initial=-1) + 1):
        weighted = (weight[:, :, group == g] > 0).sum(axis=2)
        fitted += float((weighted > 0).sum())
        total += float(weighted.sum())
    return 1.0 - fitted / max(total, 1.0)


def _measured(normalised: FloatArray, arc: IntArray, sill: float) -> FloatArray:
    """Return the autocorrelation by lag, (n,): not rising, and as at the last lag after it.

    ``normalised`` are residuals over their stated standard deviation, of variance ``sill``; half
    the mean square of their differences at a lag is the part that is not common to both ends.
    """
    n = len(normalised)
    lags, values = [0], [1.0]
    for lag in np.unique(np.geomspace(1, max(n - 1, 1), _LAGS).astype(np.int64)):
        step = np.where(arc[lag:] == arc[:-lag], normalised[lag:] - normalised[:-lag], np.nan)
        squares = step[np.isfinite(step)] ** 2
        if len(squares) >= _PAIRS:
            lags.append(int(lag))
            values.append(1.0 - 0.5 * float(squares.mean()) / sill)
    falling = np.minimum.accumulate(np.clip(values, 0.0, 1.0))
    valid = np.interp(np.arange(n), lags, falling)
    return valid if len(lags) > 1 else np.ones(n)  # nothing to tell by: nothing is averaged


@kernel
def _fit(
    gap_m: FloatArray, weight: FloatArray, arc: IntArray, group: IntArray
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return the constants of the arcs, the residuals, and the epochs of each arc, (n, b, m)."""
    n, b, m = gap_m.shape
    constant, residual = np.zeros((n, b, m)), np.zeros((n, b, m))
    count = np.zeros((n, b, m), dtype=np.int64)
    for i in range(b):
        first = _beginnings(arc[:, i])
        common = _chained(gap_m[:, i], weight[:, i], first, group, constant[:, i])
        for _ in range(_ROUNDS):
            moved = _arc_constants(gap_m[:, i], weight[:, i], first, group, common, constant[:, i])
            _fit_epochs(gap_m[:, i], weight[:, i], first, group, constant[:, i], common)
            if moved < _SETTLED_M:
                break
        for k in range(n):
            for j in range(m):
                if first[k, j] >= 0:
                    constant[k, i, j] = constant[first[k, j], i, j]
                    count[first[k, j], i, j] += weight[k, i, j] > 0.0
                    residual[k, i, j] = gap_m[k, i, j] - constant[k, i, j] - common[k, group[j]]
        for k in range(n):
            for j in range(m):
                if first[k, j] >= 0:
                    count[k, i, j] = count[first[k, j], i, j]
    return constant, residual, count


@inlined
def _beginnings(arc: IntArray) -> IntArray:
    """Return the epoch at which each link's arc begins, (n, m); -1 without phase."""
    n, m = arc.shape
    first = np.empty((n, m), dtype=np.int64)
    for j in range(m):
        start = -1
        for k in range(n):
            if arc[k, j] >= 0 and (start < 0 or arc[k, j] != arc[start, j]):
                start = k
            first[k, j] = start if arc[k, j] >= 0 else -1
    return first


@inlined
def _chained(
    gap_m: FloatArray, weight: FloatArray, first: IntArray, group: IntArray, constant: FloatArray
) -> FloatArray:
    """Return constants of the epochs, (n, m), of each group, by arcs that go on, as a start."""
    n, m = gap_m.shape
    common, fitted = np.zeros((n, m)), np.zeros((n, m), dtype=np.bool_)
    for k in range(n):
        _fit_epoch(k, gap_m, weight, first, group, fitted, constant, common)
        for j in range(m):
            if weight[k, j] > 0.0 and not fitted[first[k, j], j]:
                fitted[first[k, j], j] = True
                constant[first[k, j], j] = gap_m[k, j] - common[k, group[j]]
    return common


@inlined
def _arc_constants(
    gap_m: FloatArray,
    weight: FloatArray,
    first: IntArray,
    group: IntArray,
    common: FloatArray,
    constant: FloatArray,
) -> float:
    """Fit the arcs' constants, kept at the epochs where arcs begin; return the largest change."""
    n, m = gap_m.shape
    moved = 0.0
    for j in range(m):
        pull, total = np.zeros(n), np.zeros(n)
        for k in range(n):
            if weight[k, j] > 0.0:
                pull[first[k, j]] += weight[k, j] * (gap_m[k, j] - common[k, group[j]])
                total[first[k, j]] += weight[k, j]
        for k in range(n):
            if total[k] > 0.0:
                moved = max(moved, abs(pull[k] / total[k] - constant[k, j]))
                constant[k, j] = pull[k] / total[k]
    return moved


@inlined
def _fit_epochs(
    gap_m: FloatArray,
    weight: FloatArray,
    first: IntArray,
    group: IntArray,
    constant: FloatArray,
    common: FloatArray,
) -> None:
    fitted = np.ones(gap_m.shape, dtype=np.bool_)
    for k in range(len(gap_m)):
        _fit_epoch(k, gap_m, weight, first, group, fitted, constant, common)


@inner
def _fit_epoch(
    k: int,
    gap_m: FloatArray,
    weight: FloatArray,
    first: IntArray,
    group: IntArray,
    fitted: BoolArray,
    constant: FloatArray,
    common: FloatArray,
) -> None:
    """Set an epoch's constants by the arcs that are fitted, where there is any."""
    pull, total = np.zeros(common.shape[1]), np.zeros(common.shape[1])
    for j in range(len(group)):
        if weight[k, j] > 0.0 and fitted[first[k, j], j]:
            pull[group[j]] += weight[k, j] * (gap_m[k, j] - constant[first[k, j], j])
            total[group[j]] += weight[k, j]
    for g in range(common.shape[1]):
        if total[g] > 0.0:
            common[k, g] = pull[g] / total[g]
