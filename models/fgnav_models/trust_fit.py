"""A candidate's residuals where some links are worse than stated, without knowing which.

Each link is as stated or, with a chance of ``SHARE``, worse by ``WORSE_PHASE_M`` and
``WORSE_CODE_M``: a mixture of two Gaussians. Attitude, antenna offsets and satellite offsets, code
and phase of each group each with their own, are where expectation maximisation [1]_ from least
squares leads; integrated around there (Laplace), they leave the candidate's likelihood.

References
----------
.. [1] A. P. Dempster, N. M. Laird, D. B. Rubin, "Maximum likelihood from incomplete data via the EM
   algorithm", J. Royal Statistical Society B 39, 1977.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.kernels.compiled import kernel

# Of the data the network learns from, in the middle; how much of it there is, it learns itself.
SHARE = 0.08
WORSE_PHASE_M, WORSE_CODE_M = 0.015, 1.5

_STEPS, _SETTLED = 8, 0.02  # of the log likelihood, which grows at every step
_SINGULAR = 1e-9  # of a pivot to its diagonal: below, nothing determines the unknown
# Information on the rotation from elsewhere, per rad2: an array in a line leaves one angle open.
_ROTATION = 1.0


class Links(NamedTuple):
    """Links of one epoch: those of ``a`` antennas to ``m`` channels."""

    is_present: BoolArray  # (a, m)
    group: IntArray  # (m,): antennas have an offset in each
    arm: FloatArray  # (a, m, 3): how the range grows with a rotation about the axes of n
    variance_m2: FloatArray  # (2, m): of phase and code
    log_odds: FloatArray  # (m,): to be worse, of a link without residual


class Fit(NamedTuple):
    """Residuals of phase and code, and what determines the unknowns."""

    residual_m: FloatArray  # (2, a, m); 0 where there is no link
    log_determinant: float  # of the information on all unknowns


@kernel
def least_squares(value_m: FloatArray, links: Links) -> Fit:
    """Fit phase and code of links, (2, a, m), by their stated variances."""
    return _fitted(value_m, np.zeros(links.is_present.shape), links)


@kernel
def mixture(value_m: FloatArray, links: Links, start: Fit, worse: FloatArray) -> tuple[Fit, float]:
    """Fit the mixture; return its log likelihood as well, and fill in ``worse``, (a, m).

    That is the probability of each link to be worse than stated.
    """
    fit, density = start, _log_density(start.residual_m, links, worse)
    for _ in range(_STEPS):
        fit = _fitted(value_m, worse, links)
        before, density = density, _log_density(fit.residual_m, links, worse)
        if density - before < _SETTLED:
            break
    return fit, density


@kernel
def log_odds(variance_m2: FloatArray) -> FloatArray:
    """Return the log odds, (m,), that a link without residual is worse than stated."""
    out = np.full(variance_m2.shape[1], np.log(SHARE / (1.0 - SHARE)))
    for s in range(2):
        out -= 0.5 * np.log1p(_added_m2(s) / variance_m2[s])
    return out


@kernel
def _added_m2(s: int) -> float:
    return (WORSE_PHASE_M if s == 0 else WORSE_CODE_M) ** 2


@kernel
def _log_density(residual_m: FloatArray, links: Links, worse: FloatArray) -> float:
    """Return the log density of residuals against that of none; fill in who is worse, (a, m)."""
    total = 0.0
    for i in range(worse.shape[0]):
        for j in range(worse.shape[1]):
            if not links.is_present[i, j]:
                continue
            odds = links.log_odds[j]
            for s in range(2):
                variance = links.variance_m2[s, j]
                square = 0.5 * residual_m[s, i, j] ** 2
                total -= square / variance
                odds += square * (1.0 / variance - 1.0 / (variance + _added_m2(s)))
            small = np.exp(-abs(odds))
            total += max(odds, 0.0) + np.log1p(small) - np.log1p(np.exp(links.log_odds[j]))
            worse[i, j] = (1.0 if odds > 0.0 else small) / (1.0 + small)
    return total


@kernel
def _fitted(value_m: FloatArray, worse: FloatArray, links: Links) -> Fit:
    """Take out of phase and code what rotation and offsets explain.

    Offsets of phase and code of each group meet in the rotation alone: each has normal equations of
    its own, satellites eliminated, whose columns are antennas but the first, the rotation's axes
    and the value. Eliminating the antennas leaves those of the rotation, which add up.
    """
    a, m = links.is_present.shape
    groups, left = links.group.max() + 1, a - 1
    normal = np.zeros((2, groups, left + 4, left + 4))
    rotation = np.zeros((4, 4))
    for c in range(3):
        rotation[c, c] = _ROTATION
    weight, columns = _weights(worse, links), np.empty((a, 4))
    logarithm = 0.0
    for s in range(2):
        for j in range(m):
            columns[:, :3], columns[:, 3] = links.arm[:, j], value_m[s, :, j]
            logarithm += _add_channel(weight[s, :, j], columns, normal[s, links.group[j]])
        for g in range(groups):
            logarithm += _eliminate(normal[s, g], left)
            rotation += normal[s, g, left:, left:]
    logarithm += _eliminate(rotation, 3)
    unknowns = np.zeros(left + 3)
    _substitute(rotation, 3, unknowns[left:])
    residual_m = np.zeros((2, a, m))
    for s in range(2):
        for g in range(groups):
            _substitute(normal[s, g], left, unknowns)
            for j in range(m):
                if links.group[j] == g:
                    arm = links.arm[:, j]
                    _residuals(
                        value_m[s, :, j], weight[s, :, j], arm, unknowns, residual_m[s, :, j]
                    )
    return Fit(residual_m, logarithm)


@kernel
def _weights(worse: FloatArray, links: Links) -> FloatArray:
    """Return the expected inverse variances of links, (2, a, m); 0 where there is none."""
    weight = np.zeros((2, *worse.shape))
    for i in range(worse.shape[0]):
        for j in range(worse.shape[1]):
            if links.is_present[i, j]:
                for s in range(2):
                    p, variance = worse[i, j], links.variance_m2[s, j]
                    weight[s, i, j] = (1.0 - p) / variance + p / (variance + _added_m2(s))
    return weight


@kernel
def _add_channel(weight: FloatArray, columns: FloatArray, normal: FloatArray) -> float:
    """Add a channel to the upper half of normal equations, its satellite's offset eliminated."""
    total = weight.sum()
    if total == 0.0:
        return 0.0
    left, size = len(weight) - 1, len(normal)
    mean = np.zeros(size)
    for i in range(len(weight)):
        w = weight[i]
        if i > 0:
            mean[i - 1] = w
            normal[i - 1, i - 1] += w
        for c in range(4):
            of_column = w * columns[i, c]
            mean[left + c] += of_column
            if i > 0:
                normal[i - 1, left + c] += of_column
            for d in range(c, 4):
                normal[left + c, left + d] += of_column * columns[i, d]
    for c in range(size):
        share = mean[c] / total
        for d in range(c, size):
            normal[c, d] -= share * mean[d]
    return np.log(total)  # type: ignore[no-any-return]


@kernel
def _eliminate(normal: FloatArray, count: int) -> float:
    """Eliminate the first unknowns in place; return the log determinant of what is determined."""
    logarithm = 0.0
    scale = np.diag(normal).copy()
    for p in range(count):
        pivot = normal[p, p]
        if not pivot > _SINGULAR * scale[p]:
            normal[p, p:] = 0.0
            continue
        logarithm += np.log(pivot)
        for r in range(p + 1, len(normal)):
            factor = normal[p, r] / pivot
            for c in range(r, len(normal)):
                normal[r, c] -= factor * normal[p, c]
    return logarithm


@kernel
def _substitute(normal: FloatArray, count: int, out: FloatArray) -> None:
    """Write the first unknowns, those after them known; what nothing determines is 0."""
    for p in range(count - 1, -1, -1):
        value = normal[p, len(normal) - 1]
        for r in range(p + 1, len(out)):
            value -= normal[p, r] * out[r]
        out[p] = value / normal[p, p] if normal[p, p] > 0.0 else 0.0


@kernel
def _residuals(
    value_m: FloatArray,
    weight: FloatArray,
    arm: FloatArray,
    unknowns: FloatArray,
    out: FloatArray,
) -> None:
    """Write the residuals of a channel, (a,), its satellite's offset taken out."""
    total, mean = 0.0, 0.0
    for i in range(len(out)):
        if weight[i] == 0.0:
            continue
        out[i] = value_m[i] - (unknowns[i - 1] if i > 0 else 0.0)
        for c in range(3):
            out[i] -= arm[i, c] * unknowns[len(out) - 1 + c]
        total += weight[i]
        mean += weight[i] * out[i]
    for i in range(len(out)):
        if weight[i] > 0.0:
            out[i] -= mean / total
