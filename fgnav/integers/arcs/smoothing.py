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
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import cg

from fgnav.checks import FloatArray, IntArray
from fgnav.integers.ils.affine import code_residuals
from fgnav.types.differences import DoubleDifferences

_EXACT = 1e-8  # relative residual of the arcs' normal equations
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
    """Return the effective number of independent epochs in 1, 2, …, n correlated ones, (n,)."""
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


def _fit(
    gap_m: FloatArray, weight: FloatArray, arc: IntArray, group: IntArray
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return the constants of the arcs, the residuals, and the epochs of each arc, (n, b, m).

    Weighted least squares, constants of epochs and groups eliminated.
    """
    constant, residual = np.zeros(gap_m.shape), np.zeros(gap_m.shape)
    count = np.zeros(gap_m.shape, dtype=np.int64)
    for i in range(gap_m.shape[1]):
        k, j = np.nonzero(arc[:, i] >= 0)
        labels, of_arc = np.unique(arc[k, i, j] * len(group) + j, return_inverse=True)
        if not len(labels):
            continue
        epochs, of_epoch = np.unique(k * len(group) + group[j], return_inverse=True)
        w, y = weight[k, i, j], gap_m[k, i, j]
        by_epoch = csr_array((w, (of_epoch, of_arc)), shape=(len(epochs), len(labels)))
        total = by_epoch.sum(axis=1)
        inverse = diags_array(np.where(total > 0, 1.0 / np.where(total > 0, total, 1.0), 0.0))
        pull = np.bincount(of_epoch, w * y, len(epochs))
        normal = diags_array(by_epoch.sum(axis=0)) - by_epoch.T @ inverse @ by_epoch
        right = np.bincount(of_arc, w * y, len(labels)) - by_epoch.T @ (inverse @ pull)
        constants, _ = cg(normal, right, rtol=_EXACT)
        common = inverse @ (pull - by_epoch @ constants)
        constant[k, i, j] = constants[of_arc]
        residual[k, i, j] = y - constants[of_arc] - common[of_epoch]
        count[k, i, j] = np.bincount(of_arc, w > 0.0, len(labels))[of_arc]
    return constant, residual, count
