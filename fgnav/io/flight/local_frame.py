"""Between files, which speak of the NED axes at the vehicle, and ``n``, fixed at the origin."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.earth import Origin, ecef, geodetic
from fgnav.geometry.rotations import from_euler, to_euler


def place_to_n(origin: Origin, place: FloatArray) -> FloatArray:
    """Return (k, 3) local positions of latitude deg, longitude deg, height m."""
    return origin.to_n(ecef(np.radians(place[:, 0]), np.radians(place[:, 1]), place[:, 2]))


def place_of_n(origin: Origin, p_n_m: FloatArray) -> FloatArray:
    """Return (k, 3) latitude deg, longitude deg, height m of local positions.

    Examples
    --------
    >>> origin = Origin(latitude_rad=0.7, longitude_rad=0.1, height_m=500.0)
    >>> place_of_n(origin, np.zeros((1, 3))).round(6)
    array([[ 40.107046,   5.729578, 500.      ]])
    """
    coordinates = geodetic(origin.to_e(p_n_m))
    coordinates[:, :2] = np.degrees(coordinates[:, :2])
    return coordinates


def velocity_to_n(origin: Origin, p_n_m: FloatArray, v_ned_mps: FloatArray) -> FloatArray:
    """Return (k, 3) velocities in the frame ``n`` of those along the NED axes at the vehicle."""
    return np.asarray(np.einsum("kij,kj->ki", origin.local_ned(p_n_m), v_ned_mps))


def velocity_of_n(origin: Origin, p_n_m: FloatArray, v_n_mps: FloatArray) -> FloatArray:
    """Return (k, 3) velocities along the NED axes at the vehicle."""
    return np.asarray(np.einsum("kji,kj->ki", origin.local_ned(p_n_m), v_n_mps))


def attitude_to_n(origin: Origin, p_n_m: FloatArray, euler_deg: FloatArray) -> FloatArray:
    """Return (k, 3, 3) R_nb of Euler angles against the NED axes at the vehicle."""
    return np.asarray(origin.local_ned(p_n_m) @ from_euler(*np.radians(euler_deg).T))


def attitude_of_n(origin: Origin, p_n_m: FloatArray, R_nb: FloatArray) -> FloatArray:
    """Return (k, 3) roll, pitch, yaw, deg, against the NED axes at the vehicle."""
    return np.degrees(to_euler(origin.local_ned(p_n_m).swapaxes(1, 2) @ R_nb))
