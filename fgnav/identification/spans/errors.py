"""What errors of the inertial unit add to its samples, by three numbers each."""

import numpy as np

from fgnav.checks import FloatArray

SAMPLES = {"accelerometer": "f_b_mps2", "gyroscope": "w_b_radps"}
DRIFT = "drift"  # of a bias, over all of a record


def added(shape: str, x: FloatArray, u: FloatArray, t_s: FloatArray) -> FloatArray:
    """Return what an error adds to samples x of times t_s, (n, 3).

    Parameters
    ----------
    shape : str
        Of ``span_offsets.SHAPES``, or a drift, which is u in all.
    x, u, t_s : ndarray, shapes (n, 3), (3,), (n,)
    """
    if shape == "offset":
        return np.broadcast_to(u, x.shape)
    if shape == DRIFT:
        return np.outer((t_s - t_s[[0, -1]].mean()) / (t_s[-1] - t_s[0]), u)
    return x * u if shape == "scale" else np.cross(x, u)
