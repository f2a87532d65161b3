"""What a vehicle's build lets it do."""

from dataclasses import dataclass, field

import numpy as np

from fgnav.checks import FloatArray, freeze, positive


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
