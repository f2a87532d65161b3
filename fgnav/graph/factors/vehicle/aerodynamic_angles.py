"""A finned body flies nose first: sideslip and angle of attack are small, about a constant mean.

``r = (atan2(u_y, u_x) - m_y, atan2(u_z, u_x) - m_z) / sigma``, ``u = R' (v_n - w)``: v_n the
velocity of the accelerometer, w the wind, north and east, m the mean angles [1]_. It stands for the
velocity of the body's origin: what a lever arm swings by is small beside the speed.

References
----------
.. [1] Neural Networks for Estimating Attitude, Line of Sight, and GNSS Ambiguity Through Onboard
   Sensor Fusion, Sensors, 2025, Eqs. 21-22: the velocity as a vector in two frames.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotations import skew, transpose
from fgnav.graph.sensor_rows import SensorRows, Shapes, Use
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import ROTATION, VELOCITY, States

NAME = "aerodynamic angles"
WIND = "wind"  # the constant w, north and east
MEAN = "mean aerodynamic angles"  # the constant m, sideslip and angle of attack


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AerodynamicAngles(SensorRows):
    """Sideslip and angle of attack that are zero to a sigma, two rows each."""

    name: ClassVar[str] = NAME
    shapes: ClassVar[Shapes] = {"sigma_rad": ("k", 2)}
    rows: ClassVar[int] = 2
    variables: ClassVar[tuple[Use, ...]] = ("pose", "velocity")
    parameters: ClassVar[tuple[str, ...]] = (WIND, MEAN)
    sigma_rad: FloatArray  # (k, 2)

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of angles ``indices``, (j,); see ``Sensor``."""
        wind, mean = map(self.constants.columns, self.parameters)
        R_bn = transpose(at.R_nb)
        air_n_mps = at.v_n_mps.copy()
        air_n_mps[:, :2] -= at.constants[wind]
        u = np.einsum("kij,kj->ki", R_bn, air_n_mps)
        by_u = np.zeros((len(indices), 2, 3))
        for row, axis in enumerate((1, 2)):
            squared = u[:, 0] ** 2 + u[:, axis] ** 2
            by_u[:, row, 0] = -u[:, axis] / squared
            by_u[:, row, axis] = u[:, 0] / squared
        angles = np.arctan2(u[:, 1:], u[:, :1]) - at.constants[mean]
        weight = 1.0 / self.sigma_rad[indices]
        by_u *= weight[:, :, None]
        state, shared = self.derivatives(at)
        state[:, :, ROTATION] = by_u @ skew(u)
        state[:, :, VELOCITY] = by_u @ R_bn
        shared[:, :, wind] = -state[:, :, VELOCITY][:, :, :2]
        shared[:, :, mean] = -weight[:, :, None] * np.eye(2)
        return Linearised(weight * angles, state, shared)
