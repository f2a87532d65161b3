"""Phases of the antenna array, integers resolved: a quadratic form of the rotation.

Double differences of one epoch are linear in the elements of ``R_nb``, so their negative log
likelihood is ``|root (vec(R_nb) - vec(minimum))|^2 / 2``, without loss [1]_. In a stretch of epochs
whose integers are not known the minimum is off by nine unknown elements that all of it shares.
Where phases err lastingly a share s of the rows' variance is a state z of the keyframe, by a basis
B of the elements that phases know (``graph.inertial.multipath``).

References
----------
.. [1] Teunissen: The affine constrained GNSS attitude model and its multivariate integer
   least-squares solution, Journal of Geodesy 86, 2012: the rotation's elements as the unknowns.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray, freeze
from fgnav.graph import keys
from fgnav.graph.sensor_rows import SensorRows, Use, sensor_factor
from fgnav.graph.types.arrays import contiguous, zero_rows
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import kernel

FLOAT_AMBIGUITIES = "float ambiguities"  # the constants c
# Where the elements of R.ravel() stand in the column-major vector of a 4 by 4 pose matrix.
_IN_POSE = [4 * column + row for row in range(3) for column in range(3)]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ArrayPhase(SensorRows):
    """Quadratic forms of the rotation: nine rows.

    ``r = (root (vec(R_nb) + c - vec(minimum)) + sqrt(s) B z) / sqrt(1 - s)``.
    """

    name: ClassVar[str] = "array phases"
    timed_by_receiver: ClassVar[bool] = True
    rows: ClassVar[int] = 9
    parameters: ClassVar[tuple[str, ...]] = (FLOAT_AMBIGUITIES,)
    whitening: ClassVar[str] = "root"
    # ``RotationQuadratic.square_root``, where s is not 0 its symmetric one; elements of matrices by
    # row.
    root: FloatArray  # (k, 9, 9)
    minimum: FloatArray  # (k, 3, 3)
    # Which nine of the constants c an epoch without integers has, counted in nines; -1 with them.
    stretch: IntArray  # (k,)
    # s, 0 where errors are white.
    share: FloatArray = field(default_factory=lambda: np.zeros(0))  # (k,)
    # B; z is the end of the keyframe's ``aux``.
    basis: FloatArray = field(default_factory=lambda: np.zeros((9, 0)))  # (9, q)

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        k, q = len(self.row), self.basis.shape[-1]
        if not q:
            object.__setattr__(self, "share", np.zeros(k))
        object.__setattr__(self, "root", np.ascontiguousarray(self.root))  # compiled once
        shapes = {"root": (k, 9, 9), "minimum": (k, 3, 3), "share": (k,), "basis": (9, q)}
        freeze(self.name, self, shapes)
        freeze(self.name, self, {"row": (k,), "stretch": (k,)}, dtype=int)

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of epochs ``indices``, (j,); see ``Sensor``."""
        return Linearised._make(
            _kernel(
                *contiguous(at, indices),
                self.root,
                self.minimum,
                self._element_column,
                self.share,
                self.basis,
            )
        )

    @property
    def _element_column(self) -> IntArray:
        """First column of each epoch's c, (k,); -1 of none."""
        first = self.constants.column(FLOAT_AMBIGUITIES)
        return np.where((self.stretch >= 0) & (first >= 0), first + 9 * self.stretch, -1)

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return epoch i as a factor of keyframe ``key``: native where integers are known."""
        correlated: tuple[Use, ...] = ("angular_motion",) if self.share[i] > 0 else ()
        if correlated or self.stretch[i] >= 0:
            return sensor_factor(self, i, key, ("pose", *correlated))
        whitening, M = np.zeros((16, 16)), np.zeros((4, 4))
        whitening[:9, _IN_POSE] = self.root[i]
        M[:3, :3] = self.minimum[i]
        noise = gtsam.noiseModel.Gaussian.SqrtInformation(whitening, False)
        return gtsam.FrobeniusPriorPose3(keys.pose(key), M, noise)


@kernel
def _kernel(
    at: States,
    indices: IntArray,
    root: FloatArray,
    minimum: FloatArray,
    element_column: IntArray,
    share: FloatArray,
    basis: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    value, state, shared = zero_rows(at, indices, 9)
    difference = np.empty(9)
    for k in range(len(indices)):
        i, R = indices[k], at.R_nb[k]
        first, white, q = element_column[i], 1 / np.sqrt(1 - share[i]), basis.shape[1]
        for e in range(9):
            difference[e] = R[e // 3, e % 3] - minimum[i, e // 3, e % 3]
            if first >= 0:
                difference[e] += at.constants[first + e]
        for m in range(9):
            for e in range(9):
                weight, a, c = white * root[i, m, e], e // 3, e % 3
                if weight == 0.0:
                    continue
                value[k, m] += weight * difference[e]
                # R [d]x: column c gains d[c + 2] R[:, c + 1] - d[c + 1] R[:, c + 2], cyclically.
                state[k, m, (c + 2) % 3] += weight * R[a, (c + 1) % 3]
                state[k, m, (c + 1) % 3] -= weight * R[a, (c + 2) % 3]
                if first >= 0:
                    shared[k, m, first + e] = weight
            if share[i] > 0.0:  # then the keyframe has a z
                correlated = white * np.sqrt(share[i])
                for e in range(q):
                    state[k, m, state.shape[2] - q + e] = correlated * basis[m, e]
                    value[k, m] += correlated * basis[m, e] * at.aux[k, at.aux.shape[1] - q + e]
    return value, state, shared
