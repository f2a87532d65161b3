"""Carrier phase wind-up: circularly polarised waves count the turns of the antenna."""

import numpy as np

from fgnav.checks import FloatArray

_X_B = np.array([1.0, 0.0, 0.0])  # the dipoles of an antenna that looks along -z_b
_Y_B = np.array([0.0, -1.0, 0.0])
_SMALL = 1e-9


def wind_up(
    e_b: FloatArray, pole_b: FloatArray, w_nb_b_radps: FloatArray, t_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return by how many cycles phase is longer, (n, m), and how fast that grows, cycles per s.

    The angle about the line of sight from the satellite's effective dipole to the receiver's [1]_.
    All antennas of a rigid body look alike, so it cancels in differences between them. Between
    epochs the count follows the rate, so a body may turn many times from one to the next as long as
    it does so evenly. Satellites keep an axis toward the pole: their own turn after the Sun, slower
    than one in an hour, is left out.

    Parameters
    ----------
    e_b : ndarray, shape (n, m, 3)
        Directions to satellites in body axes; NaN where there is none.
    pole_b : ndarray, shape (n, 3)
        Direction of the Earth's axis in body axes.
    w_nb_b_radps : ndarray, shape (n, 3)
    t_s : ndarray, shape (n,)

    References
    ----------
    .. [1] Wu, Wu, Hajj, Bertiger and Lichten, Effects of antenna orientation on GPS carrier phase,
       Manuscripta Geodaetica 18, 1993.
    """
    k_b = -e_b
    satellite_b = _across(k_b, pole_b[:, None])
    receiver_b = _dipole(k_b, _X_B, _Y_B)
    rotating_b = _dipole(
        k_b, np.cross(w_nb_b_radps, _X_B)[:, None], np.cross(w_nb_b_radps, _Y_B)[:, None]
    )
    sine = _dot(k_b, np.cross(satellite_b, receiver_b))
    cycles = np.arctan2(sine, _dot(satellite_b, receiver_b)) / (2 * np.pi)
    size = np.maximum(_dot(receiver_b, receiver_b), _SMALL)
    rate = _dot(k_b, np.cross(receiver_b, rotating_b)) / size / (2 * np.pi)
    steps = np.diff(cycles, axis=0)
    expected = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t_s)[:, None]
    steps += np.rint(np.nan_to_num(expected - steps))
    grown = np.concatenate([np.zeros_like(cycles[:1]), np.cumsum(np.nan_to_num(steps), axis=0)])
    first = np.take_along_axis(cycles, np.isfinite(cycles).argmax(axis=0)[None], axis=0)
    return np.nan_to_num(first) + grown, rate


def _across(k_b: FloatArray, v_b: FloatArray) -> FloatArray:
    """Return the part of vectors that is across the lines of sight."""
    return np.asarray(v_b - k_b * _dot(k_b, v_b)[..., None])


def _dipole(k_b: FloatArray, x_b: FloatArray, y_b: FloatArray) -> FloatArray:
    """Return effective dipoles of a receiver's crossed ones, (n, m, 3)."""
    return np.asarray(_across(k_b, x_b) + np.cross(k_b, y_b))


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray((a * b).sum(axis=-1))
