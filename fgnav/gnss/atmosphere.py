"""Delays of the ionosphere and the troposphere by the models receivers use."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.earth import C_MPS

_TROPOPAUSE_K = 216.65  # of the standard atmosphere; keeps the model sane for flights above 11 km
_RELATIVE_HUMIDITY = 0.7  # what RTKLIB assumes


def klobuchar_m(
    coefficients: FloatArray,
    place: FloatArray,
    elevation_rad: FloatArray,
    azimuth_rad: FloatArray,
    gps_s: FloatArray,
) -> FloatArray:
    """Return the ionosphere's delay at GPS L1 by the broadcast model, m, (n, m).

    At another frequency f it is larger by ``(f_L1 / f) ** 2``. A phase is advanced by as much.

    Parameters
    ----------
    coefficients : ndarray, shape (8,)
        Alpha and beta; all zero means no ionosphere: 0 is returned, not the model's night floor.
    place : ndarray, shape (n, 3)
        Latitude and longitude, rad, height, m, of the receiver.
    elevation_rad, azimuth_rad : ndarray, shape (n, m)
    gps_s : ndarray, shape (n,)
        GPS time.

    References
    ----------
    .. [1] IS-GPS-200N, 20.3.3.5.2.5. Angles there are in semicircles.
    """
    if not coefficients.any():
        return np.zeros_like(elevation_rad)
    elevation = elevation_rad / np.pi
    psi = 0.0137 / (elevation + 0.11) - 0.022
    latitude = place[:, :1] / np.pi + psi * np.cos(azimuth_rad)
    latitude = np.clip(latitude, -0.416, 0.416)
    longitude = place[:, 1:2] / np.pi + psi * np.sin(azimuth_rad) / np.cos(latitude * np.pi)
    magnetic = latitude + 0.064 * np.cos((longitude - 1.617) * np.pi)
    local_s = (43200.0 * longitude + gps_s[:, None]) % 86400.0
    amplitude_s = np.polynomial.polynomial.polyval(magnetic, coefficients[:4]).clip(0.0)
    period_s = np.polynomial.polynomial.polyval(magnetic, coefficients[4:]).clip(72000.0)
    x = 2 * np.pi * (local_s - 50400.0) / period_s
    day = np.where(np.abs(x) < 1.57, amplitude_s * (1 + x**2 * (-0.5 + x**2 / 24)), 0.0)
    slant = 1 + 16 * (0.53 - elevation) ** 3
    return np.asarray(C_MPS * slant * (5e-9 + day))


def saastamoinen_m(place: FloatArray, elevation_rad: FloatArray) -> FloatArray:
    """Return the delay of a standard troposphere, m, (n, m), for receivers at places (n, 3).

    Saastamoinen's zenith delays over the sine of the elevation: good to 0.1 m above 15 degrees.

    References
    ----------
    .. [1] Saastamoinen, Atmospheric correction for the troposphere and stratosphere in radio
       ranging of satellites, 1972; standard atmosphere as in the RTKLIB 2.4.2 manual, E.5 (1).
    """
    latitude, height = place[:, 0], place[:, 2].clip(0.0)
    pressure_hpa = 1013.25 * (1 - 2.2557e-5 * height).clip(0.0) ** 5.2568
    kelvin = (288.16 - 6.5e-3 * height).clip(_TROPOPAUSE_K)
    vapour_hpa = 6.108 * _RELATIVE_HUMIDITY * np.exp((17.15 * kelvin - 4684) / (kelvin - 38.45))
    gravity = 1 - 0.00266 * np.cos(2 * latitude) - 2.8e-7 * height
    dry = 0.0022768 * pressure_hpa / gravity
    wet = 0.002277 * (1255 / kelvin + 0.05) * vapour_hpa
    return np.asarray((dry + wet)[:, None] / np.sin(elevation_rad).clip(0.05))
