"""Base of sensors: arrays that are checked, and each row as a ``gtsam.CustomFactor``."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Self, TypeAlias

import gtsam
import numpy as np
from numpy.typing import NDArray

from fgnav.checks import FloatArray, IntArray, freeze
from fgnav.graph import keys as symbols
from fgnav.graph.types.parameters import NO_PARAMETERS, Parameters
from fgnav.graph.types.sensor import Linearised, Sensor
from fgnav.graph.types.states import AUX, GYROSCOPE_AUX, POSITION, ROTATION, VELOCITY, States

Shapes: TypeAlias = dict[str, tuple[int | str, ...]]

Use: TypeAlias = Literal["pose", "velocity", "imu_bias", "angular_motion"]
_Read: TypeAlias = Callable[[gtsam.Values], None]

_SYMBOLS = {
    "pose": symbols.pose,
    "velocity": symbols.velocity,
    "imu_bias": symbols.imu_bias,
    "angular_motion": symbols.angular_motion,
}
_BLOCKS = {
    "pose": slice(ROTATION.start, POSITION.stop),
    "velocity": VELOCITY,
    "imu_bias": slice(AUX, None),
    "angular_motion": slice(AUX, None),
}


def rate_variables(measured_b_radps: FloatArray | None) -> tuple[Use, ...]:
    """Return the variables of a model of velocity and rate, by a gyroscope's rates or without."""
    return "pose", "velocity", "angular_motion" if measured_b_radps is None else "imu_bias"


def sensor_factor(
    measurement: Sensor, i: int, key: int, uses: tuple[Use, ...]
) -> gtsam.CustomFactor:
    """Return measurement i as a factor of keyframe ``key``, by ``measurement.linearise``.

    Parameters
    ----------
    measurement : Sensor
    i : int
    key : int
        Number of the keyframe.
    uses : tuple of str
        Which of its variables the residual depends on, besides the constants that it names.

    Returns
    -------
    gtsam.CustomFactor

    Examples
    --------
    >>> import numpy as np
    >>> from fgnav.graph import Velocity, sensor_factor
    >>> sensor = Velocity(
    ...     row=np.array([0]), value_n_mps=np.zeros((1, 3)), white=np.eye(3)[None],
    ...     arm_b_m=np.ones(3), measured_b_radps=None, earth_rate_n_radps=np.zeros(3),
    ... )
    >>> sensor_factor(sensor, 0, 7, ("pose", "velocity", "angular_motion")).size()
    3
    """
    constants, indices = measurement.constants, np.array([i])
    variables = [(_SYMBOLS[use](key), use) for use in uses]
    parts = [p for p, of in enumerate(constants.parts) if of.name in measurement.parameters]
    columns = [constants.columns(constants.parts[p].name) for p in parts]
    shared = list(zip(map(symbols.constant, parts), columns, strict=True))
    blocks, linearise, first = [_BLOCKS[use] for use in uses], measurement.linearise, len(uses)
    at: States | None = None
    readers: list[_Read] = []

    def error(
        _: gtsam.CustomFactor, values: gtsam.Values, H: list[FloatArray] | None
    ) -> NDArray[np.float64]:
        nonlocal at, readers
        if at is None:  # values know how long a keyframe's vector is
            at = _one_state(values, variables, constants.width)
            readers = [_read_state(symbol, use, at) for symbol, use in variables]
            readers += [_read_vector(symbol, at.constants[span]) for symbol, span in shared]
        for read in readers:
            read(values)
        value, state, by_constants = linearise(at, indices)
        if H is not None:
            for j, block in enumerate(blocks):
                H[j] = state[0, :, block]
            for j, block in enumerate(columns):
                H[first + j] = by_constants[0, :, block]
        residual: NDArray[np.float64] = value[0]
        return residual

    unit = gtsam.noiseModel.Unit.Create(measurement.rows)
    return gtsam.CustomFactor(unit, [symbol for symbol, _ in (*variables, *shared)], error)


def _one_state(values: gtsam.Values, variables: list[tuple[int, Use]], constants: int) -> States:
    """Return room for one keyframe's state; ``aux`` is empty where it is not used."""
    aux = 0
    for symbol, use in variables:
        if use in ("imu_bias", "angular_motion"):
            aux = GYROSCOPE_AUX if use == "imu_bias" else len(values.atVector(symbol))
    return States(
        R_nb=np.zeros((1, 3, 3)),
        p_n_m=np.zeros((1, 3)),
        v_n_mps=np.zeros((1, 3)),
        aux=np.zeros((1, aux)),
        constants=np.zeros(constants),
    )


def _read_state(symbol: int, use: Use, at: States) -> _Read:
    """Return a function that copies a variable's value into the state's only row."""
    if use == "velocity":
        return _read_vector(symbol, at.v_n_mps[0])
    if use == "angular_motion":
        return _read_vector(symbol, at.aux[0])
    R_nb, p_n_m, biases = at.R_nb[0], at.p_n_m[0], at.aux[0]

    def read_bias(values: gtsam.Values) -> None:
        biases[:] = values.atConstantBias(symbol).vector()

    def read_pose(values: gtsam.Values) -> None:
        matrix = values.atPose3(symbol).matrix()  # a third of rotation's and translation's time
        R_nb[:], p_n_m[:] = matrix[:3, :3], matrix[:3, 3]

    return read_bias if use == "imu_bias" else read_pose


def _read_vector(symbol: int, into: FloatArray) -> _Read:
    def read(values: gtsam.Values) -> None:
        into[:] = values.atVector(symbol)

    return read


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
    def variables(self) -> tuple[Use, ...]:
        """Variables of a keyframe in the model."""
        return ("pose",)

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

    @abstractmethod
    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of some of the measurements, (j,); see ``Sensor``."""

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return measurement i as a factor of keyframe ``key``."""
        return sensor_factor(self, i, key, self.variables)

    def move(self, row: IntArray) -> Self:
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

    def move(self, row: IntArray) -> Self:
        """Move the measurements to other keyframes, (k,)."""
        return replace(self, measurement=self.measurement.move(row))
