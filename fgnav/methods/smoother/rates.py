"""Body rates as good as they are before smoothing, and what they take off an antenna's motion."""

from dataclasses import dataclass

import numpy as np

from fgnav.attitude.own_rotation import OwnRotation, despun
from fgnav.checks import FloatArray
from fgnav.flight import Imu
from fgnav.methods.smoother.keyframes import Timed
from fgnav.methods.smoother.preintegration import RATE_SPAN_S, angular_rates
from fgnav.rotations import skew, transpose

# 1-sigma of the first body rate: of a body at rest, and in multiples of the flight's usual rates.
# Five turns a second for all would let a search that knows little of roll turn over and over.
_RATE_AT_REST_RADPS, _USUAL_RATES = 1.0, 3.0


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Rates:
    """Body rates at keyframes.

    Attributes
    ----------
    w_b_radps : ndarray, shape (n, 3)
    covariance_rad2ps2 : ndarray, shape (3, 3)
    """

    w_b_radps: FloatArray
    covariance_rad2ps2: FloatArray

    @classmethod
    def of(
        cls,
        imu: Imu,
        t_s: FloatArray,
        R_nb: FloatArray,
        covariance_rad2: FloatArray,
        own: OwnRotation | None = None,
    ) -> "Rates":
        """Return what the gyroscope says, or else attitudes, (n, 3, 3), with their covariances.

        A spin may be half a turn from one attitude to the next: what is known of it is taken out.
        """
        if imu.w_b_radps is not None and imu.gyroscope_bias_radps is not None:
            measured = [np.interp(t_s, imu.t_s, column) for column in imu.w_b_radps.T]
            covariance = np.eye(3) * imu.gyroscope_bias_radps**2
            return cls(w_b_radps=np.stack(measured, axis=1), covariance_rad2ps2=covariance)
        covariance = 2 * covariance_rad2.mean(axis=0) / RATE_SPAN_S**2
        rest_radps = angular_rates(t_s, despun(own, t_s, R_nb))
        if own is not None:
            rest_radps = np.einsum("nji,nj->ni", own.at(t_s), rest_radps) + own.rates(t_s)
        return cls(w_b_radps=rest_radps, covariance_rad2ps2=covariance)

    def at_accelerometer(self, velocity: Timed | None, R_nb: FloatArray) -> Timed | None:
        """Take an antenna's swing about the accelerometer off its velocity, and say how well.

        The rates are those before smoothing: a few cm/s with a metre of lever arm, well below
        Doppler.
        """
        if velocity is None or not velocity.arm_b_m.any():
            return velocity
        arm = skew(velocity.arm_b_m[None])[0]
        swing_n_mps = np.einsum("nij,nj->ni", R_nb, np.cross(self.w_b_radps, velocity.arm_b_m))
        doubt = R_nb @ (arm @ self.covariance_rad2ps2 @ arm.T) @ transpose(R_nb)
        return Timed(
            value=velocity.value - swing_n_mps,
            covariance=velocity.covariance + doubt,
            arm_b_m=np.zeros(3),
        )

    def slot(self, imu: Imu) -> tuple[FloatArray, FloatArray]:
        """Return the bias slot's start, (n, 6), and its prior, (6,); see ``preintegration``."""
        slot, sigma = np.zeros((len(self.w_b_radps), 6)), imu.gyroscope_bias_radps
        if sigma is None:
            slot[:, 3:] = -self.w_b_radps
            usual_radps = float(np.sqrt((self.w_b_radps**2).sum(axis=1).mean()))
            sigma = _RATE_AT_REST_RADPS + _USUAL_RATES * usual_radps
        return slot, np.repeat([imu.accelerometer_bias_mps2, sigma], 3)
