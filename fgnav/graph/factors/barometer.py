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

import gtsam

from fgnav.checks import FloatArray, IntArray, freeze, positive
from fgnav.graph.sensor_factor import parts_of, sensor_factor
from fgnav.graph.types.arrays import contiguous, room
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.sensor import Linearised, SensorRows, Shapes
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import kernel


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class BarometricHeight(SensorRows):
    """Barometric heights, one row each."""

    name: ClassVar[str] = "barometric height"
    shapes: ClassVar[Shapes] = {"down_n_m": ("k",), "arm_b_m": (3,), "share": ("k",)}
    rows: ClassVar[int] = 1
    down_n_m: FloatArray  # (k,): h, where the port is along the third axis of ``n``
    sigma_m: float  # of what is new at each keyframe
    arm_b_m: FloatArray  # (3,): from the accelerometer to the port
    # First of the constants o, metres along the third axis of ``n``; -1 where there are none.
    column: int
    node: IntArray  # (k,): i, the node at or before each keyframe
    share: FloatArray  # (k,): s, of the node after that: 0 to 1
    constants: Constants

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        SensorRows.__post_init__(self)
        freeze(self.name, self, {"node": self.row.shape}, dtype=int)
        positive("barometric height sigma_m", self.sigma_m)

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of heights ``which``, (j,); see ``Sensor``."""
        return Linearised._make(
            _kernel(
                *contiguous(at, which),
                self.down_n_m,
                1 / self.sigma_m,
                self.arm_b_m,
                self.column,
                self.node,
                self.share,
            )
        )

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return height i as a factor of keyframe ``key``.

        Not ``BarometricFactor``: its offset is one scalar, and it has no lever arm.
        """
        first = self.column + int(self.node[i])
        columns = (first, first + int(self.share[i] > 0)) if self.column >= 0 else ()
        parts = parts_of(self.constants, columns)
        return sensor_factor(self, i, key, ("pose",), parts, rows=1)


@kernel
def _kernel(
    at: States,
    which: IntArray,
    down_n_m: FloatArray,
    weight: float,
    arm_b_m: FloatArray,
    column: int,
    node: IntArray,
    share: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    value, state, shared = room(at, which, 1)
    for k in range(len(which)):
        i, R = which[k], at.R_nb[k]
        apart = at.p_n_m[k, 2] - down_n_m[i]
        for c in range(3):
            after, before = (c + 1) % 3, (c + 2) % 3
            apart += R[2, c] * arm_b_m[c]
            # The third row of -R [a]x.
            state[k, 0, c] = weight * (
                R[2, before] * arm_b_m[after] - R[2, after] * arm_b_m[before]
            )
            state[k, 0, 3 + c] = weight * R[2, c]
        if column >= 0:
            first, s = column + node[i], share[i]
            apart -= (1.0 - s) * at.constants[first]
            shared[k, 0, first] = -weight * (1.0 - s)
            if s > 0.0:
                apart -= s * at.constants[first + 1]
                shared[k, 0, first + 1] = -weight * s
        value[k, 0] = weight * apart
    return value, state, shared
