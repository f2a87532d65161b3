"""States of keyframes as arrays, their tangent, and steps along it."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotations import exp, log, transpose
from fgnav.process.matern_kernel import DERIVATIVE_SCALE_S as DERIVATIVE_SCALE_S

# Where the parts of a keyframe's tangent stand, in GTSAM's order: the pose's rotation, its position
# (both in body axes), velocity in n, then the vector ``aux``: accelerometer bias and, with a
# gyroscope, its bias (6); else rate, T0 * its first and T0**2 * its second derivative (12).
ROTATION, POSITION, VELOCITY = slice(0, 3), slice(3, 6), slice(6, 9)
ACCELEROMETER_BIAS, RATE = slice(9, 12), slice(12, 15)  # RATE: of the gyroscope's bias with one
AUX = 9
GYROSCOPE_AUX = 6  # dimensions of ``aux`` with a gyroscope
__all__ = [
    "ACCELEROMETER_BIAS",
    "AUX",
    "DERIVATIVE_SCALE_S",
    "GYROSCOPE_AUX",
    "POSITION",
    "RATE",
    "ROTATION",
    "VELOCITY",
    "States",
]


class States(NamedTuple):
    """States of n keyframes, with the constants of all.

    The body point is the accelerometer. ``aux`` holds the accelerometer's bias and the gyroscope's;
    without a gyroscope the accelerometer's bias, rate, its scaled derivatives, and q dimensions of
    the array's time-correlated error, where it has one.
    """

    R_nb: FloatArray  # (n, 3, 3)
    p_n_m: FloatArray  # (n, 3)
    v_n_mps: FloatArray  # (n, 3)
    aux: FloatArray  # (n, 6) with a gyroscope, (n, 12 + q) without
    constants: FloatArray  # (b,)

    @property
    def width(self) -> int:
        """Dimensions D of one keyframe's tangent: 15 with a gyroscope, else 21 + q.

        q are those of the array's time-correlated error; 0 without one.
        """
        return AUX + int(self.aux.shape[1])

    def at(self, rows: IntArray | slice) -> "States":
        """Select keyframes, with all constants."""
        return States(
            R_nb=self.R_nb[rows],
            p_n_m=self.p_n_m[rows],
            v_n_mps=self.v_n_mps[rows],
            aux=self.aux[rows],
            constants=self.constants,
        )

    def copied(self) -> "States":
        """Copy the arrays."""
        return States._make(np.array(array, order="C") for array in self)

    def moved(self, steps: FloatArray, constant_steps: FloatArray) -> "States":
        """Return the states a step away, (n, D) along their tangents and (b,)."""
        return States(
            R_nb=self.R_nb @ exp(steps[:, ROTATION]),
            p_n_m=self.p_n_m + np.einsum("nij,nj->ni", self.R_nb, steps[:, POSITION]),
            v_n_mps=self.v_n_mps + steps[:, VELOCITY],
            aux=self.aux + steps[:, AUX:],
            constants=self.constants + constant_steps,
        )

    def steps_to(self, other: "States") -> FloatArray:
        """Return the steps along the tangents of these that lead to other states, (n, D)."""
        return np.hstack(
            [
                log(transpose(self.R_nb) @ other.R_nb),
                np.einsum("nji,nj->ni", self.R_nb, other.p_n_m - self.p_n_m),
                other.v_n_mps - self.v_n_mps,
                other.aux - self.aux,
            ]
        )
