"""Constants of a flight that are estimated with it: positions, angles, offsets."""

from dataclasses import dataclass, field

import numpy as np

from fgnav.checks import FloatArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Parameter:
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
        """Nominal value."""
        return self.mean if self.stated is None else self.stated


def flight_constant(
    name: str,
    axes: tuple[str, ...],
    unit: str,
    sigma: FloatArray | float,
    *,
    reported: bool = True,
) -> Parameter:
    """Return a constant of prior mean zero.

    Parameters
    ----------
    name : str
    axes : tuple of str, length d
    unit : str
    sigma : float or ndarray of shape (d,)
        1-sigma of all axes, or of each.
    reported : bool, optional
        Whether results report it.

    Returns
    -------
    Parameter

    Examples
    --------
    >>> from fgnav.graph import flight_constant
    >>> flight_constant("speed scale", ("",), "", 0.01).covariance
    array([[0.0001]])
    """
    d = len(axes)
    return Parameter(
        name=name,
        axes=axes,
        unit=unit,
        mean=np.zeros(d),
        covariance=np.eye(d) * np.square(sigma),
        start=np.zeros(d),
        reported=reported,
    )


@dataclass(frozen=True, eq=False, slots=True)
class Parameters:
    """The constants of a flight, one after another in one vector of b dimensions.

    Part i has the key ``keys.constant(i)``.
    """

    parts: tuple[Parameter, ...] = ()
    width: int = field(init=False)  # dimensions of all parts together, b
    first: tuple[int, ...] = field(init=False)  # first column of each part
    _columns: dict[str, slice] = field(init=False)

    def __post_init__(self) -> None:
        """Lay the parts out."""
        ends = np.cumsum([parameter.size for parameter in self.parts], dtype=np.int64).tolist()
        first = (0, *ends)[: len(ends)]
        columns = zip(self.parts, map(slice, first, ends), strict=True)
        object.__setattr__(self, "width", ends[-1] if ends else 0)
        object.__setattr__(self, "first", first)
        object.__setattr__(
            self, "_columns", {parameter.name: columns for parameter, columns in columns}
        )

    def column(self, name: str) -> int:
        """Return the first column of the part of that name; -1 if there is none."""
        columns = self._columns.get(name)
        return -1 if columns is None else int(columns.start)

    def columns(self, name: str) -> slice:
        """Return the columns of the part of that name; none if there is none."""
        return self._columns.get(name, slice(0, 0))

    @property
    def mean(self) -> FloatArray:
        """Return the prior means, (b,)."""
        return np.concatenate([np.empty(0), *(parameter.mean for parameter in self.parts)])

    @property
    def start(self) -> FloatArray:
        """Return where the search starts, (b,)."""
        return np.concatenate([np.empty(0), *(parameter.start for parameter in self.parts)])

    @property
    def covariance(self) -> FloatArray:
        """Return the covariance before the flight, (b, b)."""
        P = np.zeros((self.width, self.width))
        for parameter, first in zip(self.parts, self.first, strict=True):
            columns = slice(first, first + parameter.size)
            P[columns, columns] = parameter.covariance
        return P


NO_PARAMETERS = Parameters()
