"""Which states a window linearises anew, and which estimates are too far from there.

One rule for GTSAM's smoother and for the chain. Constants and what has been marginalised beside a
keyframe stay where they are: one shared variable relinearised has the whole window eliminated anew.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.graph.types.states import AUX, RATE, ROTATION

# A keyframe is relinearised when its estimate has moved further than this from where it was:
# rotations err by half the square, 0.003 degree. Beside a gyroscope, where that is a tenth of a
# sigma, at half of it: 0.05 sigma from the batch in places instead of 0.3.
MOVED_RAD = 0.01
_GYROSCOPE_SHARE = 0.5
MOVED_RADPS = 0.05  # of the rate, without a gyroscope: turns by that in 0.1 s
_ERRS_AT_MOST = 0.25  # of sigma, by half the square of a move: 3 % more RMS error
_GYROSCOPE_AUX = 6
# Of the attitude where a window would end in an outage. What is marginalised there stays linearised
# where little was known: after 15 s it had turned by 86 degrees. So it waits, for so long at most.
UNKNOWN_RAD, WAITS_S = 0.5, 30.0
# And of the first that leave, beside a gyroscope: what they are linearised at errs by half the
# square, a quarter of the 0.05 degree that flights are known to later.
_SHARP_RAD = 0.02

BLOCK_S = 1.0  # that a window is solved with at once, and of what is marginalised
SLOW_S = 0.5  # attitudes this far apart move too far for one linearisation
_FINE = 0.5  # of a usual move: between them states are relinearised sooner
_MUCH = 20.0  # times as far as else, after an outage: at once
REPEATS = 5  # relinearisations after one update, at most; the next update goes on


@dataclass(slots=True)
class Leaving:
    """Whether what has left a window may be marginalised, which ends its relinearisation.

    Attributes
    ----------
    was_known : bool
        Whether the attitude was, where the window began.
    has_begun : bool
        Whether any may have.
    """

    was_known: bool = False
    has_begun: bool = False

    def may(self, sigma_rad: float, span_s: float, width: int) -> bool:
        """Return whether a window may begin where the attitude is known to ``sigma_rad``.

        Parameters
        ----------
        sigma_rad : float
            All axes.
        span_s : float
            Of what is in the window yet.
        width : int
            D of its keyframes.
        """
        is_first = width == AUX + _GYROSCOPE_AUX and not self.has_begun
        is_known = sigma_rad < (_SHARP_RAD if is_first else UNKNOWN_RAD)
        waits = (is_first or self.was_known) and span_s < WAITS_S
        self.was_known |= is_known
        self.has_begun |= is_known or not waits
        return is_known or not waits


def repeats_at(steps: FloatArray, is_slow: bool) -> float | None:
    """Return from how far on, times as usual, states are relinearised at once after an update.

    Parameters
    ----------
    steps : ndarray, shape (n, D)
        From where keyframes are linearised to their estimates.
    is_slow : bool
        Whether attitudes are further apart than ``SLOW_S``.

    Returns
    -------
    float or None
        None: the next update does it.
    """
    if is_slow:
        return _FINE
    is_moved = bool(np.abs(steps[-1, ROTATION]).max() > 2 * MOVED_RAD)
    return 1.0 if is_moved or moved_far(steps, _MUCH).any() else None


def moved_far(steps: FloatArray, times: float = 1.0) -> BoolArray:
    """Return which keyframes are to be linearised anew, (n,), by their steps, (n, D).

    ``times`` as far as else counts as far.
    """
    turned = np.abs(steps[:, ROTATION]).max(axis=1)
    if steps.shape[1] == AUX + _GYROSCOPE_AUX:
        return np.asarray(turned > times * _GYROSCOPE_SHARE * MOVED_RAD)
    far = turned > times * MOVED_RAD
    return np.asarray(far | (np.abs(steps[:, RATE]).max(axis=1) > times * MOVED_RADPS))


def is_rough(steps: FloatArray, covariance: FloatArray) -> BoolArray:
    """Return which of m estimates are too far from where they are linearised, (m,).

    An attitude unknown to half a radian and more is wherever it is linearised: its sigma says so.

    Parameters
    ----------
    steps : ndarray, shape (m, D)
        From there to the estimates.
    covariance : ndarray, shape (m, D, D)
    """
    turned = np.linalg.norm(steps[:, ROTATION], axis=1)
    sigma = np.sqrt(np.einsum("nii->n", covariance[:, ROTATION, ROTATION]))
    far = (turned > 2 * MOVED_RAD) & (turned**2 / 2 > _ERRS_AT_MOST * sigma)
    return np.asarray(far & (sigma < UNKNOWN_RAD))
