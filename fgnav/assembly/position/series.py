"""Vectors measured at keyframes, some of them missing."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class VectorSeries:
    """Measurements at keyframes: NaN rows where there is none."""

    value: FloatArray  # (n, 3)
    covariance: FloatArray  # (n, 3, 3)
    arm_b_m: FloatArray  # (3,): from the accelerometer to where it was measured
    antenna: str = ""  # that measured it
    # What whitens values known in some directions only, in place of a covariance; rows of zeros for
    # the others. Zero of values that are known in all.
    partial: FloatArray | None = None  # (n, 3, 3)

    @property
    def valid(self) -> BoolArray:
        """Keyframes that have a value, (n,)."""
        return np.isfinite(self.value[:, 0])

    def white(self, rows: IntArray) -> FloatArray:
        """Compute whitening matrices at keyframes, (k, 3, 3); 0 where nothing is measured."""
        valid, white = np.isfinite(self.value[rows, 0]), np.zeros((len(rows), 3, 3))
        if self.partial is not None:
            white += self.partial[rows]
            valid = valid & ~white.any(axis=(1, 2))
        L = np.linalg.cholesky(self.covariance[rows[valid]])
        inverse = np.tile(np.eye(3), (len(L), 1, 1))
        for i in range(3):  # a tenth of LAPACK's time for matrices this small
            for j in range(i):
                inverse[:, i] -= L[:, i, j, None] * inverse[:, j]
            inverse[:, i] /= L[:, i, i, None]
        white[valid] = inverse
        return white
