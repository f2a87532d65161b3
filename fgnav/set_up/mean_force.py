"""Mean specific force over spans of a track: the change of velocity less gravity.

Of axes that do not turn, so that it says something of a body that turns as it likes: no mean size
of specific force is less, and what it encloses with another vector of ``n`` is seen from the body.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.attitude.flight_vectors import Track
from fgnav.checks import FloatArray
from fgnav.geometry.earth import Origin
from fgnav.types.flight import Imu

_G_MPS2 = 9.80665
_FEWEST = 20
_NEAR_S = 2.5
_SPAN_S = 1.0  # over which velocities of .5 m/s noise still tell gravity to 7 %


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class MeanForces:
    """Of k spans, half of gravity at the least: less, and velocities' noise might be it.

    Attributes
    ----------
    begin_s, end_s : ndarray, shape (k,)
    f_n_mps2 : ndarray, shape (k, 3)
    """

    begin_s: FloatArray
    end_s: FloatArray
    f_n_mps2: FloatArray

    def within(self, begin_s: float, end_s: float) -> "MeanForces | None":
        """Return those of a time; None where there are fewer than ten."""
        inside = (self.begin_s >= begin_s) & (self.end_s <= end_s)
        if inside.sum() < _FEWEST // 2:
            return None
        return MeanForces(
            begin_s=self.begin_s[inside], end_s=self.end_s[inside], f_n_mps2=self.f_n_mps2[inside]
        )

    def mean_of(self, t_s: FloatArray, values: FloatArray) -> FloatArray:
        """Return means over the spans, (k,), of values at times, (m,), on straight lines."""
        steps = (values[1:] + values[:-1]) / 2 * np.diff(t_s)
        total = np.concatenate([[0.0], np.cumsum(steps)])
        gained = np.interp(self.end_s, t_s, total) - np.interp(self.begin_s, t_s, total)
        return np.asarray(gained / (self.end_s - self.begin_s))


def mean_forces(imu: Imu, track: Track, origin: Origin) -> MeanForces | None:
    """Return them within a unit's record; None where a track tells fewer than ten."""
    if track.v_n_mps is None or len(track.t_s) < _FEWEST or len(imu.t_s) < 2:
        return None
    t_s = track.t_s
    end = np.searchsorted(t_s, t_s + _SPAN_S - 1e-9)
    begin = np.flatnonzero(end < len(t_s))
    end = end[begin]
    near = (
        (t_s[end] - t_s[begin] < _NEAR_S) & (t_s[begin] >= imu.t_s[0]) & (t_s[end] <= imu.t_s[-1])
    )
    begin, end = begin[near], end[near]
    span_s = (t_s[end] - t_s[begin])[:, None]
    gravity_n_mps2 = origin.gravity_n_mps2(track.p_n_m[begin])
    f_n_mps2 = (track.v_n_mps[end] - track.v_n_mps[begin]) / span_s - gravity_n_mps2
    heavy = np.linalg.norm(f_n_mps2, axis=1) > _G_MPS2 / 2
    if heavy.sum() < _FEWEST // 2:
        return None
    return MeanForces(begin_s=t_s[begin][heavy], end_s=t_s[end][heavy], f_n_mps2=f_n_mps2[heavy])


def share_of_least(imu: Imu, forces: MeanForces) -> float:
    """Return the median of the mean size of specific force over the least that it can be.

    However a body turns, the mean size of specific force over a span is no less than the size of
    its mean in axes that do not turn. Noise and vibration only add to it.
    """
    size_mps2 = forces.mean_of(imu.t_s, np.linalg.norm(imu.f_b_mps2, axis=1))
    return float(np.median(size_mps2 / np.linalg.norm(forces.f_n_mps2, axis=1)))
