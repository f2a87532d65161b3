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

STATE = kernel.STATE
_OPEN = "state: the data do not determine that of keyframe {}"


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

    def eliminate(self, first: int, last: int, damping: float = 0.0) -> None:
        """Carry the message of keyframe ``first`` on to ``last``.

        Parameters
        ----------
        first, last : int
        damping : float
            Levenberg and Marquardt's: this share of the diagonal is added to every pivot.

        Raises
        ------
        NoSolutionError
            Naming the keyframe whose state the data leave open.
        """
        failed = kernel.eliminate(
            self.link, self.message, self.root, self.gain, first, last, 1.0 + damping
        )
        if failed >= 0:
            raise NoSolutionError(_OPEN.format(failed))

    def step(self, first: int, last: int) -> tuple[FloatArray, float]:
        """Return how far states are from where they are linearised, and what getting there gains.

        Returns
        -------
        steps : ndarray, shape (last - first + 1, 15 + b)
        least : float
            Twice the least cost of all that entered up to ``last``.
        """
        steps = np.empty((last - first + 1, STATE + self.border))
        least = kernel.substitute(self.gain, self.message[last], first, last, steps)
        if not np.isfinite(least):
            raise NoSolutionError(_OPEN.format(last))
        return steps, float(least)

    def marginals(self, first: int, last: int) -> "Marginals":
        """Return covariances of states first to last, given all that entered up to ``last``.

        Raises
        ------
        NoSolutionError
            If the newest state is left open.
        """
        try:
            root = np.linalg.inv(np.linalg.cholesky(self.message[last][:-1, :-1]))
        except np.linalg.LinAlgError as error:
            raise NoSolutionError(_OPEN.format(last)) from error
        covariance = np.empty((last - first + 1, STATE, STATE))
        cross = kernel.marginals(self.gain, self.root, root.T @ root, first, covariance)
        return Marginals(covariance=covariance, cross=cross)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Marginals:
    """Covariances of m neighbouring states.

    Attributes
    ----------
    covariance : ndarray, shape (m, 15, 15)
    cross : ndarray, shape (m - 1, 15, 15)
        Of each state with the next.
    """

    covariance: FloatArray
    cross: FloatArray
