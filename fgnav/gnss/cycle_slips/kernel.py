"""The slip test of ``fgnav.gnss.cycle_slips.detection``, epoch by epoch, compiled."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.cycle_slips.verdicts import FINE, NOT_TESTED, SLIP, TIED
from fgnav.kernels.compiled import inlined, inner, kernel

SIGNIFICANT = 4.5  # sigmas a step must reach …
LEAST_CYCLES = 0.25  # … and cycles: the smallest slip is half a cycle, multipath moves less
_UNKNOWNS = 4  # change of the baseline, change of the clock
_LEAST_SHARE = 1e-3  # of a step that shows in its own residual; with less a slip passes unnoticed
_TIED = 14.0  # of the cost: two slips dearer by less are the right ones with 1 in 1000 or more
_WIDEST = 200  # half cycles tried beside the nearest: 19 m, where nothing else is known


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
    tied = np.empty(m, dtype=np.bool_)
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
            marked = 0
            for j in range(m):
                tied[j] = False
            _snoop(steps, int(count), tied, verdict[k, i])
            for j in range(m):
                marked += tied[j]
            for j in range(m if marked > 2 else 0):
                if tied[j]:
                    verdict[k, i, j] = TIED


@inlined
def _snoop(steps: _Steps, count: int, tied: BoolArray, verdict: IntArray) -> None:
    """Take out the worst of ``count`` steps while it is a slip; write verdicts by channel.

    The worst residual need not be a slip where there are two: then all pairs are tried, and the
    channels of those that do as well as the best are marked as tied.
    """
    cofactor, x = np.empty((_UNKNOWNS, _UNKNOWNS)), np.empty(_UNKNOWNS)
    channel, everything = steps.channel, count
    while count > _UNKNOWNS and _fit(steps, count, cofactor, x):
        worst = _worst(steps, count, x, cofactor, verdict)
        if worst < 0:
            return
        if count == _UNKNOWNS + 1:
            for c in range(count):
                verdict[channel[c]] = SLIP
            return
        if count == everything - 1:
            verdict[channel[count]] = NOT_TESTED
            first, worst = _pair(steps, everything, tied)
            _swap(steps, first, count)
            verdict[channel[count]] = SLIP
        verdict[channel[worst]] = SLIP
        count -= 1
        _swap(steps, worst, count)


@inlined
def _pair(steps: _Steps, count: int, tied: BoolArray) -> tuple[int, int]:
    """Return the two rows, the later one first, whose slips explain all steps best.

    What the others leave as residuals counts, and how far the two are from slips of half cycles.
    """
    cofactor, x = np.empty((_UNKNOWNS, _UNKNOWNS)), np.empty(_UNKNOWNS)
    costs = np.full((count, count), np.inf)
    best, least = (count - 1, count - 2), np.inf
    for late in range(1, count):
        for early in range(late):
            _swap(steps, late, count - 1)
            _swap(steps, early, count - 2)
            if _fit(steps, count - 2, cofactor, x):
                costs[late, early] = _cost_of_slips(steps, count, cofactor, x)
                if costs[late, early] < least:
                    best, least = (late, early), costs[late, early]
            _swap(steps, early, count - 2)
            _swap(steps, late, count - 1)
    for late in range(1, count):
        for early in range(late):
            if costs[late, early] < least + _TIED:
                tied[steps.channel[late]] = tied[steps.channel[early]] = True
    return best


@inlined
def _cost_of_slips(steps: _Steps, count: int, cofactor: FloatArray, x: FloatArray) -> float:
    """Return the squared residuals of all rows where the last two slipped by half cycles.

    Both by one at least, and by those numbers of them that cost least: all of one are tried that
    the fit of the others leaves likely, each with the best of the other.
    """
    squares = 0.0
    for c in range(count - 2):
        squares += (_residual(steps, x, c) / steps.sigma_m[c]) ** 2
    i, j = count - 2, count - 1
    # the turn of the line of sight, which the threshold allows for, is uncertain here as well
    of_i = steps.sigma_m[i] ** 2 + steps.turn_m[i] ** 2 + _of_fit(steps, cofactor, i, i)
    of_j = steps.sigma_m[j] ** 2 + steps.turn_m[j] ** 2 + _of_fit(steps, cofactor, j, j)
    common = _of_fit(steps, cofactor, i, j)
    step_i, step_j = _residual(steps, x, i), _residual(steps, x, j)
    half_i, half_j = 0.5 * steps.wavelength_m[i], 0.5 * steps.wavelength_m[j]
    nearest = np.floor(step_i / half_i + 0.5)
    width = int(min(np.ceil(4.0 * np.sqrt(of_i) / half_i), _WIDEST))
    least = np.inf
    for beside in range(-width, width + 1):
        slip = nearest + beside
        if slip != 0.0:
            gap_i = step_i - slip * half_i
            left = step_j - common / of_i * gap_i
            other = np.floor(left / half_j + 0.5)
            if other == 0.0:
                other = 1.0 if left > 0.0 else -1.0
            gap_j = left - other * half_j
            cost = gap_i * gap_i / of_i + gap_j * gap_j / (of_j - common * common / of_i)
            least = min(least, cost)
    return squares + least


@inner
def _residual(steps: _Steps, x: FloatArray, row: int) -> float:
    """Return what the fit leaves of a step."""
    left: float = steps.y_m[row]
    for p in range(_UNKNOWNS):
        left -= steps.A[row, p] * x[p]
    return left


@inner
def _of_fit(steps: _Steps, cofactor: FloatArray, i: int, j: int) -> float:
    """Return the covariance of the steps that the fit expects of two rows."""
    total = 0.0
    for p in range(_UNKNOWNS):
        for q in range(_UNKNOWNS):
            total += steps.A[i, p] * cofactor[p, q] * steps.A[j, q]
    return total


@inner
def _swap(steps: _Steps, i: int, j: int) -> None:
    for p in range(_UNKNOWNS):
        steps.A[i, p], steps.A[j, p] = steps.A[j, p], steps.A[i, p]
    for row in (steps.y_m, steps.sigma_m, steps.turn_m, steps.wavelength_m):
        row[i], row[j] = row[j], row[i]
    steps.channel[i], steps.channel[j] = steps.channel[j], steps.channel[i]


@inner
def _fit(steps: _Steps, count: int, cofactor: FloatArray, x: FloatArray) -> bool:
    """Weighted least squares of the first ``count`` rows; False if the geometry is singular."""
    pull = _normal(steps, count, cofactor)
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


@inlined
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


@inlined
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
