"""Signals that come twice: echoes from anywhere, and those that the body itself mirrors."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray
from fgnav_sim.gnss.tables import ReflectorTable


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Echoes:
    """Errors by mirrored signals, (n, a, m) each."""

    # code_m, phase_m: by how much pseudorange and phase range are longer
    code_m: FloatArray
    phase_m: FloatArray
    rate_mps: FloatArray  # how fast the phase range grows by it
    gain_db: FloatArray  # by how much C/N0 is higher


def echoes(
    reflectors: tuple[ReflectorTable, ...],
    arms_b_m: FloatArray,
    e_b: FloatArray,
    w_nb_b_radps: FloatArray,
    wavelength_m: FloatArray,
) -> Echoes:
    """Return the errors of signals that arrive directly and by mirrors of the body.

    A mirror in front of which antenna and satellite are, the antenna at distance h and the
    satellite at angle gamma above the plane, adds a way of ``d = 2 h sin(gamma)`` [1]_. With
    amplitudes ``a``, phases ``theta = 2 pi d / wavelength + phase`` and ``z = 1 + sum a
    exp(-i theta)``, the composite lags by ``-arg z``, which for one echo is
    ``atan(a sin(theta) / (1 + a cos(theta)))``. Code is late by the composite's group delay,
    ``Re(sum d a exp(-i theta) / z)``: what any correlator sees of ways far below a chip.

    Parameters
    ----------
    arms_b_m : ndarray, shape (a, 3)
        The antennas.
    e_b : ndarray, shape (n, m, 3)
        Directions to satellites in body axes.
    w_nb_b_radps : ndarray, shape (n, 3)
        The body turns much faster than the satellites move.
    wavelength_m : ndarray, shape (m,)

    References
    ----------
    .. [1] Georgiadou and Kleusberg, On carrier signal multipath effects in relative GPS
       positioning, manuscripta geodaetica 13, 1988.
    """
    shape = (e_b.shape[0], arms_b_m.shape[0], e_b.shape[1])
    echo, delayed, growing = (np.zeros(shape, dtype=complex) for _ in range(3))
    rate_b_radps = -np.cross(w_nb_b_radps[:, None], e_b)
    for mirror in reflectors:
        normal_b = np.array(mirror.normal_b) / np.linalg.norm(mirror.normal_b)
        from_middle_b_m = arms_b_m - np.array(mirror.point_b_m)
        height_m = from_middle_b_m @ normal_b  # (a,)
        sine = e_b @ normal_b  # (n, m)
        longer_m = 2 * height_m[None, :, None] * sine[:, None]
        theta = 2 * np.pi * longer_m / wavelength_m + np.radians(mirror.phase_deg)
        lit = (height_m > 0)[None, :, None] & (sine > 0)[:, None]
        if mirror.radius_m is not None:
            # The antenna's mirror image sees the satellite through the point of reflection.
            image_b_m = from_middle_b_m - 2 * height_m[:, None] * normal_b
            reach_m = height_m[:, None] / np.where(sine > 0, sine, np.inf)[:, None]
            point_b_m = image_b_m[:, None] + reach_m[..., None] * e_b[:, None]
            lit &= np.linalg.norm(point_b_m, axis=-1) <= mirror.radius_m
        wave = np.where(lit, mirror.amplitude * np.exp(-1j * theta), 0.0)
        grows_mps = 2 * height_m[None, :, None] * (rate_b_radps @ normal_b)[:, None]
        echo += wave
        delayed += longer_m * wave
        growing += grows_mps * wave
    composite = 1 + echo
    return Echoes(
        code_m=(delayed / composite).real,
        phase_m=-np.angle(composite) / (2 * np.pi) * wavelength_m,
        rate_mps=(growing / composite).real,
        gain_db=20 * np.log10(np.abs(composite)),
    )
