"""Baselines between two antennas, by a receiver: vectors, directions or headings.

``r = W (R_nb b_b - z_n)``: b_b from the first antenna to the second in body axes, z_n measured
[1]_; of a direction both have length one. Of a heading, with e_1 level along it and e_2 level to
its right, ``r = atan2(e_2 . R_nb b_b, e_1 . R_nb b_b) / sigma``: it has one zero on the circle.

References
----------
.. [1] Groves: Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd
   edition, 2013, section 10.2.5: attitude by interferometry of antennas.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotations import skew
from fgnav.graph.sensor_rows import SensorRows, Shapes
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import ROTATION, States

_LEVEL = 1e-6  # square of the level part of a baseline over its own, below which it has no heading


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class BaselineVector(SensorRows):
    """Vectors from one antenna to another in ``n``, three rows each."""

    name: ClassVar[str] = "baseline"
    timed_by_receiver: ClassVar[bool] = True
    rows: ClassVar[int] = 3
    shapes: ClassVar[Shapes] = {"value_n_m": ("k", 3), "white": ("k", 3, 3), "baseline_b_m": (3,)}
    value_n_m: FloatArray  # (k, 3): z_n; of headings e_1
    # W: inverse Cholesky factors of covariances; of headings e_2 over sigma, and rows of zeros.
    white: FloatArray  # (k, 3, 3)
    baseline_b_m: FloatArray  # (3,)
    dimensions: int  # 3 of a vector, 2 of a direction, 1 of a heading

    @property
    def freedom(self) -> IntArray:
        """Directions that are known, (k,)."""
        return np.full(len(self.row), self.dimensions)

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of baselines ``indices``, (j,); see ``Sensor``."""
        state, shared = self.derivatives(at)
        v_n, by_rotation = at.R_nb @ self.baseline_b_m, -at.R_nb @ skew(self.baseline_b_m)
        white, z_n = self.white[indices], self.value_n_m[indices]
        if self.dimensions == 1:
            (north, east), weight = v_n[:, :2].T, np.linalg.norm(white[:, 0], axis=1)
            right, along = z_n[:, 0] * east - z_n[:, 1] * north, (z_n * v_n)[:, :2].sum(axis=1)
            level = np.maximum(north**2 + east**2, _LEVEL * self.baseline_b_m @ self.baseline_b_m)
            moved = north[:, None] * by_rotation[:, 1] - east[:, None] * by_rotation[:, 0]
            state[:, 0, ROTATION] = (weight / level)[:, None] * moved
            value = np.zeros((len(indices), 3))
            value[:, 0] = weight * np.arctan2(right, along)
        else:
            state[:, :, ROTATION] = white @ by_rotation
            value = np.einsum("kij,kj->ki", white, v_n - z_n)
        return Linearised(value, state, shared)
