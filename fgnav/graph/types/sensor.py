"""Interface of a sensor: whitened residuals, Jacobians and GTSAM's factors."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Protocol, Self, TypeAlias

import numpy as np

from fgnav.checks import FloatArray, IntArray, freeze
from fgnav.graph.types.parameters import NO_PARAMETERS, Parameters
from fgnav.graph.types.states import States

if TYPE_CHECKING:
    import gtsam


Shapes: TypeAlias = dict[str, tuple[int | str, ...]]


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

    def factor(self, i: int, key: int) -> "gtsam.NonlinearFactor":
        """Return measurement i as GTSAM's factor of keyframe ``key``."""
        ...

    def on(self, row: IntArray) -> Self:
        """Move the measurements to other keyframes, (k,), of a finer timeline."""
        ...

    def bound(self, constants: Parameters) -> Self:
        """Bind the measurements to the constants of a problem."""
        ...


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class SensorRows(ABC):
    """Measurements of a sensor of their own, whose arrays are checked and frozen."""

    name: ClassVar[str]  # in reports
    shapes: ClassVar[Shapes] = {}  # of the float arrays, "k" for the number of measurements
    whitening: ClassVar[str] = ""  # field, (k, m, ...), whose rows are zero where not all are known
    timed_by_receiver: ClassVar[bool] = (
        False  # its timestamps are GNSS time, not of the IMU's clock
    )
    row: IntArray  # (k,): keyframes
    constants: Parameters = NO_PARAMETERS  # of the problem, see ``bound``

    def __post_init__(self) -> None:
        """Check and freeze the arrays; one that is None stays so."""
        k = len(self.row)
        for field, shape in self.shapes.items():
            if getattr(self, field) is not None:
                freeze(self.name, self, {field: tuple(k if n == "k" else int(n) for n in shape)})
        freeze(self.name, self, {"row": (k,)}, dtype=int)

    @property
    @abstractmethod
    def rows(self) -> int:
        """Dimensions of each residual, m."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the constants in the model."""
        return ()

    @property
    def freedom(self) -> IntArray:
        """Rows of each residual that know something, (k,)."""
        if self.whitening:
            return np.asarray(getattr(self, self.whitening).any(axis=2).sum(axis=1))
        return np.full(len(self.row), self.rows)

    def on(self, row: IntArray) -> Self:
        """Move the measurements to other keyframes, (k,)."""
        return replace(self, row=row)

    def bound(self, constants: Parameters) -> Self:
        """Bind the measurements to the constants of a problem."""
        return replace(self, constants=constants)

    def derivatives(self, at: States) -> tuple[FloatArray, FloatArray]:
        """Return zeros for derivatives by states, (j, m, D), and constants, (j, m, b)."""
        rows = len(at.R_nb), self.rows
        return np.zeros((*rows, at.width)), np.zeros((*rows, len(at.constants)))


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class WrappedSensor:
    """Base of measurements that wrap others and transform their states."""

    measurement: Sensor

    @property
    def name(self) -> str:
        """Name in reports."""
        return self.measurement.name

    @property
    def row(self) -> IntArray:
        """Keyframes, (k,)."""
        return self.measurement.row

    @property
    def rows(self) -> int:
        """Dimensions of each residual, m."""
        return self.measurement.rows

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the constants in the model."""
        return self.measurement.parameters

    @property
    def constants(self) -> Parameters:
        """Parameters of the problem."""
        return self.measurement.constants

    @property
    def freedom(self) -> IntArray:
        """Directions that are known, (k,)."""
        return self.measurement.freedom

    def bound(self, constants: Parameters) -> Self:
        """Bind the measurements to the constants of a problem."""
        return replace(self, measurement=self.measurement.bound(constants))

    def on(self, row: IntArray) -> Self:
        """Move the measurements to other keyframes, (k,)."""
        return replace(self, measurement=self.measurement.on(row))
