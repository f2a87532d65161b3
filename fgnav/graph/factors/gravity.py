"""Directions of gravity, as an estimator sees them in body axes.

``r = A Exp(-t) R_nb' g_n``: g_n the known unit vector, A the whitening rows across the measured
one, t the angles about x_b and y_b by which the instrument is turned in the body.
"""

from dataclasses import dataclass
from typing import ClassVar

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.factors.directions import native, projected
from fgnav.graph.sensor_rows import SensorRows, Shapes, sensor_factor
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import ROTATION, States

TILT = "gravity"  # the constant t, about x_b and y_b


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Gravity(SensorRows):
    """Directions of gravity, two rows each."""

    name: ClassVar[str] = "gravity"
    shapes: ClassVar[Shapes] = {"known_n": ("k", 3), "across_b": ("k", 2, 3)}
    rows: ClassVar[int] = 2
    parameters: ClassVar[tuple[str, ...]] = (TILT,)
    known_n: FloatArray  # (k, 3): unit vectors of gravity at the keyframes
    # Whitening rows of the measured unit vectors; see ``Directions``.
    across_b: FloatArray  # (k, 2, 3)

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of directions ``indices``, (j,); see ``Sensor``."""
        state, shared = self.derivatives(at)
        u_b = np.einsum("kji,kj->ki", at.R_nb, self.known_n[indices])
        tilt, tilt_rad = self.constants.columns(TILT), np.zeros(3)
        if tilt.stop:
            tilt_rad[:2] = at.constants[tilt]
        view = projected(self.across_b[indices], u_b, tilt_rad)
        state[:, :, ROTATION] = view.by_rotation
        shared[:, :, tilt] = view.by_tilt[:, :, : tilt.stop - tilt.start]
        return Linearised(view.value, state, shared)

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return direction i as a factor of keyframe ``key``: native without tilt."""
        if self.constants.column(TILT) >= 0:
            return sensor_factor(self, i, key, ("pose",))
        return native(key, self.across_b[i], self.known_n[i])
