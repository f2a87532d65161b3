"""Least squares with a few named unknowns, some held at a value: how well each hypothesis fits."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class Regression:
    """Normal equations of ``y = A x + noise``."""

    information: FloatArray  # (q, q)
    vector: FloatArray  # (q,)
    constant: float  # square sum of ``y``
    rows: int

    @staticmethod
    def of(A: FloatArray, y: FloatArray, ridge: FloatArray | float = 0.0) -> "Regression":
        """Return the equations of A, (k, q), and y, (k,); a ridge, (q,), holds unknowns near 0."""
        information = A.T @ A + np.diag(np.broadcast_to(ridge, A.shape[1]))
        return Regression(information, A.T @ y, float(y @ y), len(y))

    def fit(self, held: dict[int, float]) -> tuple[FloatArray, float]:
        """Return all unknowns, (q,), some held at a value, by place, and the squares left."""
        q = len(self.vector)
        fixed = np.array(sorted(held), dtype=np.int64)
        free = np.setdiff1d(np.arange(q), fixed)
        x = np.zeros(q)
        x[fixed] = [held[i] for i in fixed]
        rest = self.vector[free] - self.information[np.ix_(free, fixed)] @ x[fixed]
        x[free] = np.linalg.pinv(self.information[np.ix_(free, free)], hermitian=True) @ rest
        left = self.constant - 2 * x @ self.vector + x @ self.information @ x
        return x, max(float(left), 0.0)
