"""Directions of gravity, as an estimator sees them in body axes.

``r = A Exp(-t) R_nb' g_n``: g_n the known unit vector, A the whitening rows across the measured
one, t the angles about x_b and y_b by which the instrument is turned in the body; its derivative by
them has the right Jacobian of the rotation group in it [1]_.

References
----------
.. [1] Forster, Carlone, Dellaert, Scaramuzza: On-Manifold Preintegration for Real-Time
   Visual-Inertial Odometry, IEEE Transactions on Robotics 33, 2017, section III.
"""

from dataclasses import dataclass
from typing import ClassVar

import gtsam

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph.factors.directions import native
from fgnav.graph.factors.tilt_kernel import ABOUT_X, fill, tilt
from fgnav.graph.sensor_factor import parts_of, sensor_factor
from fgnav.graph.types.arrays import contiguous, room
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.sensor import Linearised, SensorRows, Shapes
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import kernel


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Gravity(SensorRows):
    """Directions of gravity, two rows each."""

    name: ClassVar[str] = "gravity"
    shapes: ClassVar[Shapes] = {"known_n": ("k", 3), "across_b": ("k", 2, 3)}
    rows: ClassVar[int] = 2
    known_n: FloatArray  # (k, 3): unit vectors of gravity at the keyframes
    # Whitening rows of the measured unit vectors; see ``Directions``.
    across_b: FloatArray  # (k, 2, 3)
    tilt_column: int  # first of the two constants t; -1 where the instrument stands as stated
    constants: Constants

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of directions ``which``, (j,); see ``Sensor``."""
        return Linearised._make(
            _kernel(*contiguous(at, which), self.known_n, self.across_b, self.tilt_column)
        )

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return direction i as a factor of keyframe ``key``: native without tilt."""
        if self.tilt_column >= 0:
            parts = parts_of(self.constants, (self.tilt_column,))
            return sensor_factor(self, i, key, ("pose",), parts, rows=2)
        return native(key, self.across_b[i], self.known_n[i])


@kernel
def _kernel(
    at: States, which: IntArray, known_n: FloatArray, across_b: FloatArray, column: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    value, state, shared = room(at, which, 2)
    minus_tilt = tilt(at.constants, column, ABOUT_X)
    turn = rot.exp(minus_tilt)
    for k in range(len(which)):
        i = which[k]
        u_b = rot.times(rot.transposed(at.R_nb[k]), known_n[i])
        across = rot.product(across_b[i], turn)
        fill(value[k], state[k], shared[k], across, u_b, minus_tilt, column, ABOUT_X)
    return value, state, shared
