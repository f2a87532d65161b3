"""Barometric heights, with lever arm and an offset that drifts slowly.

``r = (p_D + R_D a_b - h - ((1 - s) o_i + s o_i+1)) / sigma``: p_D and R_D the third rows of
position and rotation, a_b the port from the accelerometer, h where the barometer has it along the
third axis of ``n`` [1]_. Offset and drift are estimated at a few times, nodes, with straight lines
between them; how the drift is correlated stands in the covariance of the nodes.

References
----------
.. [1] Groves: Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd
   edition, 2013, section 6.2.1: barometric altimeter.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fgnav.checks import FloatArray, IntArray, freeze, positive
from fgnav.geometry.rotations import skew
from fgnav.graph.sensor_rows import SensorRows, Shapes
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import POSITION, ROTATION, States

OFFSET = "barometer"  # the constants o, metres along the third axis of ``n``


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class BarometricHeight(SensorRows):
    """Barometric heights, one row each.

    Not by ``BarometricFactor``: its offset is one scalar, and it has no lever arm.
    """

    name: ClassVar[str] = "barometric height"
    shapes: ClassVar[Shapes] = {"down_n_m": ("k",), "arm_b_m": (3,), "share": ("k",)}
    rows: ClassVar[int] = 1
    parameters: ClassVar[tuple[str, ...]] = (OFFSET,)
    down_n_m: FloatArray  # (k,): h, where the port is along the third axis of ``n``
    sigma_m: float  # of what is new at each keyframe
    arm_b_m: FloatArray  # (3,): from the accelerometer to the port
    node: IntArray  # (k,): i, the node at or before each keyframe
    share: FloatArray  # (k,): s, of the node after that: 0 to 1

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        SensorRows.__post_init__(self)
        freeze(self.name, self, {"node": self.row.shape}, dtype=int)
        positive("barometric height sigma_m", self.sigma_m)

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of heights ``indices``, (j,); see ``Sensor``."""
        down_b = at.R_nb[:, 2]
        value = at.p_n_m[:, 2] + down_b @ self.arm_b_m - self.down_n_m[indices]
        state, shared = self.derivatives(at)
        state[:, 0, ROTATION] = -down_b @ skew(self.arm_b_m)
        state[:, 0, POSITION] = down_b
        offset = self.constants.columns(OFFSET)
        if offset.stop:
            after, k = self.share[indices], np.arange(len(indices))
            first = offset.start + self.node[indices]
            second = np.minimum(first + 1, offset.stop - 1)
            shared[k, 0, first] = after - 1.0
            shared[k, 0, second] -= after
            value += np.einsum("kb,b->k", shared[:, 0], at.constants)
        return Linearised(
            value[:, None] / self.sigma_m, state / self.sigma_m, shared / self.sigma_m
        )
