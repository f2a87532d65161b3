"""Axes that turn with the Earth, and axes that do not."""

import numpy as np

from fgnav.checks import FloatArray


def turned(p_m: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Return positions (…, 3) turned about z by angles that broadcast against (…)."""
    s, c = np.sin(angle_rad), np.cos(angle_rad)
    x, y = p_m[..., 0], p_m[..., 1]
    return np.stack([c * x - s * y, s * x + c * y, p_m[..., 2]], axis=-1)
