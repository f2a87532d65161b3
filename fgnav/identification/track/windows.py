"""Least squares over windows whose own unknowns are eliminated, with covariances that hold.

Residuals within a window go together in a way that nobody states; windows are independent. So the
covariance is that of the windows' scores about nothing [1]_, and a quotient with it is Student's t
of as many degrees of freedom as there are windows of equal weight [2]_. Which of two set-ups is
nearer to the data is told by the mean logarithm of their likelihoods' quotient over windows [3]_.

References
----------
.. [1] K.-Y. Liang, S. L. Zeger: Longitudinal data analysis using generalized linear models,
   Biometrika 73, 1986.
.. [2] A. V. Carter, K. T. Schnepel, D. G. Steigerwald: Asymptotic behavior of a t-test robust to
   cluster heterogeneity, Review of Economics and Statistics 99, 2017.
.. [3] Q. H. Vuong: Likelihood ratio tests for model selection and non-nested hypotheses,
   Econometrica 57, 1989.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray

FALSE_ALARM = 1e-4  # of a test on a right flight: one finding in ten thousand tests
EXCLUDED = float(-np.log(FALSE_ALARM))  # nats by which what contradicts the stated is likelier
_SPAN_S = 4.0  # a bias that leans by a degree meanwhile adds a decimetre
_EPOCHS = 16  # rows of three: three times as many as a window's own unknowns
FEWEST = 4  # windows below which nothing is said
_GAP = 2.5  # intervals


@dataclass(frozen=True, eq=False, slots=True)
class Windows:
    """Epochs, W times n of them, by row of the series; the last of a short window are outside."""

    row: IntArray
    inside: BoolArray

    def __len__(self) -> int:
        """Return their number, W."""
        return len(self.row)

    def some(self, which: BoolArray) -> "Windows":
        """Return those of a mask, (W,)."""
        return Windows(self.row[which], self.inside[which])


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Fitted:
    """Common unknowns of all windows.

    Attributes
    ----------
    x : ndarray, shape (q,)
    covariance : ndarray, shape (q, q)
    freedom : ndarray, shape (q,)
        Of Student's t of each; 0 where too few windows tell it.
    squares : ndarray, shape (W,)
        Left in each window with the unknowns at zero.
    rows : ndarray of int, shape (W,)
        Degrees of freedom of these.
    """

    x: FloatArray
    covariance: FloatArray
    freedom: FloatArray
    squares: FloatArray
    rows: IntArray

    def sigma(self, i: int) -> float:
        """Return the standard deviation of unknown i; infinite where nothing tells it."""
        return float(np.sqrt(self.covariance[i, i])) if self.freedom[i] > 0 else np.inf

    def reach(self, i: int, tests: int = 1) -> float:
        """Return how far unknown i may be off before a right flight is unlikely to be so."""
        from scipy.stats import t as student  # noqa: PLC0415  # lazy: a slow import

        if self.freedom[i] < 1:
            return np.inf
        return self.sigma(i) * float(student.isf(FALSE_ALARM / tests / 2, self.freedom[i]))


def windows_of(t_s: FloatArray) -> Windows:
    """Return windows of four seconds, of sixteen epochs where these are rare, none across a gap."""
    if len(t_s) < _EPOCHS:
        return Windows(np.zeros((0, 1), dtype=np.int64), np.zeros((0, 1), dtype=np.bool_))
    spacing_s = float(np.median(np.diff(t_s)))
    length_s = max(_SPAN_S, _EPOCHS * spacing_s)
    gap = np.concatenate([[0], np.cumsum(np.diff(t_s) > _GAP * spacing_s)])
    number = np.floor((t_s - t_s[0]) / length_s + 1e-9) + 1e6 * gap
    first = np.flatnonzero(np.diff(number, prepend=-1.0))
    count = np.diff(np.append(first, len(t_s)))
    first, count = first[count >= _EPOCHS - 1], count[count >= _EPOCHS - 1]
    if not len(first):
        return Windows(np.zeros((0, 1), dtype=np.int64), np.zeros((0, 1), dtype=np.bool_))
    place = np.arange(count.max())
    return Windows((first[:, None] + place).clip(max=len(t_s) - 1), place < count[:, None])


def fitted(y: FloatArray, local: FloatArray, common: FloatArray, ridge: FloatArray) -> Fitted:
    """Return the common unknowns of ``y = local a + common x + noise``, a of each window alone.

    Parameters
    ----------
    y : ndarray, shape (W, k)
        Whitened as far as noise is stated; zero where there is no row.
    local : ndarray, shape (W, k, a)
    common : ndarray, shape (W, k, q)
    ridge : ndarray, shape (a,)
        Information about each window's unknowns beforehand.
    """
    W, k, a = local.shape
    q = common.shape[2]
    rows = (np.abs(local).sum(axis=2) > 0).sum(axis=1) - a + int((ridge > 0).sum())
    beforehand = np.broadcast_to(np.diag(np.sqrt(ridge)), (W, a, a))
    Q = np.linalg.qr(np.concatenate([local, beforehand], axis=1))[0][:, :k]
    right = np.concatenate([y[:, :, None], common], axis=2)
    inside = Q.swapaxes(1, 2) @ right
    gram = right.swapaxes(1, 2) @ right - inside.swapaxes(1, 2) @ inside
    squares, score, information = gram[:, 0, 0], gram[:, 1:, 0], gram[:, 1:, 1:]
    total = information.sum(axis=0)
    inverse = np.linalg.pinv(total, hermitian=True)
    x = inverse @ score.sum(axis=0)
    left = score - information @ x
    influence = left @ inverse
    correction = W / max(W - q, 1)
    return Fitted(
        x=x,
        covariance=correction * influence.T @ influence,
        freedom=_freedom(information, inverse, q),
        squares=np.maximum(squares, 0.0),
        rows=rows,
    )


def _freedom(information: FloatArray, inverse: FloatArray, q: int) -> FloatArray:
    """Return degrees of freedom of each unknown: its windows, less where few weigh most."""
    # Share of each window in what is known of an unknown, others eliminated; they add up to 1.
    share = np.einsum("ij,wjk,ki->wi", inverse, information, inverse)
    total = share.sum(axis=0)
    equal = np.where(total > 0, total**2 / np.maximum((share**2).sum(axis=0), 1e-300), 0.0)
    return np.where(equal >= FEWEST, equal - q, 0.0).clip(0.0)


def nearer(stated: Fitted, other: Fitted, tests: int = 1) -> bool:
    """Return whether another set-up is nearer to the data than the stated, of so many tried."""
    from scipy.stats import t as student  # noqa: PLC0415  # lazy: a slow import

    gain = log_quotients(stated, other)
    if len(gain) < FEWEST or gain.mean() <= 0:
        return False
    spread = gain.std(ddof=1) / np.sqrt(len(gain))
    return bool(gain.mean() > spread * student.isf(FALSE_ALARM / tests, len(gain) - 1))


def explains_more(stated: Fitted, other: Fitted, tests: int = 1) -> bool:
    """Return whether another set-up is nearer, or leaves less of the squares than chance."""
    beyond = _log_beyond_chance(stated.squares, other.squares, tests)
    return bool(beyond[-1] > 0) or nearer(stated, other, tests)


def least_from(stated: Fitted, others: list[Fitted]) -> tuple[int, int] | None:
    """Return which of others leaves less than chance from some window on, and that window.

    The one that leaves least beside its bound; None where none does.
    """
    count = len(stated.squares)
    squares = np.stack([one.squares[::-1] for one in others])
    beyond = _log_beyond_chance(stated.squares[::-1], squares, len(others) * count)
    k, windows = np.unravel_index(int(beyond.argmax()), beyond.shape)
    return (int(k), count - 1 - int(windows)) if beyond[k, windows] > 0 else None


def _log_beyond_chance(stated: FloatArray, other: FloatArray, tests: int) -> FloatArray:
    """Return how far beyond chance squares' ratio is, (..., W), of the first n windows of each n.

    An F test in which each window, whatever goes together in it, counts as one vector of three: few
    windows with far less left tell it where their mean gain and its spread do not.
    """
    from scipy.stats import f as fisher  # noqa: PLC0415  # lazy: a slow import

    freedom = 3 * np.arange(1, len(stated) + 1)
    bound = fisher.isf(FALSE_ALARM / tests, freedom, freedom)
    left = bound * (np.cumsum(other, axis=-1) + 1e-12 * stated.sum())
    return np.asarray(np.log(np.cumsum(stated) + 1e-300) - np.log(left + 1e-300))


def log_quotients(stated: Fitted, other: Fitted) -> FloatArray:
    """Return logarithms of both likelihoods' quotient, (W,), each of its own noise."""
    tiny = 1e-12 * (stated.squares.mean() + other.squares.mean()) + 1e-300
    return np.asarray(np.log((stated.squares + tiny) / (other.squares + tiny)) / 2)
