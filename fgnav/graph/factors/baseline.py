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

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph.sensor_factor import sensor_factor
from fgnav.graph.types.arrays import contiguous, room
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.sensor import Linearised, SensorRows, Shapes
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import kernel

_LEVEL = 1e-6  # square of the level part of a baseline over its own, below which it has no heading


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class BaselineVector(SensorRows):
    """Vectors from one antenna to another in ``n``, three rows each."""

    name: ClassVar[str] = "baseline"
    shapes: ClassVar[Shapes] = {"value_n_m": ("k", 3), "white": ("k", 3, 3), "baseline_b_m": (3,)}
    value_n_m: FloatArray  # (k, 3): z_n; of headings e_1
    # W: inverse Cholesky factors of covariances; of headings e_2 over sigma, and rows of zeros.
    white: FloatArray  # (k, 3, 3)
    baseline_b_m: FloatArray  # (3,)
    dimensions: int  # 3 of a vector, 2 of a direction, 1 of a heading
    constants: Constants  # of the flight, none of which it depends on

    @property
    def freedom(self) -> IntArray:
        """Directions that are known, (k,)."""
        return np.full(len(self.row), self.dimensions)

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of baselines ``which``, (j,); see ``Sensor``."""
        of = self.value_n_m, self.white, self.baseline_b_m
        return Linearised._make(_kernel(*contiguous(at, which), *of, self.dimensions == 1))

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return baseline i as a factor of keyframe ``key``."""
        return sensor_factor(self, i, key, ("pose",), (), rows=3)


@kernel
def _kernel(
    at: States,
    which: IntArray,
    value_n_m: FloatArray,
    whites: FloatArray,
    baseline_b_m: FloatArray,
    is_heading: bool,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    value, state, shared = room(at, which, 3)
    cross, least = rot.skew(baseline_b_m), 0.0
    for c in range(3):
        least += _LEVEL * baseline_b_m[c] ** 2
    for k in range(len(which)):
        i, R = which[k], at.R_nb[k]
        white, v_n = whites[i], rot.times(R, baseline_b_m)
        by_turn = rot.product(R, cross)  # v_n changes by minus it
        if is_heading:
            along = value_n_m[i, 0] * v_n[0] + value_n_m[i, 1] * v_n[1]
            right = value_n_m[i, 0] * v_n[1] - value_n_m[i, 1] * v_n[0]
            weight = np.sqrt(white[0, 0] ** 2 + white[0, 1] ** 2)
            level = max(v_n[0] ** 2 + v_n[1] ** 2, least)
            value[k, 0] = weight * np.arctan2(right, along)
            for c in range(3):
                moved = v_n[1] * by_turn[0, c] - v_n[0] * by_turn[1, c]
                state[k, 0, c] = weight * moved / level
            continue
        by_turn = rot.product(white, by_turn)
        for m in range(3):
            for c in range(3):
                value[k, m] += white[m, c] * (v_n[c] - value_n_m[i, c])
                state[k, m, c] = -by_turn[m, c]
    return value, state, shared
