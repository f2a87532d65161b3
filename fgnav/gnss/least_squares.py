"""Weighted least squares of many small independent problems at once, residuals tested."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray

FALSE_ALARM = 1e-4  # of the chi-square test of one epoch


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Fits:
    """Solutions of n problems of p unknowns and m measurements."""

    x: FloatArray  # (n, p): NaN where unsolved, or where no measurement speaks of an unknown
    # Of ``x`` by the stated variances; rows of unknowns nothing speaks of are those of identity.
    covariance: FloatArray  # (n, p, p)
    gain: FloatArray  # (n, p, m): ``x = gain @ y``
    residual: FloatArray  # (n, m): 0 where not used
    freedom: IntArray  # (n,): measurements minus unknowns
    # Measurements suffice; and their residuals pass the chi-square test, if any is spare.
    solved: BoolArray  # (n,)
    consistent: BoolArray  # (n,)
    worst: IntArray  # (n,): sensor with the largest residual over its own standard deviation


def fit(A: FloatArray, y: FloatArray, variance: FloatArray, use: BoolArray) -> Fits:
    """Solve ``y = A x`` for n problems at once.

    Parameters
    ----------
    A : ndarray, shape (n, m, p)
    y, variance : ndarray, shape (n, m)
    use : ndarray of bool, shape (n, m)
        Measurements that take part; the others may be NaN.
    """
    from scipy.special import chdtri  # noqa: PLC0415  # lazy: keeps the command line quick

    weight = np.where(use, 1.0 / np.where(use, variance, 1.0), 0.0)
    A, y = np.where(use[:, :, None], A, 0.0), np.where(use, y, 0.0)
    involved = (A != 0).any(axis=1)  # (n, p)
    freedom = use.sum(axis=1) - involved.sum(axis=1)
    solved = (freedom >= 0) & use.any(axis=1)
    involved &= solved[:, None]
    weighted = np.swapaxes(A * weight[:, :, None], 1, 2)  # (n, p, m)
    N = np.where(involved[:, :, None] & involved[:, None, :], weighted @ A, 0.0)
    # An unknown nothing speaks of gets an equation of its own; a flat geometry a huge covariance.
    diagonal = np.arange(N.shape[1])
    N[:, diagonal, diagonal] = np.where(involved, N[:, diagonal, diagonal] * (1 + 1e-13), 1.0)
    covariance = np.linalg.inv(N)
    gain = covariance @ weighted
    x = _in_turn(gain * y[:, None])
    residual = y - (A @ x[:, :, None])[:, :, 0]
    own_share = 1 - np.einsum("nmp,npm->nm", A, gain)
    standard = np.abs(residual) * np.sqrt(weight / own_share.clip(1e-6))
    chi_square = _in_turn(weight * residual**2)
    passed = chi_square <= chdtri(freedom.clip(1), FALSE_ALARM)
    return Fits(
        x=np.where(involved, x, np.nan),
        covariance=covariance,
        gain=gain,
        residual=residual,
        freedom=freedom,
        solved=solved,
        consistent=solved & ((freedom == 0) | passed),
        worst=standard.argmax(axis=1),
    )


def _in_turn(terms: FloatArray) -> FloatArray:
    """Return sums over the last axis, added one after another.

    So channels that are not used do not change the rounding, as those of satellites that rise
    later: a sum by parts side by side groups the others by where these stand.
    """
    return np.asarray(terms.cumsum(axis=-1)[..., -1])


def fit_consistent(
    A: FloatArray, y: FloatArray, variance: FloatArray, use: BoolArray
) -> tuple[Fits, BoolArray]:
    """Solve as ``fit``, dropping the worst measurement until the residuals are consistent.

    Returns
    -------
    fits : Fits
        A problem whose last spare measurement still contradicts the others is not consistent.
    use : ndarray of bool, shape (n, m)
        What took part in the end.
    """
    use = use.copy()
    while True:
        fits = fit(A, y, variance, use)
        drop = np.nonzero(fits.solved & ~fits.consistent & (fits.freedom > 1))[0]
        if not len(drop):
            return fits, use
        use[drop, fits.worst[drop]] = False
