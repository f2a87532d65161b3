"""Which clock of the inertial unit fits a track best: a search, then Gauss-Newton steps."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.identification.track.integrals import Integrals, sampled
from fgnav.identification.track.motion import (
    ARM,
    LATE,
    RATE,
    Series,
    covered,
    detrended,
    fit,
    telling,
)
from fgnav.identification.track.windows import Fitted, Windows, nearer
from fgnav.types.flight import Imu

_REACH_S, STEP_S = 20.0, 0.1  # leap seconds lie within; a motion of a hertz has a tenth's valley
_STEPS = 12  # at most, of Gauss-Newton
NEAR_S = 1.0  # a minimum further from where steps begin is that of another candidate
_RATE_STEPS = 2
_STILL = 1e-4  # s, m
_SETTLED = 0.1  # of sigma: a last step that is longer says nothing of where the minimum is
_FASTEST = 1e-3  # of a quartz left to itself: a minute in a day


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Clock:
    """By how much the unit's times are to be raised, and the lever arm that goes with it.

    Attributes
    ----------
    late_s, sigma_s : float
    reach_s : float
        Beyond it a right flight is unlikely to be off; infinite, as ``rate_reach``, and without
        freedom of the lever arm where the steps have not settled.
    rate, rate_sigma, rate_reach : float
        By what its times are to be raised in a second, beside that.
    arm_b_m : ndarray, shape (3,)
        From the unit to the antenna.
    arm_covariance_m2 : ndarray, shape (3, 3)
    arm_freedom : float
        Of Student's t.
    fitted : Fitted
        There.
    windows : Windows
    R_ns : ndarray, shape (W, 3, 3)
        Of each window.
    """

    late_s: float
    sigma_s: float
    reach_s: float
    rate: float
    rate_sigma: float
    rate_reach: float
    arm_b_m: FloatArray
    arm_covariance_m2: FloatArray
    arm_freedom: float
    fitted: Fitted
    windows: Windows
    R_ns: FloatArray


def searched(series: Series, integrals: Integrals) -> FloatArray:
    """Return candidates within 20 s, s: where a free rotation of each window fits best, and 0."""
    late_s = np.arange(-_REACH_S, _REACH_S + STEP_S / 2, STEP_S)
    some = replace(series, windows=telling(series, integrals.t_s, ()))
    left = np.array([_left(some, integrals, late) for late in late_s])
    if np.isnan(left).all():
        return np.zeros(1)
    return np.array([0.0, late_s[int(np.nanargmin(left))]])


def _left(series: Series, integrals: Integrals, late_s: float) -> float:
    """Return the mean square that no matrix of a window explains; NaN with under half of them."""
    windows = covered(series, integrals, late_s)
    if 2 * len(windows) < len(series.windows) or not len(windows):
        return np.nan
    row, order = windows.row, series.order
    force = integrals.twice if order > 1 else integrals.once
    at_s = (series.t_s[row] - late_s).ravel()
    X = sampled(integrals.t_s, force, at_s).reshape(*row.shape, 3)
    X = detrended(windows, series.t_s, X, order)
    y = detrended(windows, series.t_s, series.value[row], order)
    gram, product = X.swapaxes(1, 2) @ X, X.swapaxes(1, 2) @ y
    gram += 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    explained = (product * np.linalg.solve(gram, product)).sum(axis=(1, 2))
    # Of each window the share: one with a bad fix must not outweigh the others.
    return float(np.mean(np.log(np.maximum((y**2).sum(axis=(1, 2)) - explained, 1e-12))))


def clock(series: Series, integrals: Integrals, imu: Imu, arm_b_m: FloatArray) -> Clock | None:
    """Return the clock that fits best; of candidates that fit alike the stated one.

    None where the record covers too few windows to tell anything.
    """
    best: Clock | None = None
    for late_s in searched(series, integrals):
        here = _refined(series, integrals, imu, arm_b_m, float(late_s))
        if here is None:
            continue
        if best is None or _over(series, integrals, imu, best, here):
            best = here
        elif abs(here.late_s - best.late_s) < STEP_S and here.reach_s < best.reach_s == np.inf:
            best = here  # the same valley, and its bottom
    return best


def _over(series: Series, integrals: Integrals, imu: Imu, stated: Clock, other: Clock) -> bool:
    """Return whether another clock is nearer to the windows that both have."""
    rows = set(covered(series, integrals, stated.late_s).row[:, 0].tolist())
    windows = covered(series, integrals, other.late_s)
    common = windows.some(np.isin(windows.row[:, 0], list(rows)))
    if not len(common):
        return False
    both = [fit(series, integrals, imu, c.late_s, c.arm_b_m, common)[0] for c in (stated, other)]
    return nearer(both[0], both[1])


def _refined(
    series: Series, integrals: Integrals, imu: Imu, arm_b_m: FloatArray, late_s: float
) -> Clock | None:
    """Take Gauss-Newton steps of clock and lever arm."""
    start_s = late_s
    for _ in range(_STEPS):
        if not len(covered(series, integrals, late_s)):
            return None
        here, R_ns = fit(series, integrals, imu, late_s, arm_b_m)
        step = here.x.clip(-1.0, 1.0)
        still = abs(step[LATE]) < _STILL and _settled(here)
        if still or abs(late_s + step[LATE] - start_s) > NEAR_S:
            break
        late_s, arm_b_m = late_s + float(step[LATE]), arm_b_m + step[ARM]
    windows = covered(series, integrals, late_s)
    if not len(windows):
        return None
    here, R_ns = fit(series, integrals, imu, late_s, arm_b_m, windows)
    settled = _settled(here)
    rate, offset_s = 0.0, late_s
    running, _ = fit(series, integrals, imu, offset_s, arm_b_m, windows, rate=rate)
    for _ in range(_RATE_STEPS):
        rate += float(running.x[RATE].clip(-_FASTEST, _FASTEST))
        offset_s += float(running.x[LATE].clip(-STEP_S, STEP_S))
        running, _ = fit(series, integrals, imu, offset_s, arm_b_m, windows, rate=rate)
    return Clock(
        late_s=late_s,
        rate=rate,
        rate_sigma=running.sigma(RATE),
        rate_reach=running.reach(RATE) if settled else np.inf,
        sigma_s=here.sigma(LATE),
        reach_s=here.reach(LATE) if settled else np.inf,
        arm_b_m=arm_b_m,
        arm_covariance_m2=here.covariance[ARM, ARM],
        arm_freedom=float(here.freedom[ARM].min()) if settled else 0.0,
        fitted=here,
        windows=windows,
        R_ns=R_ns,
    )


def _settled(here: Fitted) -> bool:
    """Return whether the step that is left is short beside what is known, in every direction."""
    covariance = here.covariance + _STILL**2 * np.eye(len(here.x))
    return bool(here.x @ np.linalg.solve(covariance, here.x) <= _SETTLED**2)
