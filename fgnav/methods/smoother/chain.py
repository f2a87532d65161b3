"""Gaussian chains: block-tridiagonal normal equations solved with every marginal that is needed.

Each keyframe's state has fifteen dimensions and leans on its neighbours alone, so information runs
along the chain in messages and a flight costs what its length says. A few border dimensions, such
as a landmark's, lean on all keyframes and travel with the messages. All is relative to a point of
linearisation; who linearises is not said here.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.methods.smoother import chain_kernel as kernel
from fgnav.methods.smoother.chain_rows_kernel import eliminate_rows

STATE = kernel.STATE
_NAMES = (
    "attitude",
    "position",
    "velocity",
    "accelerometer bias",
    "angular rate or gyroscope bias",
)
_UNKNOWN = np.array([np.pi, 1e3, 1e3, 1.0, 1.0])  # rad, m, m/s, m/s2, rad/s: as good as nothing


class OpenStateError(NoSolutionError):
    """The data leave a state of a keyframe open.

    Parameters
    ----------
    row : int
        Of the keyframe.
    information : ndarray, shape (15, 15) or more
        What is known of its state.
    """

    def __init__(self, row: int, information: FloatArray) -> None:
        self.row, self.what = row, _least_known(information[:STATE, :STATE])
        super().__init__(f"{self.what}: the data do not determine it at keyframe {row}")

    def at(self, t_s: float) -> NoSolutionError:
        """Return the same with the keyframe's time in place of its row."""
        return NoSolutionError(f"{self.what}: the data do not determine it at {t_s:.2f} s")


def _least_known(information: FloatArray) -> str:
    """Return the name of the part of a state that takes most part in its least known direction."""
    unit = np.repeat(_UNKNOWN, 3)
    _, vectors = np.linalg.eigh(information * np.outer(unit, unit))
    return _NAMES[int(np.linalg.norm(vectors[:, 0].reshape(5, 3), axis=1).argmax())]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Chain:
    """Normal equations of keyframes 0 to n - 1 and what elimination leaves; filled in place.

    Attributes
    ----------
    link : ndarray, shape (n, 31 + b, 31 + b)
        Augmented information of the factors that enter with keyframe k, over the states k - 1 and
        k, the b border dimensions, and the right-hand side: cost ``(f - 2 x'g + x'Hx) / 2``.
    message : ndarray, shape (n, 16 + b, 16 + b)
        The same of state k and the border, of all that entered up to k: the filter's information.
    root : ndarray, shape (n, 15, 15)
        Cholesky factors of the pivots: conditional information of state k given the next.
    gain : ndarray, shape (n, 15, 16 + b)
        ``E[x_k | rest] = gain[:, -1] - gain[:, :-1] @ (x_k+1, border)``.
    """

    link: FloatArray
    message: FloatArray
    root: FloatArray
    gain: FloatArray

    @classmethod
    def empty(cls, n: int, border: int) -> "Chain":
        """Return a chain of n keyframes with room for everything and nothing in it."""
        wide, joint = STATE + border + 1, 2 * STATE + border + 1
        return cls(
            link=np.zeros((n, joint, joint)),
            message=np.zeros((n, wide, wide)),
            root=np.zeros((n, STATE, STATE)),
            gain=np.zeros((n, STATE, wide)),
        )

    @property
    def border(self) -> int:
        """Dimensions that lean on all keyframes."""
        return int(self.message.shape[1]) - STATE - 1

    def take(self, other: "Chain", first: int, count: int) -> None:
        """Copy keyframes of another chain into the first rows of this one."""
        for name in ("link", "message", "root", "gain"):
            getattr(self, name)[:count] = getattr(other, name)[first : first + count]

    def enter(self, k: int, augmented: FloatArray, index: IntArray) -> None:
        """Set what enters with keyframe k: an augmented information and where its rows belong."""
        kernel.place(self.link[k], augmented, index)

    def begin(self, k: int) -> None:
        """Start the chain at keyframe k: nothing comes before what enters with it."""
        self.message[k] = self.link[k, STATE:, STATE:]

    def eliminate(self, first: int, last: int) -> None:
        """Carry the message of keyframe ``first`` on to ``last``.

        Raises
        ------
        OpenStateError
            Naming the state that the data leave open.
        """
        parts = (self.link, self.message, self.root, self.gain)
        failed = kernel.eliminate(*parts, first, last)
        if failed >= 0:  # the digits of squares do not do; those of rows may
            failed = eliminate_rows(*parts, failed, last)
        if failed >= 0:
            raise OpenStateError(failed, self.message[failed])

    def step(self, first: int, last: int) -> tuple[FloatArray, float]:
        """Return how far states are from where they are linearised, and what getting there gains.

        Returns
        -------
        steps : ndarray, shape (last - first + 1, 15 + b)
        least : float
            Twice the least cost of all that entered up to ``last``.

        Raises
        ------
        OpenStateError
            If the newest state is left open.
        """
        steps = np.empty((last - first + 1, STATE + self.border))
        least = kernel.substitute(self.gain, self.message[last], first, last, steps)
        if not np.isfinite(least):
            parts = (self.link, self.message, self.root, self.gain)
            if eliminate_rows(*parts, first, last) < 0:
                least = kernel.substitute(self.gain, self.message[last], first, last, steps)
        if not np.isfinite(least):
            raise OpenStateError(last, self.message[last])
        return steps, float(least)

    def marginals(self, first: int, last: int) -> "Marginals":
        """Return covariances of states first to last, given all that entered up to ``last``.

        Raises
        ------
        OpenStateError
            If the newest state is left open.
        """
        try:
            root = np.linalg.inv(np.linalg.cholesky(self.message[last][:-1, :-1]))
        except np.linalg.LinAlgError as error:
            raise OpenStateError(last, self.message[last]) from error
        newest, count = root.T @ root, last - first + 1
        covariance, beside = np.empty((count, STATE, STATE)), np.empty((count, STATE, self.border))
        cross = kernel.marginals(self.gain, self.root, newest, first, covariance, beside)
        border = newest[STATE:, STATE:].copy()
        return Marginals(covariance=covariance, cross=cross, border=border, beside=beside)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Marginals:
    """Covariances of m neighbouring states.

    Attributes
    ----------
    covariance : ndarray, shape (m, 15, 15)
    cross : ndarray, shape (m - 1, 15, 15)
        Of each state with the next.
    border : ndarray, shape (b, b)
    beside : ndarray, shape (m, 15, b)
        Of each state with the border.
    """

    covariance: FloatArray
    cross: FloatArray
    border: FloatArray
    beside: FloatArray
