"""What holds for a whole flight and is estimated with it: places, angles, offsets."""

from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np

from fgnav.checks import FloatArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class FlightConstant:
    """A few dimensions that hold for the whole flight: one vector variable of the graph.

    Attributes
    ----------
    name : str
        ``"boresight"``, ``"antenna a4"``, ``"mean rate"``.
    axes : tuple of str, length d
    unit : {"m", "rad", "uT", "rad/s", "s", "ppm", ""}
    mean : ndarray, shape (d,)
        What is expected of it before the flight.
    covariance : ndarray, shape (d, d)
        How well that is known.
    start : ndarray, shape (d,)
        Where the search starts.
    linear : bool
        Whether all residuals are linear in it.
    reported : bool
        Whether it was requested, and is reported in the result.
    stated : ndarray, shape (d,), or None
        The stated value, from which a result is counted; None: ``mean``.
    """

    name: str
    axes: tuple[str, ...]
    unit: str
    mean: FloatArray
    covariance: FloatArray
    start: FloatArray
    linear: bool = False
    reported: bool = True
    stated: FloatArray | None = None

    @property
    def size(self) -> int:
        """Dimensions."""
        return len(self.mean)

    @property
    def origin(self) -> FloatArray:
        """What the flight states."""
        return self.mean if self.stated is None else self.stated


def flight_constant(
    name: str,
    axes: tuple[str, ...],
    unit: str,
    sigma: FloatArray | float,
    *,
    reported: bool = True,
) -> FlightConstant:
    """Return a constant that is zero to a 1-sigma, of all its axes or of each, (d,)."""
    d = len(axes)
    return FlightConstant(
        name=name,
        axes=axes,
        unit=unit,
        mean=np.zeros(d),
        covariance=np.eye(d) * np.square(sigma),
        start=np.zeros(d),
        reported=reported,
    )


@dataclass(frozen=True, eq=False, slots=True)
class Constants:
    """The constants of a flight, one after another in one vector of b dimensions.

    Part i has the key ``keys.constant(i)``.
    """

    parts: tuple[FlightConstant, ...] = ()

    @property
    def width(self) -> int:
        """Dimensions of all parts together, b."""
        return sum(part.size for part in self.parts)

    @property
    def first(self) -> tuple[int, ...]:
        """First column of each part."""
        return tuple(accumulate((part.size for part in self.parts), initial=0))[:-1]

    def column(self, name: str) -> int:
        """Return the first column of the part of that name; -1 if there is none."""
        for part, first in zip(self.parts, self.first, strict=True):
            if part.name == name:
                return first
        return -1

    def columns(self, name: str) -> slice:
        """Return the columns of the part of that name; none if there is none."""
        for part, first in zip(self.parts, self.first, strict=True):
            if part.name == name:
                return slice(first, first + part.size)
        return slice(0, 0)

    @property
    def mean(self) -> FloatArray:
        """Return what is expected before the flight, (b,)."""
        return np.concatenate([np.empty(0), *(part.mean for part in self.parts)])

    @property
    def start(self) -> FloatArray:
        """Return where the search starts, (b,)."""
        return np.concatenate([np.empty(0), *(part.start for part in self.parts)])

    @property
    def covariance(self) -> FloatArray:
        """Return the covariance before the flight, (b, b)."""
        P = np.zeros((self.width, self.width))
        for part, first in zip(self.parts, self.first, strict=True):
            columns = slice(first, first + part.size)
            P[columns, columns] = part.covariance
        return P

    def started_at(self, values: FloatArray) -> "Constants":
        """Return the same, their search starting at values, (b,)."""
        return Constants(
            tuple(
                replace(part, start=values[first : first + part.size])
                for part, first in zip(self.parts, self.first, strict=True)
            )
        )
