"""Lines of sight to a landmark, as a detector sees them in body axes.

``r = A Exp(-t) R_nb' (l_n - p_n) / |l_n - p_n|``: l_n the landmark, A the whitening rows across the
measured direction, t the detector's angles about y_b and z_b. To first order the residual of
GTSAM's ``BearingFactor3D``.
"""

from dataclasses import dataclass
from typing import ClassVar

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph.factors.tilt_kernel import ABOUT_Y, fill, tilt
from fgnav.graph.sensor_factor import parts_of, sensor_factor
from fgnav.graph.types.arrays import contiguous, room
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.sensor import Linearised, SensorRows, Shapes
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import kernel


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class LineOfSight(SensorRows):
    """Directions from the accelerometer to a landmark, two rows each."""

    name: ClassVar[str] = "line of sight"
    shapes: ClassVar[Shapes] = {"across_b": ("k", 2, 3)}
    rows: ClassVar[int] = 2
    # Whitening rows of the measured unit vectors; see ``Directions``.
    across_b: FloatArray  # (k, 2, 3)
    landmark_column: int  # first of the three constants l_n, a place in ``n``
    boresight_column: int  # first of the two constants t; -1 where the detector stands as stated
    constants: Constants

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of directions ``which``, (j,); see ``Sensor``."""
        return Linearised._make(
            _kernel(
                *contiguous(at, which), self.across_b, self.landmark_column, self.boresight_column
            )
        )

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return direction i as a factor of keyframe ``key`` and the landmark.

        Not ``BearingFactor3D``: it whitens along two axes that it lays across the direction by
        rules of its own, so the long axis of an ellipse would be turned.
        """
        parts = parts_of(self.constants, (self.landmark_column, self.boresight_column))
        return sensor_factor(self, i, key, ("pose",), parts, rows=2)


@kernel
def _kernel(
    at: States, which: IntArray, across_b: FloatArray, landmark: int, boresight: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    value, state, shared = room(at, which, 2)
    minus_tilt, flat = tilt(at.constants, boresight, ABOUT_Y), np.empty((3, 3))
    turn, way_n_m = rot.exp(minus_tilt), np.empty(3)
    for k in range(len(which)):
        i, to_b = which[k], rot.transposed(at.R_nb[k])
        for c in range(3):
            way_n_m[c] = at.constants[landmark + c] - at.p_n_m[k, c]
        distance_m = np.sqrt(way_n_m[0] ** 2 + way_n_m[1] ** 2 + way_n_m[2] ** 2)
        u_b = rot.scaled(rot.times(to_b, way_n_m), 1 / distance_m)
        for r in range(3):
            for c in range(3):
                flat[r, c] = ((r == c) - u_b[r] * u_b[c]) / distance_m
        across = rot.product(across_b[i], turn)
        fill(value[k], state[k], shared[k], across, u_b, minus_tilt, boresight, ABOUT_Y)
        by_place_b = rot.product(across, flat)
        by_place_n = rot.product(by_place_b, to_b)
        for m in range(2):
            for c in range(3):
                state[k, m, 3 + c] = -by_place_b[m, c]
                shared[k, m, landmark + c] = by_place_n[m, c]
    return value, state, shared
