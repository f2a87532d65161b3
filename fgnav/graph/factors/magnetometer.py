"""Directions of the magnetic field in body axes, the vehicle's own field among it.

``r = A (R_nb' m_n + o_b) / |R_nb' m_n + o_b|``: m_n the Earth's field, o_b the hard iron, A
the whitening rows across the measured direction [1]_. Only the direction counts: with the size, a
hard iron that takes some of the Earth's field away would make every residual smaller. So r is the
sine of the angle to the measured direction, and against it zero again; there, from 90 degrees on, r
is lengthened to two less that sine, by ``(2 - s) / s``.

References
----------
.. [1] Groves: Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd
   edition, 2013, section 6.1.1: the Earth's field and hard iron.
"""

from dataclasses import dataclass
from typing import ClassVar

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph.factors.directions import native
from fgnav.graph.sensor_factor import parts_of, sensor_factor
from fgnav.graph.types.arrays import contiguous, room
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.sensor import Linearised, SensorRows, Shapes
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import kernel

_LEAST_SINE = 1e-3  # nearer to the opposite no direction leads away from it


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class MagneticField(SensorRows):
    """Directions of the magnetic field, two rows each."""

    name: ClassVar[str] = "magnetic field"
    shapes: ClassVar[Shapes] = {"across_b": ("k", 2, 3), "field_n_ut": (3,)}
    rows: ClassVar[int] = 2
    # Whitening rows of the measured unit vectors; see ``Directions``.
    across_b: FloatArray  # (k, 2, 3)
    field_n_ut: FloatArray  # (3,): m_n, of the Earth
    iron_column: int  # first of the three constants o_b, uT; -1 where there is none
    constants: Constants

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of directions ``which``, (j,); see ``Sensor``."""
        at, which = contiguous(at, which)
        return Linearised._make(
            _kernel(at, which, self.across_b, self.field_n_ut, self.iron_column)
        )

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return direction i as a factor of keyframe ``key``: native without hard iron."""
        if self.iron_column >= 0:
            parts = parts_of(self.constants, (self.iron_column,))
            return sensor_factor(self, i, key, ("pose",), parts, rows=2)
        field_n = self.field_n_ut / np.linalg.norm(self.field_n_ut)
        return native(key, self.across_b[i], field_n)


@kernel
def _across(A: FloatArray, u_b: FloatArray) -> tuple[float, FloatArray]:
    """Return by what a residual is lengthened, and its derivative by the direction, (2, 3)."""
    e_b = rot.times(rot.skew(A[0]), A[1])
    e_b = rot.scaled(e_b, 1.0 / np.sqrt(e_b[0] ** 2 + e_b[1] ** 2 + e_b[2] ** 2))
    cosine = e_b[0] * u_b[0] + e_b[1] * u_b[1] + e_b[2] * u_b[2]
    if cosine >= 0.0:
        return 1.0, A
    sine = np.sqrt(max(1.0 - cosine**2, _LEAST_SINE**2))
    longer, out = (2.0 - sine) / sine, np.empty((2, 3))
    for m in range(2):
        beside = A[m, 0] * u_b[0] + A[m, 1] * u_b[1] + A[m, 2] * u_b[2]
        for c in range(3):
            out[m, c] = longer * A[m, c] + 2.0 * cosine / sine**3 * beside * e_b[c]
    return longer, out


@kernel
def _kernel(
    at: States,
    which: IntArray,
    across_b: FloatArray,
    field_n_ut: FloatArray,
    iron: int,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    value, state, shared = room(at, which, 2)
    sum_b, flat = np.empty(3), np.empty((3, 3))
    for k in range(len(which)):
        i, earth_b = which[k], rot.times(rot.transposed(at.R_nb[k]), field_n_ut)
        for c in range(3):
            sum_b[c] = earth_b[c]
            if iron >= 0:
                sum_b[c] += at.constants[iron + c]
        size = np.sqrt(sum_b[0] ** 2 + sum_b[1] ** 2 + sum_b[2] ** 2)
        u_b = rot.scaled(sum_b, 1.0 / size)
        for r in range(3):
            for c in range(3):
                flat[r, c] = ((r == c) - u_b[r] * u_b[c]) / size
        longer, across = _across(across_b[i], u_b)
        by_field = rot.product(across, flat)
        by_turn = rot.product(by_field, rot.skew(earth_b))
        for m in range(2):
            for c in range(3):
                value[k, m] += longer * across_b[i, m, c] * u_b[c]
                state[k, m, c] = by_turn[m, c]
                if iron >= 0:
                    shared[k, m, iron + c] += by_field[m, c]
    return value, state, shared
