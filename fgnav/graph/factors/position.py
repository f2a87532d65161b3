"""Positions of one antenna, with lever arm.

``r = W (p_n + R_nb (a_b + l_b) - z_n)``: accelerometer at p_n, antenna at a_b from it as the flight
states, l_b what that is off [1]_.

References
----------
.. [1] Groves: Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd
   edition, 2013, section 14.3.1: innovation of a loosely coupled position.
"""

from dataclasses import dataclass
from typing import ClassVar

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph import keys
from fgnav.graph.sensor_rows import SensorRows, Shapes, sensor_factor
from fgnav.graph.types.arrays import contiguous, zero_rows
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import kernel

LEVER_ARM = "lever-arm"  # the constant l_b


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Position(SensorRows):
    """Positions of an antenna in ``n``, three rows each."""

    name: ClassVar[str] = "position"
    timed_by_receiver: ClassVar[bool] = True
    rows: ClassVar[int] = 3
    parameters: ClassVar[tuple[str, ...]] = (LEVER_ARM,)
    whitening: ClassVar[str] = "white"
    shapes: ClassVar[Shapes] = {"value_n_m": ("k", 3), "white": ("k", 3, 3), "arm_b_m": (3,)}
    value_n_m: FloatArray  # (k, 3)
    # W: inverse Cholesky factors of covariances; rows of zeros for what is not known.
    white: FloatArray  # (k, 3, 3)
    arm_b_m: FloatArray  # (3,): from the accelerometer to the antenna

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of positions ``indices``, (j,); see ``Sensor``."""
        return Linearised._make(
            _kernel(
                *contiguous(at, indices),
                self.value_n_m,
                self.white,
                self.arm_b_m,
                self.constants.column(LEVER_ARM),
            )
        )

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return position i as a factor of keyframe ``key``: native without constants."""
        if self.constants.column(LEVER_ARM) >= 0:
            return sensor_factor(self, i, key, ("pose",))
        noise = gtsam.noiseModel.Gaussian.SqrtInformation(self.white[i], False)
        return gtsam.GPSFactorArm(keys.pose(key), self.value_n_m[i], self.arm_b_m, noise)


@kernel
def _kernel(
    at: States,
    indices: IntArray,
    value_n_m: FloatArray,
    whites: FloatArray,
    arm_b_m: FloatArray,
    lever: int,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    value, state, shared = zero_rows(at, indices, 3)
    arm, difference = arm_b_m.copy(), np.empty(3)
    if lever >= 0:
        for c in range(3):
            arm[c] += at.constants[lever + c]
    cross = rot.skew(arm)
    for k in range(len(indices)):
        i, R = indices[k], at.R_nb[k]
        white = whites[i]
        turned, at_antenna = rot.product(white, R), rot.times(R, arm)
        by_rotation = rot.product(turned, cross)
        for c in range(3):
            difference[c] = at.p_n_m[k, c] + at_antenna[c] - value_n_m[i, c]
        for m in range(3):
            for c in range(3):
                value[k, m] += white[m, c] * difference[c]
                state[k, m, c] = -by_rotation[m, c]
                state[k, m, 3 + c] = turned[m, c]
                if lever >= 0:
                    shared[k, m, lever + c] = turned[m, c]
    return value, state, shared
