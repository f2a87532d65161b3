"""How outputs are counted whose errors are alike: of overlapping windows, or slow ones.

Errors of outputs are taken as a first-order Gauss-Markov process, correlated by
``rho(s) = 2^(-s / h)`` at s seconds apart, h the half-life that the manifest states. Outputs are
taken no closer than an interval D, and the covariance of each is multiplied by

    c = (1 + rho(D)) / (1 - rho(D)).

Of outputs D apart that is the sum of all correlations, so that n of them, taken as independent,
know of a constant what n correlated ones do: n / (c sigma^2), for many. Of any others, and of
states that change, they claim less: by Gershgorin's theorem no eigenvalue of the correlation matrix
exceeds its largest row sum, which is c or less for outputs D apart or more, so that
``C <= c diag(C)`` and the factors' covariance is never smaller than the true one.

By default D is two half-lives, c = 5/3: of what all outputs, however dense, know of a constant,
n D ln 2 / (2 h sigma^2), that keeps 2 (1 - 1/4) / ((1 + 1/4) 2 ln 2) = 87 %.
"""

import numpy as np

from fgnav.checks import FloatArray

HALF_LIVES = 2.0  # between outputs, see above


def interval_s(half_life_s: float) -> float:
    """Return how far apart outputs are taken."""
    return HALF_LIVES * half_life_s


def inflation(half_life_s: float, between_s: float) -> float:
    """Return the factor of covariances of outputs that are so far apart, or further.

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


def half_life_s(t_s: FloatArray, error: FloatArray) -> float:
    """Return the half-life of errors by their autocovariance; 0 where neighbours are independent.

    The time that a first-order process with the same sum of autocorrelations has, which is what
    ``inflation`` counts; the sum ends where the autocorrelation is below its own noise,
    ``2 / sqrt(n)`` [1]_.

    Parameters
    ----------
    t_s : ndarray, shape (n,)
        Evenly spaced times of outputs.
    error : ndarray, shape (n,) or (n, d)
        Normalised by the stated 1-sigma, best; channels are averaged.

    References
    ----------
    .. [1] Box, Jenkins, Reinsel: Time Series Analysis, 4th edition, 2008, section 2.1.6.
    """
    e = error.reshape(len(error), -1)
    n, step_s = len(e), float(np.median(np.diff(t_s)))
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(e, size, axis=0)) ** 2
    covariance = np.fft.irfft(spectrum, size, axis=0)[:n].sum(axis=1) / (n - np.arange(n))
    rho = covariance / covariance[0]
    below = np.flatnonzero(rho < 2 / np.sqrt(n))
    total = rho[1 : int(below[0]) if len(below) else n].sum()
    # rho + rho^2 + ... = rho / (1 - rho) = total
    one = total / (1 + total)
    return float(step_s * np.log(0.5) / np.log(one)) if one > 0 else 0.0
