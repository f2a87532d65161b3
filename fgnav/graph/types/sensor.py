"""Interface of a sensor: whitened residuals, Jacobians and GTSAM's factors."""

from typing import NamedTuple, Protocol, Self

import gtsam

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.states import States


class Linearised(NamedTuple):
    """Whitened residuals of k measurements where states stand, and their derivatives."""

    value: FloatArray  # (k, m)
    state: FloatArray  # (k, m, D), by the tangent of their keyframe
    shared: FloatArray  # (k, m, b), by the constants


class Sensor(Protocol):
    """All measurements of one sensor in a flight, k of them, each of one keyframe.

    The one statement of the sensor's model: GTSAM's factors, linear factors, innovations and
    reports read it.
    """

    @property
    def name(self) -> str:
        """Name in reports: ``"position"``."""
        ...

    @property
    def row(self) -> IntArray:
        """Keyframes that have one, (k,), increasing."""
        ...

    @property
    def rows(self) -> int:
        """Dimensions of each residual, m."""
        ...

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the constants in the model; one that the problem has none of is zero."""
        ...

    @property
    def constants(self) -> Parameters:
        """Parameters of the problem."""
        ...

    @property
    def freedom(self) -> IntArray:
        """Measured dimensions of each residual, (k,)."""
        ...

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of some of the measurements, (j,).

        Parameters
        ----------
        at : States
            Of their keyframes: row i of it belongs to measurement ``indices[i]``.
        indices : ndarray of int, shape (j,)
            Rows of this sensor's own arrays.
        """
        ...

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return measurement i as GTSAM's factor of keyframe ``key``."""
        ...

    def move(self, row: IntArray) -> Self:
        """Move the measurements to other keyframes, (k,), of a finer timeline."""
        ...

    def bound(self, constants: Parameters) -> Self:
        """Bind the measurements to the constants of a problem."""
        ...
