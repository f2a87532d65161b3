"""The slip test of ``fgnav.gnss.slips``, epoch by epoch, compiled."""

import numpy as np
from numba import njit

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.slips import FINE, NOT_TESTED, SLIP

SIGNIFICANT = 4.5  # sigmas a step must reach …
LEAST_CYCLES = 0.25  # … and cycles: the smallest slip is half a cycle, multipath moves less
_UNKNOWNS = 4  # change of the baseline, change of the clock
_LEAST_SHARE = 1e-3  # of a step that shows in its own residual; with less a slip passes unnoticed


@njit(cache=True)
def judge(
    phase_m: FloatArray,
    e_n: FloatArray,
    variance_m2: FloatArray,
    unbroken: BoolArray,
    length_m: FloatArray,
    wavelength_m: FloatArray,
    verdict: IntArray,
) -> None:
    """Write what the steps into each epoch say of every link, (n, b, m)."""
    n, b, m = phase_m.shape
    A, y = np.empty((m, _UNKNOWNS)), np.empty(m)
    sigma_m, least_m = np.empty(m), np.empty(m)
    channel = np.empty(m, dtype=np.int64)
    for k in range(1, n):
        for i in range(b):
            count = 0
            for j in range(m):
                step_m = phase_m[k, i, j] - phase_m[k - 1, i, j]
                if not (unbroken[k, 0, j] and unbroken[k, i + 1, j] and np.isfinite(step_m)):
                    continue
                turn = e_n[k, j] - e_n[k - 1, j]
                A[count, :3] = -0.5 * (e_n[k, j] + e_n[k - 1, j])
                A[count, 3] = 1.0
                y[count] = step_m
                sigma_m[count] = np.sqrt(2 * (variance_m2[k, j] + variance_m2[k - 1, j]))
                least_m[count] = LEAST_CYCLES * wavelength_m[j] + length_m[i] * np.sqrt(turn @ turn)
                channel[count] = j
                count += 1
            _snoop(A, y, sigma_m, least_m, channel, count, verdict[k, i])


@njit(cache=True)
def _snoop(
    A: FloatArray,
    y: FloatArray,
    sigma_m: FloatArray,
    least_m: FloatArray,
    channel: IntArray,
    count: int,
    verdict: IntArray,
) -> None:
    """Take out the worst of ``count`` steps while it is a slip; write verdicts by channel.

    The worst residual need not be a slip where there are two: then all pairs are tried.
    """
    cofactor, x = np.empty((_UNKNOWNS, _UNKNOWNS)), np.empty(_UNKNOWNS)
    everything = count
    while count > _UNKNOWNS and _fit(A, y, sigma_m, count, cofactor, x):
        worst = _worst(A, y, x, sigma_m, least_m, cofactor, channel[:count], verdict)
        if worst < 0:
            return
        if count == _UNKNOWNS + 1:
            verdict[channel[:count]] = SLIP
            return
        if count == everything - 1:
            verdict[channel[count]] = NOT_TESTED
            first, worst = _pair(A, y, sigma_m, least_m, channel, everything)
            _swap(A, y, sigma_m, least_m, channel, first, count)
            verdict[channel[count]] = SLIP
        verdict[channel[worst]] = SLIP
        count -= 1
        _swap(A, y, sigma_m, least_m, channel, worst, count)


@njit(cache=True)
def _pair(
    A: FloatArray,
    y: FloatArray,
    sigma_m: FloatArray,
    least_m: FloatArray,
    channel: IntArray,
    count: int,
) -> tuple[int, int]:
    """Return the two rows, the later one first, without which the others fit best."""
    cofactor, x = np.empty((_UNKNOWNS, _UNKNOWNS)), np.empty(_UNKNOWNS)
    best, least = (count - 1, count - 2), np.inf
    for late in range(1, count):
        for early in range(late):
            _swap(A, y, sigma_m, least_m, channel, late, count - 1)
            _swap(A, y, sigma_m, least_m, channel, early, count - 2)
            if _fit(A, y, sigma_m, count - 2, cofactor, x):
                squares = 0.0
                for c in range(count - 2):
                    residual_m = y[c]
                    for p in range(_UNKNOWNS):
                        residual_m -= A[c, p] * x[p]
                    squares += (residual_m / sigma_m[c]) ** 2
                if squares < least:
                    best, least = (late, early), squares
            _swap(A, y, sigma_m, least_m, channel, early, count - 2)
            _swap(A, y, sigma_m, least_m, channel, late, count - 1)
    return best


@njit(cache=True)
def _swap(
    A: FloatArray,
    y: FloatArray,
    sigma_m: FloatArray,
    least_m: FloatArray,
    channel: IntArray,
    i: int,
    j: int,
) -> None:
    for p in range(_UNKNOWNS):
        A[i, p], A[j, p] = A[j, p], A[i, p]
    y[i], y[j] = y[j], y[i]
    sigma_m[i], sigma_m[j] = sigma_m[j], sigma_m[i]
    least_m[i], least_m[j] = least_m[j], least_m[i]
    channel[i], channel[j] = channel[j], channel[i]


@njit(cache=True)
def _fit(
    A: FloatArray,
    y: FloatArray,
    sigma_m: FloatArray,
    count: int,
    cofactor: FloatArray,
    x: FloatArray,
) -> bool:
    """Weighted least squares of the first ``count`` rows; False if the geometry is singular."""
    pull = _normal(A, y, sigma_m, count, cofactor)
    least = 0.0
    for p in range(_UNKNOWNS):
        least += 1e-9 * cofactor[p, p]
    for p in range(_UNKNOWNS):  # Gauss-Jordan: a positive definite matrix needs no pivoting
        scale = cofactor[p, p]
        if not scale > least:
            return False
        cofactor[p, p] = 1.0
        for q in range(_UNKNOWNS):
            cofactor[p, q] /= scale
        for r in range(_UNKNOWNS):
            if r != p:
                factor = cofactor[r, p]
                cofactor[r, p] = 0.0
                for q in range(_UNKNOWNS):
                    cofactor[r, q] -= factor * cofactor[p, q]
    for p in range(_UNKNOWNS):
        x[p] = 0.0
        for q in range(_UNKNOWNS):
            x[p] += cofactor[p, q] * pull[q]
    return True


@njit(cache=True)
def _normal(
    A: FloatArray, y: FloatArray, sigma_m: FloatArray, count: int, matrix: FloatArray
) -> FloatArray:
    """Write the normal matrix, return its right-hand side; loops, which compile quickly."""
    pull = np.zeros(_UNKNOWNS)
    matrix[:] = 0.0
    for c in range(count):
        weight = 1.0 / sigma_m[c] ** 2
        for p in range(_UNKNOWNS):
            pull[p] += weight * A[c, p] * y[c]
            for r in range(_UNKNOWNS):
                matrix[p, r] += weight * A[c, p] * A[c, r]
    return pull


@njit(cache=True)
def _worst(
    A: FloatArray,
    y: FloatArray,
    x: FloatArray,
    sigma_m: FloatArray,
    least_m: FloatArray,
    cofactor: FloatArray,
    channel: IntArray,
    verdict: IntArray,
) -> int:
    """Return the row that is a slip most clearly, -1 if none is; write what could be tested."""
    worst, most = -1, SIGNIFICANT
    for c in range(len(channel)):
        share, residual_m = 1.0, y[c]
        for p in range(_UNKNOWNS):
            residual_m -= A[c, p] * x[p]
            for q in range(_UNKNOWNS):
                share -= A[c, p] * cofactor[p, q] * A[c, q] / sigma_m[c] ** 2
        if share < _LEAST_SHARE:
            verdict[channel[c]] = NOT_TESTED
            continue
        verdict[channel[c]] = FINE
        normalised = abs(residual_m) / (sigma_m[c] * np.sqrt(share))
        if normalised > most and abs(residual_m) / share > least_m[c]:
            worst, most = c, normalised
    return worst
