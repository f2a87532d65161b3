"""Quantities that a network may measure and see: manifolds, units, frames, numbers of channels."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

Quantity: TypeAlias = Literal[
    "heading",
    "attitude",
    "direction",
    "velocity",
    "displacement",
    "speed",
    "height",
    "position",
    "integers",
]
Form: TypeAlias = Literal["log_sigma", "cholesky", "none", "probability", "posterior"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """A quantity that a network's output may be: of the states, or an array's integers.

    Attributes
    ----------
    manifold : str
        ``"S1"`` angles, ``"SO3"`` rotations, ``"S2"`` unit vectors, ``"R1"``, ``"R3"``, ``"Z"``.
    units : dict of str to float
        Allowed ones, each in SI or radians: of the output and of its 1-sigma; of rotations and unit
        vectors, which are plain numbers, of the 1-sigma alone.
    frames : tuple of str
    widths : tuple of int
        Numbers that the value may have.
    freedom : int
        Of the tangent that the covariance is stated in; 0 of integers, which have none.
    forms : tuple of str
        In which the network may say how sure it is.
    """

    manifold: str
    units: dict[str, float]
    frames: tuple[str, ...]
    widths: tuple[int, ...]
    freedom: int
    forms: tuple[Form, ...] = ("log_sigma", "cholesky", "none")


_ANGLE = {"rad": 1.0, "deg": float(np.pi / 180)}


def _vector(unit: str, *frames: str) -> Measure:
    """Return the measure of a vector of R3 in one of the frames."""
    return Measure(
        manifold="R3",
        units={unit: 1.0},
        frames=frames,
        widths=(3,),
        freedom=3,
    )


def _scalar(unit: str) -> Measure:
    """Return the measure of a number."""
    return Measure(manifold="R1", units={unit: 1.0}, frames=("n",), widths=(1,), freedom=1)


MEASURES: dict[str, Measure] = {
    "heading": Measure(manifold="S1", units=_ANGLE, frames=("n",), widths=(1, 2), freedom=1),
    "attitude": Measure(manifold="SO3", units=_ANGLE, frames=("n",), widths=(9, 4), freedom=3),
    "direction": Measure(manifold="S2", units=_ANGLE, frames=("b",), widths=(3,), freedom=3),
    "velocity": _vector("m/s", "n", "b"),
    "displacement": _vector("m", "n", "b"),
    "speed": _scalar("m/s"),
    "height": _scalar("m"),
    "position": _vector("m", "n"),
    "integers": Measure(
        manifold="Z",
        units={"cycle": 1.0},
        frames=("none",),
        widths=(),
        freedom=0,
        forms=("probability", "posterior", "none"),
    ),
}


@dataclass(frozen=True, slots=True)
class Sensor:
    """Samples of a sensor in a flight: unit, frame, number of channels."""

    unit: str
    frame: str
    channels: int


SENSORS: dict[str, Sensor] = {
    "accelerometer": Sensor("m/s2", "b", 3),
    "gyroscope": Sensor("rad/s", "b", 3),
    "magnetometer": Sensor("uT", "b", 3),
    "barometer": Sensor("m", "n", 1),
    "position": Sensor("m", "n", 3),  # of fixes
    "velocity": Sensor("m/s", "n", 3),  # of fixes
}
