"""The Earth that rigid bodies fly over: WGS-84, or a rounder or stiller one for check cases."""

from typing import Literal, TypeAlias

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry import earth
from fgnav.geometry.earth import Origin
from fgnav.io.strict_toml import NotNegative, Positive, Table

FieldModel: TypeAlias = Literal["wgs84-normal", "j2", "spherical", "constant"]


class Planet(Table, frozen=True):
    """An ellipsoid of revolution that turns; the Earth where nothing is said."""

    semi_major_axis_m: Positive = earth.SEMI_MAJOR_AXIS_M
    flattening: NotNegative = earth.FLATTENING  # 0: a sphere
    rate_radps: float = earth.EARTH_RATE_RADPS  # about its axis of symmetry; 0: it stands still
    # gravitational parameter of the gravity models "j2" and "spherical"
    gm_m3ps2: Positive = earth.GM_M3PS2

    def __post_init__(self) -> None:
        """Require a body that can exist."""
        if not 0.0 <= self.flattening < 0.1:
            raise BadInputError(f"flattening: must be from 0 to below 0.1, got {self.flattening}")
        if not abs(self.rate_radps) < 1e-3:
            raise BadInputError(f"rate_radps: must be within +-1e-3, got {self.rate_radps}")

    @property
    def semi_minor_axis_m(self) -> float:
        """Half the distance between the poles."""
        return self.semi_major_axis_m * (1 - self.flattening)

    @property
    def rate_i_radps(self) -> FloatArray:
        """Angular rate, the same in ``i`` and in ``e``, (3,)."""
        return np.array([0.0, 0.0, self.rate_radps])

    def p_e_m(self, origin: Origin) -> FloatArray:
        """Return where latitude, longitude and height of an origin are on this planet, (3,)."""
        e2 = self.flattening * (2 - self.flattening)
        sine, cosine = np.sin(origin.latitude_rad), np.cos(origin.latitude_rad)
        normal_m = self.semi_major_axis_m / np.sqrt(1 - e2 * sine**2)
        level_m = (normal_m + origin.height_m) * cosine
        return np.array(
            [
                level_m * np.cos(origin.longitude_rad),
                level_m * np.sin(origin.longitude_rad),
                (normal_m * (1 - e2) + origin.height_m) * sine,
            ]
        )

    def R_ei(self, t_s: FloatArray) -> FloatArray:
        """Return R_ei, (m, 3, 3)."""
        angle = self.rate_radps * t_s
        R = np.zeros((len(t_s), 3, 3))
        R[:, 0, 0] = R[:, 1, 1] = np.cos(angle)
        R[:, 0, 1], R[:, 1, 0], R[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
        return R


WGS84 = Planet()
