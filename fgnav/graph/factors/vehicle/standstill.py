"""A body that stands still: the velocity of its accelerometer is zero, a zero velocity update.

``r = v_n / sigma`` [1]_.

References
----------
.. [1] Groves: Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd
   edition, 2013, section 15.3.1.
"""

from dataclasses import dataclass
from typing import ClassVar

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph import keys
from fgnav.graph.sensor_rows import SensorRows, Shapes
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import VELOCITY, States

NAME = "standstill"


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Standstill(SensorRows):
    """Velocities that are zero, three rows each."""

    name: ClassVar[str] = NAME
    shapes: ClassVar[Shapes] = {"sigma_mps": ("k",)}
    rows: ClassVar[int] = 3
    sigma_mps: FloatArray  # (k,): of each axis

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of standstills ``indices``, (j,); see ``Sensor``."""
        weight = 1.0 / self.sigma_mps[indices]
        state, shared = self.derivatives(at)
        state[:, :, VELOCITY] = weight[:, None, None] * np.eye(3)
        return Linearised(weight[:, None] * at.v_n_mps, state, shared)

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return standstill i as a factor of keyframe ``key``."""
        noise = gtsam.noiseModel.Isotropic.Sigma(3, float(self.sigma_mps[i]))
        return gtsam.PriorFactorVector(keys.velocity(key), np.zeros(3), noise)
