"""Least squares with a few named unknowns, some held at a value: how well each hypothesis fits."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class Regression:
    """Normal equations of ``y = A x + noise``.

    Attributes
    ----------
    information : ndarray, shape (q, q)
    vector : ndarray, shape (q,)
    constant : float
        Square sum of ``y``.
    rows : int
    """

    information: FloatArray
    vector: FloatArray
    constant: float
    rows: int

    @staticmethod
    def of(A: FloatArray, y: FloatArray, ridge: FloatArray | float = 0.0) -> "Regression":
        """Return the equations of A, (k, q), and y, (k,); a ridge, (q,), holds unknowns near 0."""
        information = A.T @ A + np.diag(np.broadcast_to(ridge, A.shape[1]))
        return Regression(information, A.T @ y, float(y @ y), len(y))

    def fit(self, held: dict[int, float]) -> tuple[FloatArray, FloatArray, float]:
        """Return all unknowns, (q,), their covariance at unit noise, (q, q), and the squares left.

        Parameters
        ----------
        held : dict of int to float
            Unknowns held at a value; their variance is 0.
        """
        q = len(self.vector)
        fixed = np.array(sorted(held), dtype=np.int64)
        free = np.setdiff1d(np.arange(q), fixed)
        x, covariance = np.zeros(q), np.zeros((q, q))
        x[fixed] = [held[i] for i in fixed]
        rest = self.vector[free] - self.information[np.ix_(free, fixed)] @ x[fixed]
        inverse = np.linalg.pinv(self.information[np.ix_(free, free)], hermitian=True)
        x[free] = inverse @ rest
        covariance[np.ix_(free, free)] = inverse
        left = self.constant - 2 * x @ self.vector + x @ self.information @ x
        return x, covariance, max(float(left), 0.0)
