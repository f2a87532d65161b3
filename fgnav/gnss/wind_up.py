"""Phase wind-up of an antenna on top of a turning body."""

import numpy as np

from fgnav.checks import FloatArray


def wind_up_cycles(e_n: FloatArray, R_nb: FloatArray, pole_n: FloatArray) -> FloatArray:
    """Return by how many cycles turns lengthen the phase of each satellite, (n, m).

    The angle about the line of sight between the effective dipoles of satellite and receiver [1]_,
    counted on from epoch to epoch, between which the body must turn by less than half a turn. The
    antenna looks along -z_b; satellites keep an axis toward the pole, as they nearly do for the
    minutes of an arc.

    Parameters
    ----------
    e_n : ndarray, shape (n, m, 3)
        Unit vectors to satellites; NaN where there is none.
    R_nb : ndarray, shape (n, 3, 3)
    pole_n : ndarray, shape (3,)
        The Earth's axis.

    References
    ----------
    .. [1] Wu, Wu, Hajj, Bertiger, Lichten, "Effects of antenna orientation on GPS carrier phase",
       Manuscripta Geodaetica 18, 1993.
    """
    down_n = -e_n  # the way the signal goes
    x_n, left_n = R_nb[:, None, :, 0], -R_nb[:, None, :, 1]
    receiver = x_n - down_n * (down_n * x_n).sum(axis=2, keepdims=True) + np.cross(down_n, left_n)
    satellite = pole_n - down_n * (down_n @ pole_n)[:, :, None]
    sine = (down_n * np.cross(satellite, receiver)).sum(axis=2)
    cycles = np.arctan2(sine, (satellite * receiver).sum(axis=2)) / (2 * np.pi)
    steps = np.nan_to_num(np.diff(cycles, axis=0, prepend=cycles[:1]))
    return np.asarray(cycles - np.cumsum(np.rint(steps), axis=0))
