"""The slip test of ``fgnav.gnss.cycle_slips.detection``, epoch by epoch, compiled."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.cycle_slips.detection import FINE, NOT_TESTED, SLIP
from fgnav.kernels.compiled import kernel

SIGNIFICANT = 4.5  # sigmas a step must reach …
LEAST_CYCLES = 0.25  # … and cycles: the smallest slip is half a cycle, multipath moves less
_UNKNOWNS = 4  # change of the baseline, change of the clock
_TELLING = 10  # channels, six to spare, that tell two slips apart
_LEAST_SHARE = 1e-3  # of a step that shows in its own residual; with less a slip passes unnoticed


class _Steps(NamedTuple):
    """Of one baseline into one epoch, a row per channel; the first ``count`` are still in."""

    A: FloatArray  # (m, 4): what the unknowns do to them
    y_m: FloatArray
    sigma_m: FloatArray
    turn_m: FloatArray  # the most that the turn of the line of sight may add
    wavelength_m: FloatArray
    channel: IntArray


@kernel
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
    rows = (np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m, dtype=np.int64))
    steps = _Steps(np.empty((m, _UNKNOWNS)), *rows)
    for k in range(1, n):
        for i in range(b):
            count = np.int64(0)  # a plain 0 is a type to numba: all below would be compiled twice
            for j in range(m):
                step_m = phase_m[k, i, j] - phase_m[k - 1, i, j]
                if not (unbroken[k, 0, j] and unbroken[k, i + 1, j] and np.isfinite(step_m)):
                    continue
                turn2 = 0.0
                for c in range(3):
                    turn2 += (e_n[k, j, c] - e_n[k - 1, j, c]) ** 2
                    steps.A[count, c] = -0.5 * (e_n[k, j, c] + e_n[k - 1, j, c])
                steps.A[count, 3] = 1.0
                steps.y_m[count] = step_m
                steps.sigma_m[count] = np.sqrt(2 * (variance_m2[k, j] + variance_m2[k - 1, j]))
                steps.turn_m[count] = length_m[i] * np.sqrt(turn2)
                steps.wavelength_m[count] = wavelength_m[j]
                steps.channel[count] = j
                count += 1
            _snoop(steps, int(count), verdict[k, i])


@kernel
def _snoop(steps: _Steps, count: int, verdict: IntArray) -> None:
    """Take out the worst of ``count`` steps while it is a slip; write verdicts by channel.

    All have one where that leaves nothing to check, or where one more shows among few: of two slips
    the largest residual need be neither.
    """
    cofactor, x = np.empty((_UNKNOWNS, _UNKNOWNS)), np.empty(_UNKNOWNS)
    everything = count
    while count > _UNKNOWNS and _fit(steps, count, cofactor, x):
        worst = _worst(steps, count, x, cofactor, verdict)
        if worst < 0:
            return
        if count == _UNKNOWNS + 1 or count < min(everything, _TELLING):
            for c in range(everything):
                verdict[steps.channel[c]] = SLIP
            return
        verdict[steps.channel[worst]] = SLIP
        count -= 1
        _swap(steps, worst, count)


@kernel
def _residual(steps: _Steps, x: FloatArray, k: int) -> float:
    """Return the residual of a step after the fit."""
    left: float = steps.y_m[k]
    for p in range(_UNKNOWNS):
        left -= steps.A[k, p] * x[p]
    return left


@kernel
def _of_fit(steps: _Steps, cofactor: FloatArray, i: int, j: int) -> float:
    """Return the covariance of the steps that the fit expects of two rows."""
    total = 0.0
    for p in range(_UNKNOWNS):
        for q in range(_UNKNOWNS):
            total += steps.A[i, p] * cofactor[p, q] * steps.A[j, q]
    return total


@kernel
def _swap(steps: _Steps, i: int, j: int) -> None:
    for p in range(_UNKNOWNS):
        steps.A[i, p], steps.A[j, p] = steps.A[j, p], steps.A[i, p]
    for values in (steps.y_m, steps.sigma_m, steps.turn_m, steps.wavelength_m):
        values[i], values[j] = values[j], values[i]
    steps.channel[i], steps.channel[j] = steps.channel[j], steps.channel[i]


@kernel
def _fit(steps: _Steps, count: int, cofactor: FloatArray, x: FloatArray) -> bool:
    """Weighted least squares of the first ``count`` rows; False if the geometry is singular."""
    pull = _normal(steps, count, cofactor)
    cost = 0.0
    for p in range(_UNKNOWNS):
        cost += 1e-9 * cofactor[p, p]
    for p in range(_UNKNOWNS):  # Gauss-Jordan: a positive definite matrix needs no pivoting
        scale = cofactor[p, p]
        if not scale > cost:
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


@kernel
def _normal(steps: _Steps, count: int, matrix: FloatArray) -> FloatArray:
    """Write the normal matrix, return its right-hand side; loops, which compile quickly."""
    A, pull = steps.A, np.zeros(_UNKNOWNS)
    for p in range(_UNKNOWNS):
        for r in range(_UNKNOWNS):
            matrix[p, r] = 0.0
    for c in range(count):
        weight = 1.0 / steps.sigma_m[c] ** 2
        for p in range(_UNKNOWNS):
            pull[p] += weight * A[c, p] * steps.y_m[c]
            for r in range(_UNKNOWNS):
                matrix[p, r] += weight * A[c, p] * A[c, r]
    return pull


@kernel
def _worst(
    steps: _Steps, count: int, x: FloatArray, cofactor: FloatArray, verdict: IntArray
) -> int:
    """Return the row that is a slip most clearly, -1 if none is; write what could be tested."""
    worst, most = -1, SIGNIFICANT
    for c in range(count):
        share = 1.0 - _of_fit(steps, cofactor, c, c) / steps.sigma_m[c] ** 2
        if share < _LEAST_SHARE:
            verdict[steps.channel[c]] = NOT_TESTED
            continue
        verdict[steps.channel[c]] = FINE
        residual_m = abs(_residual(steps, x, c))
        normalised = residual_m / (steps.sigma_m[c] * np.sqrt(share))
        least_m = LEAST_CYCLES * steps.wavelength_m[c] + steps.turn_m[c]
        if normalised > most and residual_m / share > least_m:
            worst, most = c, normalised
    return worst
