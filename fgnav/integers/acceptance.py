"""Acceptance of a search's integers, and the account of those refused."""

from collections.abc import Mapping

import numpy as np

from fgnav.checks import BoolArray, FloatArray, Unused
from fgnav.types.differences import DoubleDifferences

HANDED_OVER = "epoch's trust"  # of a loss: an epoch that a network leaves to another resolver
WITHOUT_CODE = "phase without code"

_SMALLEST_NORM = 1e-30  # noise-free data can hit the float solution exactly: the ratio stays finite


def ratio(squared_norms: FloatArray) -> FloatArray:
    """Return second-best over best squared norm, (n, b), of (n, b, 2); NaN stays NaN."""
    return np.asarray(squared_norms[..., 1] / np.maximum(squared_norms[..., 0], _SMALLEST_NORM))


def share_threshold(
    statistic: FloatArray, wrong_probability: FloatArray, wrong_max: float
) -> float:
    """Return the lowest statistic from which on no larger share is expected to be wrong than asked.

    Whoever accepts all from there accepts as much as can be at that share; with minus the
    probability as statistic it is the Bayesian control of the false discovery rate [1]_. What is
    more likely wrong than right is never in.

    Parameters
    ----------
    statistic : ndarray, shape (n,)
        Larger is better.
    wrong_probability : ndarray, shape (n,)
    wrong_max : float
        Share of the accepted.

    Returns
    -------
    float
        NaN, which nothing passes, where not even the best may be accepted.

    References
    ----------
    .. [1] M. A. Newton, A. Noueiry, D. Sarkar, P. Ahlquist, "Detecting differential gene expression
       with a semiparametric hierarchical mixture method", Biostatistics 5, 2004.
    """
    order = np.lexsort((wrong_probability, -statistic))
    statistic, wrong = statistic[order], wrong_probability[order]
    share = np.cumsum(wrong) / np.arange(1, len(wrong) + 1)
    # equals are accepted together or not at all
    last_of_equals = np.append(statistic[1:] != statistic[:-1], True)[: len(statistic)]
    safe = np.flatnonzero((share <= wrong_max) & last_of_equals & (wrong <= 0.5))
    return float(statistic[safe[-1]]) if len(safe) else np.nan


def share_so_far(wrong_probability: FloatArray, wrong_max: float) -> BoolArray:
    """Return the mask, (n,), of epochs accepted by the ``share_threshold`` of those up to each.

    An epoch is judged as if the flight ended with it: it is accepted where the mean probability of
    all epochs so far that are no more likely wrong is at most the share asked for.

    Parameters
    ----------
    wrong_probability : ndarray, shape (n,)
    wrong_max : float
        Share of the accepted.
    """
    accepted = np.asarray(wrong_probability <= min(wrong_max, 0.5))
    for k in np.flatnonzero(~accepted & (wrong_probability <= 0.5)):
        so_far = wrong_probability[: k + 1]
        accepted[k] = so_far[so_far <= so_far[k]].mean() <= wrong_max
    return accepted


def not_fixed(links: Mapping[str, BoolArray]) -> tuple[Unused, ...]:
    """Return one loss for each reason that holds of any link, (n, b, m)."""
    return tuple(
        Unused(what="double difference", reason=reason, count=int(affected.sum()))
        for reason, affected in links.items()
        if affected.any()
    )


def phase_links(differences: DoubleDifferences) -> BoolArray:
    """Return the links, (n, b, m), whose phase has an unknown integer, with or without code."""
    return np.isfinite(differences.phase_m) & ~differences.is_reference[:, None, :]
