"""Errors that last: what independent samples would be as good as a series of correlated ones.

Errors of a first-order Gauss-Markov process, correlated by ``rho(t) = 2^(-t / h)``, are counted
at most every D seconds, their covariance multiplied by ``c = (1 + rho(D)) / (1 - rho(D))``, the sum
of all correlations: n of them, taken as independent, know of a constant what n correlated ones do.
"""

import numpy as np

from fgnav.checks import FloatArray

_SIGMAS = 4.0  # of a correlation of white noise, 1 / sqrt(k): 3e-5
SHOWN_BY = _SIGMAS**2  # samples: of fewer not even a correlation of 1 is significant
_SAME = 1e-6  # of an interval: times are rounded
HALF_LIVES = 2.0  # between errors of a process that are counted as nearly independent
_LAGS = 0.25  # of a series: of longer ones there are too few pairs [1], section 2.1.5


def correlated(r: FloatArray) -> float:
    """Return ``1 + 2 sum(rho)`` of a series of k residuals, (k, m); 1 of white ones.

    Lags up to the first that is not significant count. The mean counts as correlation: residuals
    have none where nothing is wrong. ``k / correlated`` is the effective number of samples [1]_.

    References
    ----------
    .. [1] Box, Jenkins, Reinsel: Time Series Analysis, 4th edition, 2008, section 2.1.6.
    """
    k, total = len(r), float((r**2).sum())
    if total == 0.0:
        return 1.0
    longer = 1.0
    for lag in range(1, int(_LAGS * k) + 1):
        rho = float((r[lag:] * r[:-lag]).sum()) / total
        if rho * np.sqrt(k * r.shape[1]) < _SIGMAS:
            break
        longer += 2 * rho
    return longer


def interval_s(half_life_s: float) -> float:
    """Compute the interval between measurements whose errors are so correlated."""
    return HALF_LIVES * half_life_s


def inflation(half_life_s: float, between_s: float) -> float:
    """Return the factor of covariances of measurements that are so far apart, or further.

    Parameters
    ----------
    half_life_s : float
        0 of independent errors.
    between_s : float
        Positive where errors are correlated.
    """
    if half_life_s == 0:
        return 1.0
    rho = 2.0 ** (-between_s / half_life_s)
    return float((1 + rho) / (1 - rho))


def apart(t_s: FloatArray, between_s: float, first: int = 0) -> list[int]:
    """Select times, (n,), at least an interval apart, from the first one on."""
    rows, row = list[int](), first
    while row < len(t_s):
        rows.append(row)
        row = max(row + 1, int(np.searchsorted(t_s, t_s[row] + between_s * (1 - _SAME))))
    return rows
