"""Lines of sight to a landmark, as a detector sees them in body axes.

``r = A Exp(-t) R_nb' (l_n - p_n) / |l_n - p_n|``: l_n the landmark, A the whitening rows across the
measured direction, t the detector's angles about y_b and z_b. To first order the residual of
GTSAM's ``BearingFactor3D``.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotations import transpose
from fgnav.graph.factors.directions import flattened, projected
from fgnav.graph.sensor_rows import SensorRows, Shapes
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import POSITION, ROTATION, States

LANDMARK = "landmark"  # the constant l_n, a place in ``n``
BORESIGHT = "boresight"  # the constant t, about y_b and z_b


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class LineOfSight(SensorRows):
    """Directions from the accelerometer to a landmark, two rows each.

    Not by ``BearingFactor3D``: it whitens along two axes that it lays across the direction by
    rules of its own, so the long axis of an ellipse would be turned.
    """

    name: ClassVar[str] = "line of sight"
    shapes: ClassVar[Shapes] = {"across_b": ("k", 2, 3)}
    rows: ClassVar[int] = 2
    parameters: ClassVar[tuple[str, ...]] = (LANDMARK, BORESIGHT)
    # Whitening rows of the measured unit vectors; see ``Directions``.
    across_b: FloatArray  # (k, 2, 3)

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of directions ``indices``, (j,); see ``Sensor``."""
        state, shared = self.derivatives(at)
        landmark, boresight = map(self.constants.columns, self.parameters)
        R_bn, tilt_rad = transpose(at.R_nb), np.zeros(3)
        if boresight.stop:
            tilt_rad[1:] = at.constants[boresight]
        way_b_m = np.einsum("kij,kj->ki", R_bn, at.constants[landmark] - at.p_n_m)
        u_b, by_way = flattened(way_b_m)
        view = projected(self.across_b[indices], u_b, tilt_rad)
        by_place_b = view.across_b @ by_way
        state[:, :, ROTATION], state[:, :, POSITION] = view.by_rotation, -by_place_b
        shared[:, :, landmark] = by_place_b @ R_bn
        shared[:, :, boresight] = view.by_tilt[:, :, 1 : 1 + boresight.stop - boresight.start]
        return Linearised(view.value, state, shared)
