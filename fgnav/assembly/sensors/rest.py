"""Seconds at rest, in which noises of the inertial unit and of fixes are other ones than in motion.

Vibration is noise of an inertial unit, and a receiver that filters its solution errs less at rest.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fgnav.assembly.position.antenna_motion import AntennaMotion
from fgnav.assembly.position.series import VectorSeries
from fgnav.assembly.sensors.standstill import WINDOW_S, Standing
from fgnav.checks import BoolArray, FloatArray
from fgnav.graph.types.motion import Motion
from fgnav.types.flight import Imu

AT_REST = " at rest"  # after the name of a noise
_SAME_S = 1e-6


@dataclass(frozen=True, eq=False, slots=True)
class Rest:
    """Seconds at rest."""

    until_s: FloatArray  # (k,): their ends, in turn
    causal: bool = False  # whether one is at rest only once it is over

    @classmethod
    def of(cls, stands: Standing, t_s: FloatArray, *, causal: bool) -> "Rest":
        """Return the seconds of standstill before keyframes, (n,)."""
        return cls(t_s[stands.row], causal)

    def contains(self, t_s: FloatArray) -> BoolArray:
        """Select the times, (n,), at standstill; causal: the last of each second."""
        if not len(self.until_s):
            return np.zeros(len(t_s), dtype=np.bool_)
        after = np.searchsorted(self.until_s, t_s - _SAME_S)
        until_s = np.append(self.until_s, np.inf)[after]
        back_s = _SAME_S if self.causal else WINDOW_S - _SAME_S
        return np.asarray(t_s > until_s - back_s)

    def share(self, t_s: FloatArray) -> FloatArray:
        """Return the share of each interval between times, (n - 1,), that is at rest.

        Causal: of what is over with the interval.
        """
        if not len(self.until_s):
            return np.zeros(len(t_s) - 1)
        from_s = np.maximum(self.until_s - WINDOW_S, np.append(-np.inf, self.until_s[:-1]))
        total_s = np.append(0.0, np.cumsum(self.until_s - from_s))
        knots_s = np.column_stack([from_s, self.until_s]).ravel()
        rested_s = np.interp(t_s, knots_s, np.column_stack([total_s[:-1], total_s[1:]]).ravel())
        until_s = rested_s[1:]
        if self.causal:
            until_s = total_s[np.searchsorted(self.until_s, t_s[1:] + _SAME_S)]
        return np.asarray((until_s - rested_s[:-1]).clip(0) / np.diff(t_s))


def moving_antenna(
    antenna: AntennaMotion, t_s: FloatArray, rest: Rest, factors: Mapping[str, float]
) -> AntennaMotion:
    """Return positions and velocities at keyframes, (n,), with other noise at rest."""
    if not factors:
        return antenna
    at_rest = rest.contains(t_s)

    def scaled(series: VectorSeries, name: str) -> VectorSeries:
        factor = np.where(at_rest, factors.get(name, 1.0), 1.0)
        return replace(series, covariance=series.covariance * factor[:, None, None] ** 2)

    return replace(
        antenna,
        positions=tuple((name, scaled(one, "position")) for name, one in antenna.positions),
        velocities=tuple((name, scaled(one, "velocity")) for name, one in antenna.velocities),
    )


def resting_motion(motion: Motion, imu: Imu, rest: Rest, factors: Mapping[str, float]) -> Motion:
    """Return a motion with other white noise of its unit at rest."""
    if not factors:
        return motion
    share = rest.share(motion.t_s)

    def more(name: str, density: float) -> FloatArray:
        factor = factors.get(name, 1.0)
        return np.asarray(share * (factor**2 - 1.0) * density**2)

    return motion.with_added_noise(
        more("accelerometer", imu.accelerometer_noise_mps2_per_sqrt_hz),
        more("gyroscope", imu.gyroscope_noise_radps_per_sqrt_hz or 0.0),
    )
