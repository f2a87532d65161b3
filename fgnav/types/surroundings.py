"""Measurements of a vehicle's surroundings: barometric height and the magnetic field."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from fgnav.checks import BadInputError, FloatArray, freeze, freeze_times, positive
from fgnav.types.instruments import Samples


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, repr=False)
class Barometer(Samples):
    """Height by air pressure, already turned into metres by whatever atmosphere.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    height_m : ndarray, shape (k,)
        Above any datum: what is constant of the difference to the ellipsoid is part of the offset.
    position_b_m : ndarray, shape (3,)
        The port in body axes.
    noise_m : float
        1-sigma of each sample, independent of all others.
    offset_m : float
        1-sigma of an offset that holds for the whole flight: of the day's pressure, of the datum.
    wander_m, wander_time_s : float
        1-sigma and time constant of a first-order Gauss-Markov drift beside it; a wander of 0 is
        none.
    """

    columns: ClassVar = ("t_s", "height_m")
    t_s: FloatArray
    height_m: FloatArray
    position_b_m: FloatArray = field(default_factory=lambda: np.zeros(3))
    noise_m: float
    offset_m: float
    wander_m: float = 0.0
    wander_time_s: float = 300.0

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = freeze_times("barometer", self)
        freeze("barometer", self, {"height_m": (k,), "position_b_m": (3,)})
        for name in ("noise_m", "offset_m", "wander_time_s"):
            positive(f"barometer {name}", getattr(self, name))
        if not 0 <= self.wander_m < np.inf:
            raise BadInputError(f"barometer wander_m: must be 0 or positive, got {self.wander_m}")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, repr=False)
class Magnetometer(Samples):
    """The magnetic field in body axes, and what it is where the flight is.

    Only its direction is used: the strength would add little, and scale factors spoil it.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    field_b_ut : ndarray, shape (k, 3)
        Microtesla.
    field_n_ut : ndarray, shape (3,)
        The Earth's at the origin, north, east, down: by any model or chart; it is taken to be the
        same all over the flight.
    noise_ut : float
        1-sigma of each axis of each sample.
    hard_iron_ut : float
        1-sigma of each axis of the vehicle's own field, which holds for the whole flight.
    """

    columns: ClassVar = ("t_s", "field_b_ut")
    t_s: FloatArray
    field_b_ut: FloatArray
    field_n_ut: FloatArray
    noise_ut: float
    hard_iron_ut: float

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = freeze_times("magnetometer", self)
        freeze("magnetometer", self, {"field_b_ut": (k, 3), "field_n_ut": (3,)})
        if not self.field_n_ut.any():
            raise BadInputError("magnetometer field_n_ut: must not be zero, got [0, 0, 0]")
        positive("magnetometer noise_ut", self.noise_ut)
        positive("magnetometer hard_iron_ut", self.hard_iron_ut)
