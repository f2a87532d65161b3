"""Wheels that roll: no velocity to the side or up at the axle that does not steer.

``r = [u_y u_z] / sigma``, ``u = Exp(-c) (R' v_n + w x (a + l))``: accelerometer at v_n, w the
body's rate against n, a + l the axle from the accelerometer, c = (0, c_y, c_z) the turn from body
axes to those in which wheels roll [1]_.

References
----------
.. [1] Dissanayake, Sukkarieh, Nebot, Durrant-Whyte: The aiding of a low-cost strapdown inertial
   measurement unit using vehicle model constraints for land vehicle applications, IEEE Transactions
   on Robotics and Automation 17(5), 2001.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fgnav.checks import FloatArray, IntArray, positive
from fgnav.geometry.rotation_kernel import right_jacobian
from fgnav.geometry.rotations import exp, skew, transpose
from fgnav.graph.sensor_rows import SensorRows, Shapes, Use, rate_variables
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import ROTATION, VELOCITY, States

NAME = "wheels"
AXES = "wheels' axes"  # the constant c, of c_y and c_z
AXLE = "axle"  # the constant l
_RATE = slice(12, 15)  # the gyroscope's bias, or the rate itself


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class RollingWheels(SensorRows):
    """Velocities across that are zero, two rows each."""

    name: ClassVar[str] = NAME
    shapes: ClassVar[Shapes] = {
        "arm_b_m": (3,),
        "measured_b_radps": ("k", 3),
        "earth_rate_n_radps": (3,),
    }
    rows: ClassVar[int] = 2
    parameters: ClassVar[tuple[str, ...]] = (AXES, AXLE)
    slip_mps: float  # sigma
    arm_b_m: FloatArray  # (3,): a
    # The gyroscope's rates at those keyframes: w is that less the bias and less the Earth's; None
    # without one, where w is a state.
    measured_b_radps: FloatArray | None  # (k, 3)
    earth_rate_n_radps: FloatArray  # (3,)

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        SensorRows.__post_init__(self)
        positive("wheels slip_mps", self.slip_mps)

    @property
    def variables(self) -> tuple[Use, ...]:
        """Variables of a keyframe in the model."""
        return rate_variables(self.measured_b_radps)

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of measurements ``indices``, (j,); see ``Sensor``."""
        axes, axle = map(self.constants.columns, self.parameters)
        arm_b_m = self.arm_b_m + at.constants[axle]
        R_bn, arm = transpose(at.R_nb), skew(arm_b_m)
        v_b = np.einsum("kij,kj->ki", R_bn, at.v_n_mps)
        rate, by_rate, earth = at.aux[:, 3:6], -arm, np.zeros((len(indices), 3, 3))
        if self.measured_b_radps is not None:
            earth_b = np.einsum("kij,j->ki", R_bn, self.earth_rate_n_radps)
            rate, by_rate = self.measured_b_radps[indices] - rate - earth_b, arm
            earth = arm @ skew(earth_b)
        axle_b = v_b + np.cross(rate, arm_b_m)
        turn = np.array([0.0, *at.constants[axes]])
        back = exp(-turn[None])[0]
        weight = 1.0 / self.slip_mps
        state, shared = self.derivatives(at)
        state[:, :, ROTATION] = (back @ (skew(v_b) + earth))[:, 1:]
        state[:, :, VELOCITY] = (back @ R_bn)[:, 1:]
        state[:, :, _RATE] = (back @ by_rate)[1:]
        by_rotation = back @ skew(axle_b) @ right_jacobian(-turn)
        shared[:, :, axes] = by_rotation[:, 1:, 1:]
        shared[:, :, axle] = (back @ skew(rate))[:, 1:]
        return Linearised(weight * (axle_b @ back.T)[:, 1:], weight * state, weight * shared)
