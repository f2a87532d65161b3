"""Links of an array that contradict the others of their epoch: excluded, worst first."""

import numpy as np

from fgnav.alignment.array.links import link_sigmas, without
from fgnav.attitude.array import AttitudeSolution, maximum_likelihood, searched_again
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.attitude.robust import robust_attitudes
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.types.differences import DoubleDifferences

_LINK_SIGMAS = 4.5  # beyond, a link contradicts its array
_EXCLUDED_AT_MOST = 0.25  # of an epoch's links; an epoch with more of them is refused
_ROUNDS = 3  # of excluding links


def variance_factor(attitude: AttitudeSolution, *, causal: bool) -> FloatArray:
    """Return by what the noise's variance is raised, (n,)."""
    if causal:
        return attitude.variance_factor_so_far()
    return np.full(len(attitude.solved), attitude.variance_factor())


def excluding(
    differences: DoubleDifferences,
    ranges_m: FloatArray,
    attitude: AttitudeSolution,
    false_alarm: float,
    causal: bool,
) -> tuple[BoolArray, RotationQuadratic, AttitudeSolution]:
    """Return the links, (n, a, m), without which others of their epoch agree; form and attitudes.

    Nothing is excluded where that would take too many.
    """
    n, b, m = ranges_m.shape
    excluded, hopeless = np.zeros((n, b + 1, m), dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    most = _EXCLUDED_AT_MOST * np.isfinite(ranges_m).sum(axis=(1, 2))
    form = RotationQuadratic.of_ranges(differences, ranges_m)
    for _ in range(_ROUNDS):
        factor = variance_factor(attitude, causal=causal)
        fails = attitude.solved & ~attitude.consistent(false_alarm, factor) & ~hopeless
        rows = np.flatnonzero(fails)
        if not len(rows):
            break
        rest_m = without(ranges_m, excluded)
        R_nb = robust_attitudes(differences, rest_m, attitude.R_nb, fails, causal=causal)
        sigmas = _sigmas_off(differences, rest_m, R_nb, rows) / np.sqrt(factor[rows, None, None])
        worst = sigmas.max(axis=(1, 2), keepdims=True)
        excluded[rows] |= sigmas >= np.minimum(worst, _LINK_SIGMAS)
        taken = np.isfinite(ranges_m) & np.isnan(without(ranges_m, excluded))
        hopeless |= taken.sum(axis=(1, 2)) > most
        excluded[hopeless] = False
        form = RotationQuadratic.of_ranges(differences, without(ranges_m, excluded))
        attitude = searched_again(attitude, form, rows, attitude.R_nb[rows])
    return excluded, form, attitude


def _sigmas_off(
    differences: DoubleDifferences, ranges_m: FloatArray, R_nb: FloatArray, rows: IntArray
) -> FloatArray:
    """Return by how many sigmas links of some epochs, (k, a, m), are off the others.

    Robust weights rank them; the rest with its full covariance is three times as
    accurate, and an attitude that is off makes links look off.
    """
    part, ranges_m, R_nb = differences.resampled(rows), ranges_m[rows], R_nb[rows]
    sigmas = link_sigmas(part, ranges_m, R_nb)
    suspects = sigmas > sigmas.max(axis=(1, 2), keepdims=True) / 2
    rest = RotationQuadratic.of_ranges(part, without(ranges_m, suspects))
    return link_sigmas(part, ranges_m, maximum_likelihood(rest, R_nb).R_nb)
