"""What solving yields: states at keyframes, what they share, and how well both are known."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother.keyframes import Keyframes


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class SharedSolution:
    """What all keyframes share, as the solution has it.

    Attributes
    ----------
    value : ndarray, shape (b,)
    covariance : ndarray, shape (n, b, b)
        At each keyframe: what was known of it by then, of a window; else the same everywhere.
    cross : ndarray, shape (n, 15, b)
        Of each state with it.
    """

    value: FloatArray
    covariance: FloatArray
    cross: FloatArray

    def __getitem__(self, rows: IntArray) -> "SharedSolution":
        """Return what is said of some of the states, (m,) of them."""
        return SharedSolution(
            value=self.value, covariance=self.covariance[rows], cross=self.cross[rows]
        )


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Solution:
    """States of the accelerometer at keyframes, with their covariances.

    Attributes
    ----------
    R_nb, p_n_m, v_n_mps, slot : ndarray, shape (n, 3, 3), (n, 3), (n, 3), (n, 6)
    covariance : ndarray, shape (n, 15, 15)
        Rotation tangent, position, both in body axes (GTSAM's order); velocity in ``n``; slot.
    cross : ndarray, shape (n - 1, 15, 15), or None
        Covariance of each state with the next; None of states that are not of one smoothing.
    converged : bool
    shared : SharedSolution or None
    cost : float
        Sum of all residuals squared, in sigmas; NaN of what is not one minimum.
    """

    R_nb: FloatArray
    p_n_m: FloatArray
    v_n_mps: FloatArray
    slot: FloatArray
    covariance: FloatArray
    cross: FloatArray | None
    converged: bool
    shared: SharedSolution | None = None
    cost: float = np.nan

    @property
    def velocity_covariance_m2ps2(self) -> FloatArray:
        """In the frame ``n``, (n, 3, 3)."""
        return self.covariance[:, 6:9, 6:9]

    @property
    def slot_covariance(self) -> FloatArray:
        """Accelerometer bias, then rate or gyroscope bias, (n, 6, 6)."""
        return self.covariance[:, 9:, 9:]

    def __getitem__(self, rows: IntArray) -> "Solution":
        """Return some of the states, (m,) of them, without their neighbours."""
        return Solution(
            R_nb=self.R_nb[rows],
            p_n_m=self.p_n_m[rows],
            v_n_mps=self.v_n_mps[rows],
            slot=self.slot[rows],
            covariance=self.covariance[rows],
            cross=None,
            converged=self.converged,
            shared=None if self.shared is None else self.shared[rows],
        )


def started_at(keyframes: Keyframes, solution: Solution) -> Keyframes:
    """Return keyframes whose search starts where a solution has their states."""
    return replace(
        keyframes,
        R_nb=solution.R_nb,
        p_n_m=solution.p_n_m,
        v_n_mps=solution.v_n_mps,
        slot=solution.slot,
    )
