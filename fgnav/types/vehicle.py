"""Constraints by a vehicle's build: it rolls on wheels, or flies nose first."""

from dataclasses import dataclass, field

import numpy as np

from fgnav.checks import BadInputError, FloatArray, freeze, positive


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class WheeledVehicle:
    """A vehicle on wheels: the axle that does not steer moves forward or back, and no other way.

    Attributes
    ----------
    position_b_m : ndarray, shape (3,)
        The middle of that axle in body axes.
    position_sigma_m : float
        1-sigma of each of its coordinates.
    slip_mps : float
        1-sigma of velocity across, to the side and up, independent from second to second.
    axes_sigma_rad : float
        1-sigma of the angles, about y_b and z_b, by which wheels roll off x_b.
    """

    position_b_m: FloatArray = field(default_factory=lambda: np.zeros(3))
    position_sigma_m: float = 1.0
    slip_mps: float = 0.1
    axes_sigma_rad: float = float(np.radians(3.0))

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        freeze("vehicle", self, {"position_b_m": (3,)})
        positive("vehicle position_sigma_m", self.position_sigma_m)
        positive("vehicle slip_mps", self.slip_mps)
        positive("vehicle axes_sigma", self.axes_sigma_rad)


@dataclass(frozen=True, slots=True, kw_only=True)
class FinnedVehicle:
    """A body that fins hold in the wind: it flies nose first but for sideslip and angle of attack.

    Attributes
    ----------
    sideslip_sigma_rad, attack_sigma_rad : float
        1-sigma of the angles of the velocity against the air to ``x_b``, to the side and down.
    half_life_s : float
        In which half of what varies of them is forgotten.
    constant_share : float
        Share of their variance that lasts for the flight: a trim, an antenna off the axis.
    wind_sigma_mps : float
        1-sigma, north and east, of the wind of the whole flight.
    crossflow_sigma_mps : float
        1-sigma of what flows across the body besides: gusts, a path that bends faster than fins
        turn the nose. The slower it flies, the larger the angle.
    """

    sideslip_sigma_rad: float = float(np.radians(3.0))
    attack_sigma_rad: float = float(np.radians(3.0))
    half_life_s: float = 1.0
    constant_share: float = 0.25
    wind_sigma_mps: float = 3.0
    crossflow_sigma_mps: float = 0.5

    def __post_init__(self) -> None:
        """Reject figures that are zero or negative."""
        for name in ("sideslip_sigma_rad", "attack_sigma_rad", "half_life_s"):
            positive(f"vehicle {name}", getattr(self, name))
        positive("vehicle wind_sigma_mps", self.wind_sigma_mps)
        positive("vehicle crossflow_sigma_mps", self.crossflow_sigma_mps)
        if not 0 < self.constant_share < 1:
            raise BadInputError(
                f"vehicle constant_share: must lie between 0 and 1, got {self.constant_share:g}"
            )
