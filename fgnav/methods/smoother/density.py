"""How briskly a body turns: the intensity of its angular acceleration, told from attitudes.

Without a gyroscope the smoother takes the angular rate as a random walk. How far it walks is told
by cross-validation: the intensity with which each attitude is best foretold by all the others.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.methods.smoother.cross_validation_kernel import (
    deletion_residuals,
    innovation_residuals,
)
from fgnav.rotations import log, transpose

_FEWEST = 5  # attitudes; two start the filter
_MOST, _BLOCK = 600, 50  # of a longer flight, blocks spread evenly
_LAG_S = 0.5  # of the first guess
_FINE = 20  # parts of an interval, for means over two
_LEAST_GUESS = 1e-4  # (rad/s2)2/Hz
_SMOOTH = 0.1  # of a guess by the lag is closer where the motion is smooth
# (rad/s2)2/Hz. A body that is thrown; and one at rest or in a steady spin: below this, what the
# model leaves out (how samples are integrated at two turns a second) would count as motion.
_LOWEST, _HIGHEST = 1e-6, 1e4
# Of the search over log intensities: differences, the longest step, the least curvature, the gain
# that ends it, the most steps.
_APART = (0.3, -0.3)
_LONGEST, _FLAT, _LEAST_GAIN, _STEPS = 2.0, 1e-3, 0.02, 30
# A wrong attitude is told by its residual: this often, with so many times the variance.
_WRONG_SHARE, _WRONG_VARIANCE = 0.05, 100.0
_CONTRADICTED = 30.0  # square of a residual, 3 expected: once in a million right attitudes
_ROUNDS = 5
_NOTHING_KNOWN = -np.log(8 * np.pi**2)  # score of an attitude that nothing foretold


def angular_acceleration_density(
    t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray, *, ahead: bool = False
) -> FloatArray:
    """Return the intensity of white angular acceleration about the body axes, (rad/s2)2/Hz, (3,).

    The score of an intensity is the log-likelihood of each attitude given all the others (leave one
    out), summed. Where the rate really is a random walk, it finds its intensity as the likelihood
    of a filter's innovations does; where the motion is smooth, it asks how well a smoother does,
    not a filter, which needs ten times the intensity to follow a sine. Attitudes that contradict
    their neighbours are left out.

    Parameters
    ----------
    t_s, R_nb, covariance_rad2 : ndarray, shape (n,), (n, 3, 3), (n, 3, 3)
        Attitudes of single epochs, their errors independent; gaps are allowed.
    ahead : bool
        Whether each attitude is foretold by those before it alone: what a filter is to be given.

    Raises
    ------
    BadInputError
        If there are too few attitudes.

    References
    ----------
    Leave-one-out predictive likelihood: Vehtari and Ojanen, A survey of Bayesian predictive
    methods, Statistics Surveys 6, 2012. Half a log of each intensity is added, which keeps an
    estimate off zero where the score is flat towards it: Chung et al., Psychometrika 78, 2013.
    """
    _enough(t_s)
    attitudes = _Attitudes(t_s, R_nb, covariance_rad2, ahead)[_spread(len(t_s))]
    attitudes, guess = _sound(attitudes)
    return np.exp(climbed(lambda x: _penalised(attitudes, x), np.log(guess)))


def density_of_rough_attitudes(t_s: FloatArray, R_nb: FloatArray) -> FloatArray:
    """Return what intensity, (3,), explains attitudes whose own errors nobody knows.

    Those of a flight without an array err for seconds on end, which no statistics of theirs can
    tell from motion: all that changes counts as motion. Each is a mean over two intervals, which
    keeps a part of that.

    Parameters
    ----------
    t_s, R_nb : ndarray, shape (n,), (n, 3, 3)

    Raises
    ------
    BadInputError
        If there are too few attitudes.
    """
    _enough(t_s)
    told = _by_lag(_Attitudes(t_s, R_nb, np.zeros((len(t_s), 3, 3))))
    return np.asarray(np.clip(told / _kept(_span(t_s)), _LOWEST, _HIGHEST))


def _kept(span: int) -> float:
    """Return the share of a change of rates that means over two intervals leave, of the variance.

    White acceleration counts in the change of the mean rates over two neighbouring spans as much as
    a triangle over both is high; the means blur the triangle.
    """
    even = np.ones(span * _FINE)
    triangle = np.convolve(even, even)
    blurred = np.convolve(triangle, np.full(2 * _FINE, 0.5 / _FINE))
    return float((blurred**2).sum() / (triangle**2).sum())


def _enough(t_s: FloatArray) -> None:
    if len(t_s) < _FEWEST:
        raise BadInputError(
            f"keyframes: {len(t_s)} are too few to tell the angular acceleration; "
            "state angular_acceleration_density"
        )


@dataclass(frozen=True, eq=False, slots=True)
class _Attitudes:
    """Attitudes of single epochs, as in ``angular_acceleration_density``."""

    t_s: FloatArray
    R_nb: FloatArray
    covariance_rad2: FloatArray
    ahead: bool = False

    def __getitem__(self, rows: IntArray) -> "_Attitudes":
        """Return some of them."""
        return replace(
            self,
            t_s=self.t_s[rows],
            R_nb=self.R_nb[rows],
            covariance_rad2=self.covariance_rad2[rows],
        )

    def residuals(self, density: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return squares and log-determinants of ``deletion_residuals``, or of innovations."""
        told = innovation_residuals if self.ahead else deletion_residuals
        return told(self.t_s, self.R_nb, self.covariance_rad2, density)


def _spread(n: int) -> IntArray:
    """Return which of n epochs to look at: all, or blocks of them."""
    if n <= _MOST:
        return np.arange(n)
    starts = np.linspace(0, n - _BLOCK, _MOST // _BLOCK).astype(np.int64)
    return np.unique(starts[:, None] + np.arange(_BLOCK))


def _sound(attitudes: _Attitudes) -> tuple[_Attitudes, FloatArray]:
    """Return the attitudes that agree with their neighbours, and a first guess, (3,).

    The worst of each neighbourhood goes first: it spoils the predictions of those beside it.
    """
    guess = _SMOOTH * _by_lag(attitudes)
    for _ in range(_ROUNDS):
        square = np.pad(np.nan_to_num(attitudes.residuals(guess)[0]), 2)
        around = np.max([square[k : len(square) - 4 + k] for k in (0, 1, 3, 4)], axis=0)
        worst = (square[2:-2] > _CONTRADICTED) & (square[2:-2] > around)
        if not worst.any() or len(worst) - worst.sum() < _FEWEST:
            break
        attitudes = attitudes[np.flatnonzero(~worst)]
        guess = _SMOOTH * _by_lag(attitudes)
    return attitudes, guess


def _span(t_s: FloatArray) -> int:
    """Return how many attitudes further a rate is told, for a first guess."""
    return max(1, min(round(_LAG_S / float(np.median(np.diff(t_s)))), (len(t_s) - 1) // 2))


def _by_lag(attitudes: _Attitudes) -> FloatArray:
    """Return a first guess, (3,), from how much rates over neighbouring spans differ.

    Over spans of length T by a variance of ``2/3 S T`` from the motion, and ``6 sigma^2 / T^2``
    from the attitudes' own noise.
    """
    t_s, R_nb = attitudes.t_s, attitudes.R_nb
    spacing_s, span = float(np.median(np.diff(t_s))), _span(t_s)
    total = np.vstack([np.zeros(3), np.cumsum(log(transpose(R_nb[:-1]) @ R_nb[1:]), axis=0)])
    turn = total[span:] - total[:-span]
    span_s = span * spacing_s
    regular = np.abs(t_s[2 * span :] - t_s[: -2 * span] - 2 * span_s) < 0.1 * spacing_s
    change = ((turn[span:] - turn[:-span]) / span_s)[regular]
    if not len(change):
        return np.full(3, _LEAST_GUESS)
    noise = 6 * np.einsum("nii->ni", attitudes.covariance_rad2).mean(axis=0) / span_s**2
    density = ((change**2).mean(axis=0) - noise) / (2 / 3 * span_s)
    return np.asarray(np.maximum(density, _LEAST_GUESS))


def climbed(score: Callable[[FloatArray], float], x: FloatArray) -> FloatArray:
    """Return where a score of three variables peaks, within bounds: Newton, one axis by one.

    The axes hardly know of each other, so curvatures along them are enough.
    """
    here = score(x)
    longest = _LONGEST
    for _ in range(_STEPS):
        ahead, behind = (np.array([score(x + h * axis) for axis in np.eye(3)]) for h in _APART)
        slope = (ahead - behind) / (2 * _APART[0])
        bend = np.maximum((2 * here - ahead - behind) / _APART[0] ** 2, _FLAT)
        there = np.clip(x + np.clip(slope / bend, -longest, longest), *np.log([_LOWEST, _HIGHEST]))
        gain = score(there) - here
        if gain < 0:
            longest = np.abs(there - x).max() / 4
        else:
            x, here = there, here + gain
        if abs(gain) < _LEAST_GAIN:
            break
    return x


def _penalised(attitudes: _Attitudes, x: FloatArray) -> float:
    """Return the score of log intensities, kept off zero; see ``angular_acceleration_density``."""
    # A filter's is not flat towards zero, but where all is unknown: there it would run away.
    return _score(attitudes, np.exp(x)) + (0.0 if attitudes.ahead else float(x.sum()) / 2)


def _score(attitudes: _Attitudes, density: FloatArray) -> float:
    """Return the log-likelihood of each attitude given the others, summed."""
    square, log_determinant = attitudes.residuals(density)
    told = np.isfinite(square)
    normal = -0.5 * (log_determinant[told] + 3 * np.log(2 * np.pi))
    right = np.log(1 - _WRONG_SHARE) + normal - square[told] / 2
    wrong = np.log(_WRONG_SHARE) + normal - square[told] / (2 * _WRONG_VARIANCE)
    wrong -= 1.5 * np.log(_WRONG_VARIANCE)
    return float(np.logaddexp(right, wrong).sum() + _NOTHING_KNOWN * (~told).sum())
