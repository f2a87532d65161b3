"""Phases of an antenna array whose antennas may stand elsewhere than the flight states.

``r = root (stack_i R_nb (d_i + c_i) - minimum)``: d_i the baseline of antenna i as stated, c_i what
it is off, both in body axes. The unknowns of an epoch are the baselines in ``n`` themselves, of
which double differences with resolved integers are linear functions [1]_; with all c_i known this
is the form of ``ArrayPhase``.

References
----------
.. [1] Teunissen, Montenbruck (eds.): Springer Handbook of Global Navigation Satellite Systems,
   2017, chapter 27: the baselines of an array as unknowns.
"""

from dataclasses import dataclass
from typing import ClassVar

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray, freeze
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph.sensor_factor import parts_of, sensor_factor
from fgnav.graph.types.arrays import contiguous, room
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.sensor import Linearised, SensorRows
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import kernel


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ArrayShape(SensorRows):
    """Quadratic forms of a baselines in ``n``, three rows for each baseline."""

    name: ClassVar[str] = "array phases"
    whitening: ClassVar[str] = "root"
    root: FloatArray  # (k, 3 a, 3 a): of the information about all baselines, one after another
    minimum_n_m: FloatArray  # (k, a, 3)
    baselines_b_m: FloatArray  # (a, 3): d, as the flight states them
    # First of the three constants c_i of each antenna; -1 of those that stand where stated.
    column: IntArray  # (a,)
    constants: Constants

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        k, a = len(self.row), len(self.baselines_b_m)
        shapes = {"root": (k, 3 * a, 3 * a), "minimum_n_m": (k, a, 3), "baselines_b_m": (a, 3)}
        freeze(self.name, self, shapes)
        freeze(self.name, self, {"row": (k,), "column": (a,)}, dtype=int)

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of epochs ``which``, (j,); see ``Sensor``."""
        return Linearised._make(
            _kernel(
                *contiguous(at, which), self.root, self.minimum_n_m, self.baselines_b_m, self.column
            )
        )

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return epoch i as a factor of keyframe ``key``; GTSAM has none of its own."""
        parts = parts_of(self.constants, (int(column) for column in self.column))
        return sensor_factor(self, i, key, ("pose",), parts, rows=self.root.shape[1])


@kernel
def _kernel(
    at: States,
    which: IntArray,
    root: FloatArray,
    minimum_n_m: FloatArray,
    baselines_b_m: FloatArray,
    column: IntArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    value, state, shared = room(at, which, root.shape[1])
    arm = np.empty(3)
    for k in range(len(which)):
        i, R = which[k], at.R_nb[k]
        for a in range(len(baselines_b_m)):
            for c in range(3):
                arm[c] = baselines_b_m[a, c]
                if column[a] >= 0:
                    arm[c] += at.constants[column[a] + c]
            apart, by_turn = rot.times(R, arm), rot.product(R, rot.skew(arm))
            for c in range(3):
                apart[c] -= minimum_n_m[i, a, c]
            part = np.ascontiguousarray(root[i, :, 3 * a : 3 * a + 3])
            residual = rot.times(part, apart)
            turned, moved = rot.product(part, by_turn), rot.product(part, R)
            for e in range(len(residual)):
                value[k, e] += residual[e]
                for c in range(3):
                    state[k, e, c] -= turned[e, c]
                    if column[a] >= 0:
                        shared[k, e, column[a] + c] = moved[e, c]
    return value, state, shared
