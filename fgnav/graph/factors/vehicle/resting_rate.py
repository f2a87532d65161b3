"""A wheeled vehicle that stands does not turn: its gyroscope reads its bias and the Earth's rate.

``r = (m - b_g - R_bn w_ie) / sigma``, m the mean of a second at rest: a zero angular rate update
[1]_.

References
----------
.. [1] Groves: Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd
   edition, 2013, section 15.3.2.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotations import skew, transpose
from fgnav.graph.sensor_rows import SensorRows, Shapes, Use
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import RATE, ROTATION, States

NAME = "resting rate"


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class RestingRate(SensorRows):
    """Rates that a gyroscope measures at rest, three rows each."""

    name: ClassVar[str] = NAME
    shapes: ClassVar[Shapes] = {
        "measured_b_radps": ("k", 3),
        "sigma_radps": ("k", 3),
        "earth_rate_n_radps": (3,),
    }
    rows: ClassVar[int] = 3
    variables: ClassVar[tuple[Use, ...]] = ("pose", "imu_bias")
    measured_b_radps: FloatArray  # (k, 3)
    sigma_radps: FloatArray  # (k, 3)
    earth_rate_n_radps: FloatArray  # (3,)

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of rates ``indices``, (j,); see ``Sensor``."""
        weight = 1.0 / self.sigma_radps[indices]
        earth_b = np.einsum("kij,j->ki", transpose(at.R_nb), self.earth_rate_n_radps)
        state, shared = self.derivatives(at)
        state[:, :, ROTATION] = -weight[:, :, None] * skew(earth_b)
        state[:, :, RATE] = -weight[:, :, None] * np.eye(3)
        value = weight * (self.measured_b_radps[indices] - at.aux[:, 3:6] - earth_b)
        return Linearised(value, state, shared)
