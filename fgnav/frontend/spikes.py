"""Single inertial samples that no motion makes: apart from both neighbours, which agree."""

from dataclasses import replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, Loss
from fgnav.types.flight import Imu

_NORMAL = 1.4826  # sigma of normal noise over its median size
# Of normal noise one of 1e88; of a vibrating unit, whose tails are long, none of its neighbours is
# that near (Hampel's identifier with its window of three: Pearson, Outliers in process modeling
# and identification, IEEE Trans. Control Systems Technology 10, 2002).
_SIGMAS = 20.0
_NEIGHBOURS = 6.0  # sigmas by which neighbours of a spike may differ
_FEWEST = 100


def without_spikes(imu: Imu) -> tuple[Imu, tuple[Loss, ...]]:
    """Return a record whose spikes are replaced by the means of their neighbours."""
    if len(imu.t_s) < _FEWEST:
        return imu, ()
    force, of_force = _replaced(imu.f_b_mps2)
    rate, of_rate = (None, of_force[:0]) if imu.w_b_radps is None else _replaced(imu.w_b_radps)
    count = int(of_force.sum() + of_rate.sum())
    if not count:
        return imu, ()
    names = [n for n, s in (("accelerometer", of_force), ("gyroscope", of_rate)) if s.any()]
    reason = f"a spike of the {' and the '.join(names)}: the mean of its neighbours stands in"
    loss = Loss(what="inertial sample", reason=reason, count=count)
    return replace(imu, f_b_mps2=force, w_b_radps=rate), (loss,)


def _replaced(x: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return samples, (k, 3), without spikes, and which they were, (k,)."""
    spike = np.zeros(len(x), dtype=np.bool_)
    middle, apart = (x[2:] + x[:-2]) / 2, np.abs(x[2:] - x[:-2])
    off = np.abs(x[1:-1] - middle)
    sigma = _NORMAL * np.median(off, axis=0)
    far = (off > _SIGMAS * sigma) & (off > _SIGMAS / _NEIGHBOURS * apart) & (sigma > 0)
    spike[1:-1] = far.any(axis=1)
    return np.where(spike[:, None], np.vstack([x[:1], middle, x[-1:]]), x), spike
