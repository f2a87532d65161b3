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
from fgnav.geometry.rotations import skew
from fgnav.graph.factors.directions import flattened, native
from fgnav.graph.sensor_rows import SensorRows, Shapes, sensor_factor
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import ROTATION, States

HARD_IRON = "hard iron"  # the constant o_b, uT
_LEAST_SINE = 1e-3  # nearer to the opposite no direction leads away from it


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class MagneticField(SensorRows):
    """Directions of the magnetic field, two rows each."""

    name: ClassVar[str] = "magnetic field"
    shapes: ClassVar[Shapes] = {"across_b": ("k", 2, 3), "field_n_ut": (3,)}
    rows: ClassVar[int] = 2
    parameters: ClassVar[tuple[str, ...]] = (HARD_IRON,)
    # Whitening rows of the measured unit vectors; see ``Directions``.
    across_b: FloatArray  # (k, 2, 3)
    field_n_ut: FloatArray  # (3,): m_n, of the Earth

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of directions ``indices``, (j,); see ``Sensor``."""
        state, shared = self.derivatives(at)
        iron = self.constants.columns(HARD_IRON)
        earth_b_ut = np.einsum("kji,j->ki", at.R_nb, self.field_n_ut)
        u_b, by_field = flattened(earth_b_ut + (at.constants[iron] if iron.stop else 0.0))
        value, across_b = _lengthened(self.across_b[indices], u_b)
        by_iron = across_b @ by_field
        state[:, :, ROTATION] = by_iron @ skew(earth_b_ut)
        shared[:, :, iron] = by_iron[:, :, : iron.stop - iron.start]
        return Linearised(value, state, shared)

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return direction i as a factor of keyframe ``key``: native without hard iron."""
        if self.constants.column(HARD_IRON) >= 0:
            return sensor_factor(self, i, key, ("pose",))
        field_n = self.field_n_ut / np.linalg.norm(self.field_n_ut)
        return native(key, self.across_b[i], field_n)


def _lengthened(A: FloatArray, u_b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return residuals of unit vectors, (k, 2), and their derivatives by these, (k, 2, 3)."""
    value = np.einsum("kmc,kc->km", A, u_b)
    e_b = np.cross(A[:, 0], A[:, 1])
    e_b /= np.linalg.norm(e_b, axis=1, keepdims=True)
    cosine = np.einsum("kc,kc->k", e_b, u_b)
    if (cosine >= 0.0).all():
        return value, A
    sine = np.sqrt((1.0 - cosine**2).clip(_LEAST_SINE**2))
    against = cosine < 0.0
    longer = np.where(against, (2.0 - sine) / sine, 1.0)
    bend = np.where(against, 2.0 * cosine / sine**3, 0.0)
    by_sine = (bend[:, None] * value)[:, :, None] * e_b[:, None, :]
    return longer[:, None] * value, longer[:, None, None] * A + by_sine
