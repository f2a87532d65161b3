"""How briskly a body turns, for a filter: what the next attitude needs, not the one between two.

A smoother knows the attitudes on both sides, and the least intensity with which they foretell the
one between them follows a smooth motion too slowly for a filter, which has only those before.
"""

from dataclasses import replace

import numpy as np

from fgnav.attitude.quadratic import tangent_jacobian
from fgnav.checks import FloatArray
from fgnav.methods.smoother.density import angular_acceleration_density
from fgnav.methods.smoother.gaps import BridgingPreintegrator
from fgnav.methods.smoother.keyframes import Keyframes

_FEWEST = 5  # attitudes
_LEAST = 1.0  # 1/rad2: an attitude known to less than a radian about some axis tells no rates


def foretelling(keyframes: Keyframes) -> Keyframes:
    """Return keyframes whose intensity of angular acceleration is told by innovations.

    As they are where a gyroscope tells the rate, or where no array tells attitudes.
    """
    pre, ahead = keyframes.preintegrate, array_attitudes(keyframes)
    if pre.imu.w_b_radps is not None or ahead is None:
        return keyframes
    density = np.maximum(
        angular_acceleration_density(*ahead, ahead=True), pre.angular_acceleration_density
    )
    made = replace(pre, angular_acceleration_density=density)
    if isinstance(pre, BridgingPreintegrator) and isinstance(made, BridgingPreintegrator):
        made = replace(made, density=np.maximum(pre.density, density))
    return replace(keyframes, preintegrate=made)


def array_attitudes(keyframes: Keyframes) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return what the array alone tells of attitude, as ``angular_acceleration_density`` takes it.

    Returns
    -------
    t_s, R_nb, covariance_rad2 : ndarray, shape (k,), (k, 3, 3), (k, 3, 3)
        None where there are next to none.
    """
    row = np.flatnonzero(keyframes.array.sure)
    R_nb = keyframes.R_nb[row]
    J = keyframes.array.root[row] @ tangent_jacobian(R_nb)
    information = J.swapaxes(1, 2) @ J
    sound = np.linalg.eigvalsh(information)[:, 0] > _LEAST
    if sound.sum() < _FEWEST:
        return None
    return keyframes.t_s[row[sound]], R_nb[sound], np.linalg.inv(information[sound])
