"""Times in which a body turns far more briskly than it usually does: a throw, a start off trim.

One intensity for the whole flight would be too small there, and too large everywhere else.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother.cross_validation_kernel import deletion_residuals
from fgnav.methods.smoother.density import angular_acceleration_density

_WINDOW_S = 1.0
_FEWEST = 5  # attitudes of a window that tell anything, and of a flight without its bursts
_FALSE_ALARM = 1e-2  # of a flight that has no burst: it loses little by one
_BESIDE = 3  # attitudes on either side, from which a burst begins and where it ends


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Intensity:
    """Of white angular acceleration about the body axes, (rad/s2)2/Hz.

    Attributes
    ----------
    usual : ndarray, shape (3,)
    bursts_s : ndarray, shape (g, 2)
    bursts : ndarray, shape (g, 3)
    """

    usual: FloatArray
    bursts_s: FloatArray
    bursts: FloatArray

    @classmethod
    def steady(cls, usual: FloatArray) -> "Intensity":
        """Return an intensity without bursts."""
        return cls(usual=usual, bursts_s=np.empty((0, 2)), bursts=np.empty((0, 3)))

    @property
    def notes(self) -> tuple[str, ...]:
        """When the body turned more briskly, one sentence each."""
        return tuple(
            f"Brisk turns from {from_s:.2f} to {until_s:.2f} s: angular acceleration density about "
            f"the body axes {', '.join(f'{value:.2g}' for value in own)} (rad/s2)2/Hz."
            for (from_s, until_s), own in zip(self.bursts_s, self.bursts, strict=True)
        )

    def at(self, t_s: FloatArray) -> FloatArray:
        """Return the intensity between times, (n,), as (n - 1, 3)."""
        density, middle_s = np.tile(self.usual, (len(t_s) - 1, 1)), (t_s[1:] + t_s[:-1]) / 2
        for (from_s, until_s), own in zip(self.bursts_s, self.bursts, strict=True):
            density[(middle_s > from_s) & (middle_s < until_s)] = own
        return density


def intensity(t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray) -> Intensity:
    """Return the intensity of a flight, and where it is larger.

    Attitudes of a second together must be foretold by all others as well as chance allows; where
    they are not, that time has an intensity of its own, and the rest is told anew without it.

    Parameters
    ----------
    t_s, R_nb, covariance_rad2 : ndarray, shape (n,), (n, 3, 3), (n, 3, 3)
        As in ``angular_acceleration_density``.
    """
    usual = angular_acceleration_density(t_s, R_nb, covariance_rad2)
    square, _ = deletion_residuals(t_s, R_nb, covariance_rad2, usual)
    runs = _loud(t_s, square)
    quiet = np.ones(len(t_s), dtype=np.bool_)
    for run in runs:
        quiet[run] = False
    if not runs or quiet.sum() < _FEWEST:
        return Intensity.steady(usual)
    usual = angular_acceleration_density(t_s[quiet], R_nb[quiet], covariance_rad2[quiet])
    wide = [np.arange(max(r[0] - _BESIDE, 0), min(r[-1] + 1 + _BESIDE, len(t_s))) for r in runs]
    own = [angular_acceleration_density(t_s[r], R_nb[r], covariance_rad2[r]) for r in wide]
    spans_s = np.array([[t_s[r[0]], t_s[r[-1]]] for r in wide])
    return Intensity(usual=usual, bursts_s=spans_s, bursts=np.maximum(usual, own))


def _loud(t_s: FloatArray, square: FloatArray) -> list[IntArray]:
    """Return runs of attitudes that the others foretell worse than chance allows."""
    window = ((t_s - t_s[0]) // _WINDOW_S).astype(np.int64)
    told = np.isfinite(square)
    windows = window[-1] + 1
    count = np.bincount(window[told], minlength=windows)
    total = np.bincount(window[told], square[told], minlength=windows)
    most = chdtri(3 * count.clip(1), _FALSE_ALARM / windows)
    loud = np.flatnonzero((count >= _FEWEST) & (total > most))
    runs = np.split(loud, np.flatnonzero(np.diff(loud) > 1) + 1)
    return [np.flatnonzero((window >= r[0]) & (window <= r[-1])) for r in runs if len(r)]
