"""Detect standstill: seconds as quiet as those in which GNSS measured no velocity.

Of a window of a second there are two statistics. That of stance detectors [1]_ about the window's
own means, which gravity, biases and inclination leave unknown,

    T = mean over axes of var / var_0,

and the same of the squares of what means have changed by since the second before: a car that
gathers way may shake no more than one that stands. var_0 is what the unit has at rest. A data sheet
has none that holds: an engine that idles shakes a unit tens of times as much. So var_0 is the mean
over the windows in which GNSS contradicts no velocity of zero (chi-square test), nor in the windows
about, and in which it could tell rest from motion: three sigma of a window's velocity are below the
speeds that GNSS has measured in motion, or below a slow walk. Vibration is not white either: T has
``2 / var(T)`` degrees of freedom (Satterthwaite), of the same windows, at most those of white
noise. A window stands where neither T is above what 97.5 % of such F ratios are below and GNSS, if
it measured, does not contradict.

The sigma of a velocity of zero is the root mean square of what GNSS measured, or what it states of
its own errors if that is more, in the quiet windows that it does not contradict. Where GNSS itself
is silent, it is that of the quiet windows that it contradicts, if there are any: where samples
cannot distinguish rest from motion, in a hover or in smooth flight, the speed of that.

References
----------
.. [1] Skog, Haendel, Nilsson, Rantakokko: Zero-velocity detection - an algorithm evaluation, IEEE
   Transactions on Biomedical Engineering 57(11), 2010.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import chdtri, fdtri  # scipy.stats takes half a second to import

from fgnav.alignment.gaps import Bridged
from fgnav.assembly.position.antenna_motion import AntennaMotion
from fgnav.checks import BoolArray, FloatArray, IntArray

WINDOW_S = 1.0  # what shakes a body at rest has faded within it; Skog's feet stand a tenth of it
_MISSED = 0.05  # of windows at rest, by both statistics
_FALSE_ALARM = 1e-4  # of the test that GNSS measured a velocity of zero
_RESOLVED_SIGMAS = 3.0  # of a window's velocity, that speeds in motion exceed
_SLOW_MPS = 0.5  # a slow walk
_SAME_S = 1e-6


class Standing(NamedTuple):
    """Keyframes at which a body has stood for a second, (k,), and the 1-sigma of its velocity."""

    row: IntArray
    sigma_mps: FloatArray
    until_s: FloatArray  # their times
    causal: bool = False  # whether a second is at rest only once it is over

    def contains(self, t_s: FloatArray) -> BoolArray:
        """Select the times, (n,), at standstill; causal: the last of each second."""
        if not len(self.until_s):
            return np.zeros(len(t_s), dtype=np.bool_)
        after = np.searchsorted(self.until_s, t_s - _SAME_S)
        until_s = np.append(self.until_s, np.inf)[after]
        back_s = _SAME_S if self.causal else WINDOW_S - _SAME_S
        return np.asarray(t_s > until_s - back_s)

    def share(self, t_s: FloatArray) -> FloatArray:
        """Return the share of each interval between times, (n - 1,), that is at rest.

        Causal: of what is over with the interval.
        """
        if not len(self.until_s):
            return np.zeros(len(t_s) - 1)
        from_s = np.maximum(self.until_s - WINDOW_S, np.append(-np.inf, self.until_s[:-1]))
        total_s = np.append(0.0, np.cumsum(self.until_s - from_s))
        knots_s = np.column_stack([from_s, self.until_s]).ravel()
        rested_s = np.interp(t_s, knots_s, np.column_stack([total_s[:-1], total_s[1:]]).ravel())
        until_s = rested_s[1:]
        if self.causal:
            until_s = total_s[np.searchsorted(self.until_s, t_s[1:] + _SAME_S)]
        return np.asarray((until_s - rested_s[:-1]).clip(0) / np.diff(t_s))


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
    second = np.floor((t_s - t_s[0]) / WINDOW_S).astype(np.int64)
    row = np.flatnonzero(np.diff(second, prepend=0) > 0)
    if not len(row):
        return Standing(row, np.zeros(0), np.zeros(0), causal)
    variance, step, count = _moments(record, t_s[row])
    measured = _measured(antenna, t_s, row)
    with_gnss = measured.number > 0
    limit = chdtri(3 * np.maximum(measured.number, 1), _FALSE_ALARM)
    contradicted = with_gnss & (measured.whitened > limit)
    resolvable = _is_resolved(measured, contradicted, causal=causal)
    at_rest = np.isfinite(variance).all(axis=1) & with_gnss & ~contradicted & resolvable
    surrounded = np.append(False, at_rest[:-1]) & np.append(at_rest[1:], False)
    calm = at_rest & surrounded
    quiet = _is_quiet(variance, np.maximum(count - 1, 1), calm, causal=causal)
    both = calm & np.append(False, calm[:-1])  # else the end of braking is a step of rest
    quiet &= _is_quiet(step, np.ones(len(row)), both, causal=causal)
    sigma_mps = _sigma_mps(measured, quiet & with_gnss & ~contradicted, causal=causal)
    in_motion_mps = _sigma_mps(measured, quiet & contradicted, causal=causal)
    sigma_mps = np.where(with_gnss, sigma_mps, np.fmax(sigma_mps, in_motion_mps))
    stands = quiet & ~contradicted & (resolvable | ~with_gnss) & np.isfinite(sigma_mps)
    return Standing(row[stands], sigma_mps[stands], t_s[row[stands]], causal)


def _is_resolved(measured: _Measured, contradicted: BoolArray, *, causal: bool) -> BoolArray:
    """Return in which windows, (m,), GNSS tells rest from the speeds that it measured in motion."""
    number = np.maximum(measured.number, 1)
    sigma_mps = np.sqrt(measured.stated_m2ps2 / 3.0) / number  # of the mean of a window
    square = np.where(contradicted, measured.square_m2ps2 - measured.stated_m2ps2, 0.0).clip(0.0)
    total, count = square.cumsum(), np.where(contradicted, measured.number, 0).cumsum()
    last = np.arange(len(number)) if causal else np.full(len(number), len(number) - 1)
    speed_mps = np.sqrt(total[last] / np.maximum(count[last], 1))
    return np.asarray(_RESOLVED_SIGMAS * sigma_mps < np.maximum(speed_mps, _SLOW_MPS))


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


def _moments(record: Bridged, until_s: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return moments of a unit's axes in the seconds before times, and the number of samples, (m,).

    Variances, (m, d), and squares of what means have changed by since the second before; NaN where
    a window, or the one before, touches a gap or an axis reads one value.
    """
    imu, gaps_s = record.imu, record.gaps_s
    x = imu.f_b_mps2 if imu.w_b_radps is None else np.hstack([imu.f_b_mps2, imu.w_b_radps])
    x = x - x[0]  # for the digits of the sums below
    changed = np.diff(x, axis=0, prepend=x[:1]) != 0
    sums = [np.vstack([np.zeros(x.shape[1]), np.cumsum(y, axis=0)]) for y in (x, x**2, changed)]
    first = np.searchsorted(imu.t_s, until_s - WINDOW_S, side="right")
    last = np.searchsorted(imu.t_s, until_s, side="right")
    count = last - first
    mean, square = ((one[last] - one[first]) / np.maximum(count, 1)[:, None] for one in sums[:2])
    variance = (square - mean**2) * (count / np.maximum(count - 1, 1))[:, None]
    changes = sums[2][last] - sums[2][np.minimum(first + 1, last)]
    ended = np.searchsorted(gaps_s[:, 1], until_s - WINDOW_S, side="right")
    gapless = np.searchsorted(gaps_s[:, 0], until_s) <= ended
    resolved = gapless[:, None] & (changes > 0) & (variance > 0)
    variance = np.where(resolved, variance, np.nan)
    mean_valid = np.where(np.isfinite(variance), mean, np.nan)
    step = np.diff(mean_valid, axis=0, prepend=np.full((1, x.shape[1]), np.nan)) ** 2
    return variance, step, count


def _measured(antenna: AntennaMotion, t_s: FloatArray, row: IntArray) -> _Measured:
    """Sum up the GNSS velocities in the windows before rows."""
    at, v, C = _velocities(antenna, t_s, row)
    whitened = np.einsum("ki,ki->k", v, np.linalg.solve(C, v[:, :, None])[:, :, 0])
    first = np.searchsorted(t_s, t_s[row] - WINDOW_S + _SAME_S, side="right")
    sums = []
    for values in (np.ones(len(at)), whitened, (v**2).sum(axis=1), np.einsum("kii->k", C)):
        total = np.zeros(len(t_s) + 1)
        total[at + 1] = values
        total = total.cumsum()
        sums.append(total[row + 1] - total[first])
    return _Measured(np.rint(sums[0]).astype(np.int64), *sums[1:])


def _velocities(
    antenna: AntennaMotion, t_s: FloatArray, row: IntArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return keyframes, (k,), their velocities and covariances; else of positions a second apart.

    Velocities known in some directions only are left out.
    """
    velocity = next((one for one in antenna.velocities if one.valid.any()), None)
    if velocity is not None:
        complete = velocity.valid
        if velocity.partial is not None:
            complete = complete & ~velocity.partial.any(axis=(1, 2))
        at = np.flatnonzero(complete)
        return at, velocity.value[at], velocity.covariance[at]
    if antenna.position is None:
        return np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty((0, 3, 3))
    good = np.flatnonzero(antenna.position.valid)
    p_n_m, C = antenna.position.value[good], antenna.position.covariance[good]
    before = np.searchsorted(t_s[good], t_s[good] - WINDOW_S + _SAME_S, side="right") - 1
    interval_s = t_s[good] - t_s[good[before]]
    k = np.flatnonzero((before >= 0) & (interval_s < 2 * WINDOW_S) & np.isin(good, row))
    j, T = before[k], interval_s[k]
    return good[k], (p_n_m[k] - p_n_m[j]) / T[:, None], (C[k] + C[j]) / (T**2)[:, None, None]


def _is_quiet(
    moment: FloatArray, white: FloatArray, at_rest: BoolArray, *, causal: bool
) -> BoolArray:
    """Select windows, (m,), with moments, (m, d), as small as at standstill; causal: up to then.

    An axis has degrees of freedom ``white``, (m,), in white noise.
    """
    m, d = moment.shape
    at_rest = at_rest & np.isfinite(moment).all(axis=1)
    at_rest_moment = np.where(at_rest[:, None], moment, 0.0)
    # Whether a window is at rest is known when the window after it is over.
    last = np.maximum(np.arange(m) - 1, 0) if causal else np.full(m, m - 1)
    number = np.maximum(at_rest.cumsum()[last], 1)
    usual = at_rest_moment.cumsum(axis=0)[last] / number[:, None]
    has_rested = (usual > 0).all(axis=1)
    usual[~has_rested] = 1.0
    T = (np.where(np.isfinite(moment), moment, np.inf) / usual).mean(axis=1)
    products = np.einsum("ma,mb->mab", at_rest_moment, at_rest_moment).cumsum(axis=0)[last]
    square = np.einsum("mab,ma,mb->m", products, 1 / usual, 1 / usual) / d**2 / number
    freedom = 2.0 / np.maximum(square - 1.0, 2.0 / (d * white))
    return np.asarray(has_rested & (fdtri(freedom, freedom * number, 1 - _MISSED / 2) > T))
