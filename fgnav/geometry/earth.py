"""The Earth: WGS-84 constants, the local NED frame fixed at a flight's origin, gravity by name."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from fgnav.checks import BadInputError, FloatArray

C_MPS = 299_792_458.0  # exact, SI
EARTH_RATE_RADPS = 7.2921151467e-5  # IS-GPS-200N, table 20-IV
GM_M3PS2 = 3.986004418e14  # WGS-84
SEMI_MAJOR_AXIS_M = 6_378_137.0  # WGS-84, exact
FLATTENING = 1 / 298.257223563  # WGS-84, exact
ECCENTRICITY_SQUARED = FLATTENING * (2 - FLATTENING)
J2 = 1.08262982e-3  # WGS-84, unnormalised
STANDARD_GRAVITY_MPS2 = 9.81  # the constant of the source paper, Eq. 23

_SEMI_MINOR_AXIS_M = SEMI_MAJOR_AXIS_M * (1 - FLATTENING)
_EQUATOR_GRAVITY_MPS2 = 9.7803253359  # WGS-84 normal gravity at the equator
_SOMIGLIANA = 1.931852652458e-3  # WGS-84, Somigliana's k
# Centrifugal over gravitational acceleration at the equator, WGS-84.
_M = EARTH_RATE_RADPS**2 * SEMI_MAJOR_AXIS_M**2 * _SEMI_MINOR_AXIS_M / GM_M3PS2

GravityModel: TypeAlias = Literal["wgs84-normal", "j2", "constant"]


def ecef(latitude_rad: FloatArray, longitude_rad: FloatArray, height_m: FloatArray) -> FloatArray:
    """Return (n, 3) ECEF positions, m, of geodetic coordinates, each (n,)."""
    from pymap3d import geodetic2ecef  # noqa: PLC0415  # lazy: keeps the command line quick

    return np.stack(geodetic2ecef(latitude_rad, longitude_rad, height_m, deg=False), axis=-1)


def geodetic(p_e_m: FloatArray) -> FloatArray:
    """Return (n, 3) latitude rad, longitude rad, ellipsoidal height m, of ECEF positions."""
    from pymap3d import ecef2geodetic  # noqa: PLC0415  # lazy, as above

    coordinates = ecef2geodetic(p_e_m[:, 0], p_e_m[:, 1], p_e_m[:, 2], deg=False)
    # A single point comes back without its axis.
    return np.stack([np.reshape(x, len(p_e_m)) for x in coordinates], axis=-1)


def ned_axes(latitude_rad: FloatArray, longitude_rad: FloatArray) -> FloatArray:
    """Return (n, 3, 3) R_ne: rotates ECEF coordinates into the NED axes at each place."""
    sl, cl = np.sin(latitude_rad), np.cos(latitude_rad)
    so, co = np.sin(longitude_rad), np.cos(longitude_rad)
    rows = [[-sl * co, -sl * so, cl], [-so, co, np.zeros_like(so)], [-cl * co, -cl * so, -sl]]
    return np.moveaxis(np.array(rows), -1, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """The point where the flight's local NED frame ``n`` is fixed to the WGS-84 ellipsoid.

    Attributes
    ----------
    latitude_rad, longitude_rad : float
        Geodetic coordinates.
    height_m : float
        Height above the ellipsoid.

    Examples
    --------
    >>> import fgnav
    >>> fgnav.Origin.from_degrees(0.0, 90.0, 0.0).p_e_m.round()
    array([      0., 6378137.,       0.])
    """

    latitude_rad: float
    longitude_rad: float
    height_m: float

    def __post_init__(self) -> None:
        """Reject places off the Earth."""
        if not abs(self.latitude_rad) <= np.pi / 2:
            raise BadInputError(
                f"latitude: must be within +-90 deg, got {np.degrees(self.latitude_rad)}"
            )
        if not abs(self.longitude_rad) <= 2 * np.pi:
            raise BadInputError(
                f"longitude: must be within +-360 deg, got {np.degrees(self.longitude_rad)}"
            )
        if not -1e4 < self.height_m < 1e8:
            raise BadInputError(
                f"height_m: must be within -10 km and 100,000 km, got {self.height_m}"
            )

    @classmethod
    def from_degrees(cls, latitude_deg: float, longitude_deg: float, height_m: float) -> "Origin":
        """Return the place of WGS-84 coordinates in degrees."""
        return cls(
            latitude_rad=float(np.radians(latitude_deg)),
            longitude_rad=float(np.radians(longitude_deg)),
            height_m=height_m,
        )

    @property
    def p_e_m(self) -> FloatArray:
        """ECEF position of the origin, (3,)."""
        coordinates = np.array([[self.latitude_rad], [self.longitude_rad], [self.height_m]])
        return np.asarray(ecef(*coordinates)[0])

    @property
    def R_ne(self) -> FloatArray:
        """Rotation from ECEF to the local frame, (3, 3)."""
        coordinates = np.array([[self.latitude_rad], [self.longitude_rad]])
        return np.asarray(ned_axes(*coordinates)[0])

    def to_n(self, p_e_m: FloatArray) -> FloatArray:
        """Return (n, 3) local positions of ECEF positions."""
        return np.asarray((p_e_m - self.p_e_m) @ self.R_ne.T)

    def to_e(self, p_n_m: FloatArray) -> FloatArray:
        """Return (n, 3) ECEF positions of local positions."""
        return np.asarray(p_n_m @ self.R_ne + self.p_e_m)

    def local_ned(self, p_n_m: FloatArray) -> FloatArray:
        """Return (n, 3, 3) rotations from the NED axes at each position to the frame ``n``.

        Files and instruments speak of north where the vehicle is; the frame ``n`` stays where the
        origin is. ``v_n = local_ned(p_n_m) @ v_ned``.
        """
        coordinates = geodetic(self.to_e(p_n_m))
        return np.asarray(self.R_ne @ ned_axes(coordinates[:, 0], coordinates[:, 1]).swapaxes(1, 2))

    @property
    def earth_rate_n_radps(self) -> FloatArray:
        """Rotation rate of the Earth in the local frame, (3,)."""
        return np.asarray(self.R_ne @ np.array([0.0, 0.0, EARTH_RATE_RADPS]))

    def gravity_n_mps2(self, p_n_m: FloatArray, model: GravityModel = "wgs84-normal") -> FloatArray:
        """Return (n, 3) plumb-line gravity, centrifugal part included, at local positions.

        Parameters
        ----------
        p_n_m : ndarray, shape (n, 3)
            Positions.
        model : {"wgs84-normal", "j2", "constant"}
            Somigliana's normal gravity with its second-order height term and deflection [1]_;
            central term and J2 plus centrifugal; or 9.81 m/s2 along the local vertical (the
            paper's Eq. 23).

        References
        ----------
        .. [1] Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems,
           2nd ed., Eqs. 2.134, 2.139, 2.140.
        """
        p_e_m = self.to_e(p_n_m)
        if model == "j2":
            return _j2_gravity_e_mps2(p_e_m) @ self.R_ne.T
        coordinates = geodetic(p_e_m)
        g_ned_mps2 = np.zeros_like(p_n_m)
        if model == "constant":
            g_ned_mps2[:, 2] = STANDARD_GRAVITY_MPS2
        elif model == "wgs84-normal":
            g_ned_mps2[:, 0], g_ned_mps2[:, 2] = _normal_gravity_mps2(
                coordinates[:, 0], coordinates[:, 2]
            )
        else:
            raise BadInputError(
                f"gravity model: must be wgs84-normal, j2 or constant, got {model!r}"
            )
        R_ne_there = ned_axes(coordinates[:, 0], coordinates[:, 1])
        g_e_mps2 = np.einsum("nij,ni->nj", R_ne_there, g_ned_mps2)
        return np.asarray(g_e_mps2 @ self.R_ne.T)


def _normal_gravity_mps2(
    latitude_rad: FloatArray, height_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the north and down components of normal gravity, each (n,)."""
    s2 = np.sin(latitude_rad) ** 2
    surface = (
        _EQUATOR_GRAVITY_MPS2 * (1 + _SOMIGLIANA * s2) / np.sqrt(1 - ECCENTRICITY_SQUARED * s2)
    )
    a = SEMI_MAJOR_AXIS_M
    linear = 2 / a * (1 + FLATTENING * (1 - 2 * s2) + _M) * height_m
    down = surface * (1 - linear + 3 * height_m**2 / a**2)
    north = -8.08e-9 * height_m * np.sin(2 * latitude_rad)  # Groves Eq. 2.140
    return north, down


def _j2_gravity_e_mps2(p_e_m: FloatArray) -> FloatArray:
    """Return (n, 3) gravitation of the central term and J2, plus centrifugal acceleration."""
    r = np.linalg.norm(p_e_m, axis=1, keepdims=True)
    z2 = (p_e_m[:, 2:] / r) ** 2
    q = 1.5 * J2 * (SEMI_MAJOR_AXIS_M / r) ** 2
    factor = np.concatenate([1 + q * (1 - 5 * z2)] * 2 + [1 + q * (3 - 5 * z2)], axis=1)
    g_e_mps2 = -GM_M3PS2 / r**3 * factor * p_e_m
    g_e_mps2[:, :2] += EARTH_RATE_RADPS**2 * p_e_m[:, :2]
    return np.asarray(g_e_mps2)
