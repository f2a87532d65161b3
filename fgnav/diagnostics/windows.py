"""Least squares over windows with their own unknowns, and tests that hold for coloured residuals.

Residuals within a window are correlated in an unknown way; windows are independent. The covariance
is that of the windows' scores [1]_, and a quotient with it is Student's t of as many degrees of
freedom as windows of equal weight, less one [2]_. Hypotheses are compared by the mean
log-likelihood ratio of windows [3]_.

References
----------
.. [1] K.-Y. Liang, S. L. Zeger: Longitudinal data analysis using generalized linear models,
   Biometrika 73, 1986.
.. [2] A. V. Carter, K. T. Schnepel, D. G. Steigerwald: Asymptotic behavior of a t-test robust to
   cluster heterogeneity, Review of Economics and Statistics 99, 2017.
.. [3] Q. H. Vuong: Likelihood ratio tests for model selection and non-nested hypotheses,
   Econometrica 57, 1989.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import fdtri, stdtrit  # scipy.stats takes half a second to import

from fgnav.checks import BoolArray, FloatArray, IntArray

FALSE_ALARM = 1e-4  # of a test on a flight without mistakes
MIN_WINDOWS = 4
_GAP = 2.5  # intervals


class Windows:
    """Epochs of windows, (W, n), as rows of a series; the last of a short window are outside."""

    def __init__(self, row: IntArray, inside: BoolArray) -> None:
        self.row, self.inside = row, inside

    def __len__(self) -> int:
        """Return their number, W."""
        return len(self.row)

    def some(self, mask: BoolArray) -> "Windows":
        """Return those of a mask, (W,)."""
        return Windows(self.row[mask], self.inside[mask])


class Fitted(NamedTuple):
    """Estimate of q unknowns that all windows share.

    ``freedom``, (q,): of Student's t; 0 where fewer than four windows determine an unknown.
    ``squares``, (W,): residual squares of each window with the shared unknowns at zero.
    """

    x: FloatArray
    covariance: FloatArray
    freedom: FloatArray
    squares: FloatArray

    def sigma(self, i: int) -> float:
        """Return the standard deviation of unknown i; infinite where it is not observable."""
        return float(np.sqrt(self.covariance[i, i])) if self.freedom[i] > 0 else np.inf

    def bound(self, i: int) -> float:
        """Return the size of unknown i that chance exceeds with probability ``FALSE_ALARM``."""
        quantile = -stdtrit(max(self.freedom[i], 1.0), FALSE_ALARM / 2)
        return self.sigma(i) * float(quantile)

    def settled(self) -> bool:
        """Return True if the step left is below a tenth of sigma in every direction."""
        covariance = self.covariance + 1e-8 * np.eye(len(self.x))
        return bool(self.x @ np.linalg.solve(covariance, self.x) <= 0.01)


def windows_of(t_s: FloatArray, span_s: float = 4.0, epochs: int = 16) -> Windows:
    """Return windows of a length, of so many epochs at least, none across a gap.

    Sixteen epochs have three times as many rows as a window has unknowns.
    """
    spacing_s = float(np.median(np.diff(t_s))) if len(t_s) > 1 else 1.0
    gap = np.concatenate([[0], np.cumsum(np.diff(t_s) > _GAP * spacing_s)])[: len(t_s)]
    number = np.floor((t_s - t_s[:1]) / max(span_s, epochs * spacing_s) + 1e-9) + 1e6 * gap
    first = np.flatnonzero(np.diff(number, prepend=-1.0))
    count = np.diff(np.append(first, len(t_s)))
    first, count = first[count >= epochs - 1], count[count >= epochs - 1]
    index = np.arange(count.max(initial=1))
    rows = (first[:, None] + index).clip(max=max(len(t_s) - 1, 0))
    return Windows(rows, index < count[:, None])


def fitted(y: FloatArray, local: FloatArray, common: FloatArray, ridge: FloatArray) -> Fitted:
    """Estimate shared unknowns x of ``y = local a + common x + noise``, a of each window alone.

    Parameters
    ----------
    y : ndarray, shape (W, k)
        Whitened by the nominal noise; zero where there is no row.
    local : ndarray, shape (W, k, a)
    common : ndarray, shape (W, k, q)
    ridge : ndarray, shape (a,)
        Prior information of each window's unknowns.
    """
    W, k, a = local.shape
    prior = np.broadcast_to(np.diag(np.sqrt(ridge)), (W, a, a))
    Q = np.linalg.qr(np.concatenate([local, prior], axis=1))[0][:, :k]
    right = np.concatenate([y[:, :, None], common], axis=2)
    inside = Q.swapaxes(1, 2) @ right
    gram = right.swapaxes(1, 2) @ right - inside.swapaxes(1, 2) @ inside
    squares, score, information = gram[:, 0, 0], gram[:, 1:, 0], gram[:, 1:, 1:]
    inverse = np.linalg.pinv(information.sum(axis=0), hermitian=True)
    x = inverse @ score.sum(axis=0)
    influence = (score - information @ x) @ inverse
    covariance = W / max(W - len(x), 1) * influence.T @ influence
    # Of each unknown the windows' shares of what is known, and how many equal ones these are.
    share = np.einsum("ij,wjk,ki->wi", inverse, information, inverse)
    count = share.sum(axis=0) ** 2 / np.maximum((share**2).sum(axis=0), 1e-300)
    dof = np.where(count >= MIN_WINDOWS, count - 1.0, 0.0)
    return Fitted(x, covariance, dof, np.maximum(squares, 0.0))


def is_better(
    given: FloatArray, other: FloatArray, tests: int = 1, level: float = FALSE_ALARM
) -> bool:
    """Return True if a hypothesis leaves significantly smaller squares, (W,), than the given one.

    By Student's t of the mean log ratio, or by an F test in which a window, whatever is correlated
    within it, counts as one vector of three; of so many tests.
    """
    if not len(given):
        return False
    tiny = 1e-12 * (given.mean() + other.mean()) + 1e-300
    gain, dof = np.log((given + tiny) / (other + tiny)), 3.0 * len(given)
    ratio = (given.sum() + tiny) / (other.sum() + tiny)
    if ratio > fdtri(dof, dof, 1 - level / tests):
        return True
    if len(gain) < MIN_WINDOWS or gain.mean() <= 0:
        return False
    spread = gain.std(ddof=1) / np.sqrt(len(gain))
    return bool(gain.mean() > -spread * stdtrit(len(gain) - 1, level / tests))
