"""When a body stands still: seconds as quiet as those in which GNSS measured no velocity.

Of a window of a second the statistic is that of stance detectors [1]_ about the window's own means,
which gravity, biases and a lean leave open,

    T = mean over axes of var / var_0,

var_0 the unit's own variance at rest. A data sheet has none that holds: an engine that idles shakes
a unit tens of times louder. So var_0 is the mean over the windows in which GNSS contradicts no
velocity of zero (chi-square test), nor in the windows about. Vibration is not white either: T has
``2 / var(T)`` degrees of freedom (Satterthwaite), of the same windows, at most those of ten
samples of white noise; a window stands where T is below that chi-square's 95 % and GNSS, if it
measured, does not contradict.

The sigma of a velocity of zero is the root mean square of what GNSS measured, or what it states of
its own errors if that is more: in the quiet windows that it does not contradict, and, where GNSS
itself is silent, in all quiet ones. Where samples cannot tell rest from motion, in a hover or in
smooth flight, the latter is the speed of that, and zero velocity says nothing.

References
----------
.. [1] Skog, Haendel, Nilsson, Rantakokko: Zero-velocity detection - an algorithm evaluation, IEEE
   Transactions on Biomedical Engineering 57(11), 2010.
"""

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.frontend.gaps import Bridged
from fgnav.frontend.position.antenna_motion import AntennaMotion

_WINDOW_S = 1.0  # what shakes a body at rest has faded within it; Skog's feet stand a tenth of it
_MISSED = 0.05  # of windows at rest
_FALSE_ALARM = 1e-4  # of the test that GNSS measured a velocity of zero
_FEWEST_SAMPLES = 10  # in a window
_FEWEST_WINDOWS = 3  # at rest, that their spread is told by
_SAME_S = 1e-6


class Standing(NamedTuple):
    """Keyframes at which a body has stood for a second, (k,), and the 1-sigma of its velocity."""

    row: IntArray
    sigma_mps: FloatArray


class _Measured(NamedTuple):
    """Velocities that GNSS measured within windows, (m,): their number, squares and sizes."""

    number: IntArray
    whitened: FloatArray  # sum of v' C^-1 v
    square_m2ps2: FloatArray  # sum of v' v
    stated_m2ps2: FloatArray  # sum of the trace of C


def standing(
    record: Bridged, t_s: FloatArray, antenna: AntennaMotion, *, causal: bool = False
) -> Standing:
    """Return at which of keyframes, (n,), a body stands still.

    Once a second, by the second before. Causal: by windows up to each.
    """
    second = np.floor((t_s - t_s[0]) / _WINDOW_S).astype(np.int64)
    row = np.flatnonzero(np.diff(second, prepend=0) > 0)
    if not len(row):
        return Standing(row, np.zeros(0))
    variance = _variances(record, t_s[row])
    measured = _measured(antenna, t_s, row)
    whole = np.isfinite(variance).all(axis=1)
    limit = chi2.isf(_FALSE_ALARM, 3 * np.maximum(measured.number, 1))
    contradicted = (measured.number > 0) & (measured.whitened > limit)
    at_rest = whole & (measured.number > 0) & ~contradicted
    beside = np.append(False, at_rest[:-1]) & np.append(at_rest[1:], False)
    quiet = _is_quiet(variance, at_rest & beside, causal=causal)
    told = measured.number > 0
    sigma_mps = np.where(
        told,
        _sigma_mps(measured, quiet & told & ~contradicted, causal=causal),
        _sigma_mps(measured, quiet & told, causal=causal),
    )
    stands = quiet & ~contradicted & np.isfinite(sigma_mps)
    return Standing(row[stands], sigma_mps[stands])


def _sigma_mps(measured: _Measured, of: BoolArray, *, causal: bool) -> FloatArray:
    """Return the 1-sigma of velocities in windows, (m,); causal: by those up to each."""
    total = np.maximum(
        np.where(of, measured.square_m2ps2, 0.0).cumsum(),
        np.where(of, measured.stated_m2ps2, 0.0).cumsum(),
    )
    number = 3 * np.where(of, measured.number, 0).cumsum()
    last = np.arange(len(of)) if causal else np.full(len(of), len(of) - 1)
    sigma_mps = np.sqrt(total[last] / np.maximum(number[last], 1))
    return np.asarray(np.where(number[last] > 0, sigma_mps, np.nan))


def _variances(record: Bridged, until_s: FloatArray) -> FloatArray:
    """Return variances of a unit's axes in the seconds before times, (m, d); NaN where unknown.

    Unknown are windows that touch a gap, with few samples, or of an axis that reads one value.
    """
    imu, gaps_s = record.imu, record.gaps_s
    x = imu.f_b_mps2 if imu.w_b_radps is None else np.hstack([imu.f_b_mps2, imu.w_b_radps])
    x = x - x[0]  # for the digits of the sums below
    changed = np.diff(x, axis=0, prepend=x[:1]) != 0
    sums = [np.vstack([np.zeros(x.shape[1]), np.cumsum(y, axis=0)]) for y in (x, x**2, changed)]
    first = np.searchsorted(imu.t_s, until_s - _WINDOW_S, side="right")
    last = np.searchsorted(imu.t_s, until_s, side="right")
    count = (last - first)[:, None]
    mean, square, changes = ((one[last] - one[first]) / np.maximum(count, 1) for one in sums)
    variance = (square - mean**2) * count / np.maximum(count - 1, 1)
    ended = np.searchsorted(gaps_s[:, 1], until_s - _WINDOW_S, side="right")
    whole = np.searchsorted(gaps_s[:, 0], until_s) <= ended
    resolved = whole[:, None] & (count >= _FEWEST_SAMPLES) & (changes > 0) & (variance > 0)
    return np.asarray(np.where(resolved, variance, np.nan))


def _measured(antenna: AntennaMotion, t_s: FloatArray, row: IntArray) -> _Measured:
    """Return what velocities, else positions a second apart, say in the windows before rows."""
    n = len(t_s)
    velocity = next((one for _, one in antenna.velocities if one.valid.any()), None)
    if velocity is not None:
        at = np.flatnonzero(velocity.valid)
        v, C = velocity.value[at], velocity.covariance[at]
    elif antenna.position is not None and antenna.position.valid.any():
        good = np.flatnonzero(antenna.position.valid)
        value, covariance = antenna.position.value, antenna.position.covariance
        before = np.searchsorted(t_s[good], t_s[good] - _WINDOW_S + _SAME_S, side="right") - 1
        apart_s = t_s[good] - t_s[good[before]]
        told = (before >= 0) & (apart_s < 2 * _WINDOW_S) & np.isin(good, row)
        at, from_row, T = good[told], good[before[told]], apart_s[told, None]
        v = (value[at] - value[from_row]) / T
        C = (covariance[at] + covariance[from_row]) / T[:, :, None] ** 2
    else:
        none = np.zeros(len(row))
        return _Measured(none.astype(np.int64), none, none, none)
    whitened = np.einsum("ki,ki->k", v, np.linalg.solve(C, v[:, :, None])[:, :, 0])
    first = np.searchsorted(t_s, t_s[row] - _WINDOW_S + _SAME_S, side="right")
    sums = []
    stated = np.einsum("kii->k", C)
    for values in (np.ones(len(at)), whitened, (v**2).sum(axis=1), stated):
        total = np.zeros(n + 1)
        total[at + 1] = values
        total = total.cumsum()
        sums.append(total[row + 1] - total[first])
    return _Measured(np.rint(sums[0]).astype(np.int64), *sums[1:])


def _is_quiet(variance: FloatArray, at_rest: BoolArray, *, causal: bool) -> BoolArray:
    """Return which windows, (m,), are as quiet as those at rest; causal: before them."""
    m, d = variance.shape
    sample = np.where(at_rest[:, None], variance, 0.0)
    count = at_rest.cumsum()
    total = sample.cumsum(axis=0)
    products = np.einsum("ma,mb->mab", sample, sample).cumsum(axis=0)
    # Whether a window is at rest is known when the window after it is over.
    last = np.maximum(np.arange(m) - 1, 0) if causal else np.full(m, m - 1)
    number = np.maximum(count[last], 1)
    usual = total[last] / number[:, None]
    told = (count[last] >= _FEWEST_WINDOWS) & (usual > 0).all(axis=1)
    usual[~told] = 1.0
    second = products[last] / number[:, None, None]
    T = np.where(np.isfinite(variance), variance, np.inf) / usual
    spread = np.einsum("mab,ma,mb->m", second, 1 / usual, 1 / usual) / d**2 - 1.0
    white = 2.0 / (d * (_FEWEST_SAMPLES - 1))
    freedom = 2.0 / np.maximum(spread, white)
    limit = chi2.isf(_MISSED, freedom) / freedom
    return np.asarray(told & (T.mean(axis=1) < limit))
