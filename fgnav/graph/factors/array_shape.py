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

import numpy as np

from fgnav.checks import FloatArray, IntArray, freeze
from fgnav.geometry.rotations import skew
from fgnav.graph.sensor_rows import SensorRows
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import ROTATION, States


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ArrayShape(SensorRows):
    """Quadratic forms of a baselines in ``n``, three rows for each baseline."""

    name: ClassVar[str] = "array phases"
    timed_by_receiver: ClassVar[bool] = True
    whitening: ClassVar[str] = "root"
    root: FloatArray  # (k, 3 a, 3 a): of the information about all baselines, one after another
    minimum_n_m: FloatArray  # (k, a, 3)
    baselines_b_m: FloatArray  # (a, 3): d, as the flight states them
    antennas: tuple[str, ...]  # length a: names of the constants c_i are "antenna " and these

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        k, a = len(self.row), len(self.baselines_b_m)
        shapes = {"root": (k, 3 * a, 3 * a), "minimum_n_m": (k, a, 3), "baselines_b_m": (a, 3)}
        freeze(self.name, self, shapes)
        freeze(self.name, self, {"row": (k,)}, dtype=int)

    @property
    def rows(self) -> int:
        """Dimensions of each residual."""
        return int(self.root.shape[1])

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the constants c_i."""
        return tuple(f"antenna {name}" for name in self.antennas)

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of epochs ``indices``, (j,); see ``Sensor``."""
        state, shared = self.derivatives(at)
        columns = [self.constants.columns(name) for name in self.parameters]
        root, arms_b_m = self.root[indices], self.baselines_b_m.copy()
        for a, column in enumerate(columns):
            if column.stop:
                arms_b_m[a] += at.constants[column]
                shared[:, :, column] = root[:, :, 3 * a : 3 * a + 3] @ at.R_nb
        difference_m = np.einsum("kij,aj->kai", at.R_nb, arms_b_m) - self.minimum_n_m[indices]
        by_rotation = -(at.R_nb[:, None] @ skew(arms_b_m)).reshape(len(indices), -1, 3)
        state[:, :, ROTATION] = root @ by_rotation
        value = np.einsum("kmi,ki->km", root, difference_m.reshape(len(indices), -1))
        return Linearised(value, state, shared)
