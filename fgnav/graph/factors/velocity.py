"""Velocities of one antenna relative to the Earth, with lever arm and body rate.

``r = W (v_n + R_nb w_b x (a_b + l_b) - z_n)``: accelerometer at v_n, w_b the body's rate against n,
a_b + l_b the antenna from the accelerometer [1]_. With a gyroscope w_b is its rate less its bias
and less the Earth's, without one it is itself a state.

References
----------
.. [1] Groves: Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd
   edition, 2013, section 14.3.1: innovation of a loosely coupled velocity.
"""

from dataclasses import dataclass
from typing import ClassVar

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph import keys
from fgnav.graph.factors.position import LEVER_ARM
from fgnav.graph.sensor_rows import SensorRows, Shapes, rate_variables, sensor_factor
from fgnav.graph.types.arrays import contiguous, zero_rows
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import kernel

_NO_GYROSCOPE = np.empty((0, 3))
_NO_GYROSCOPE.flags.writeable = False  # the type that the kernel is compiled for


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Velocity(SensorRows):
    """Velocities of an antenna in ``n``, three rows each."""

    name: ClassVar[str] = "velocity"
    timed_by_receiver: ClassVar[bool] = True
    rows: ClassVar[int] = 3
    parameters: ClassVar[tuple[str, ...]] = (LEVER_ARM,)
    whitening: ClassVar[str] = "white"
    shapes: ClassVar[Shapes] = {
        "value_n_mps": ("k", 3),
        "white": ("k", 3, 3),
        "arm_b_m": (3,),
        "measured_b_radps": ("k", 3),
        "earth_rate_n_radps": (3,),
    }
    value_n_mps: FloatArray  # (k, 3)
    # W: inverse Cholesky factors of covariances; rows of zeros for what is not known.
    white: FloatArray  # (k, 3, 3)
    # From the accelerometer to the antenna; zero of velocities of the accelerometer itself.
    arm_b_m: FloatArray  # (3,)
    # The gyroscope's rates at those keyframes: w_b is that less the bias; None without one.
    measured_b_radps: FloatArray | None  # (k, 3)
    earth_rate_n_radps: FloatArray  # (3,)

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of velocities ``indices``, (j,); see ``Sensor``."""
        measured = self.measured_b_radps
        return Linearised._make(
            _kernel(
                *contiguous(at, indices),
                self.value_n_mps,
                self.white,
                _NO_GYROSCOPE if measured is None else measured,
                self.arm_b_m,
                self.earth_rate_n_radps,
                self.constants.column(LEVER_ARM),
            )
        )

    def factor(self, i: int, key: int) -> gtsam.NonlinearFactor:
        """Return velocity i as a factor of keyframe ``key``: native at the accelerometer."""
        if self.constants.column(LEVER_ARM) < 0 and not self.arm_b_m.any():
            noise = gtsam.noiseModel.Gaussian.SqrtInformation(self.white[i], False)
            return gtsam.PriorFactorVector(keys.velocity(key), self.value_n_mps[i], noise)
        return sensor_factor(self, i, key, rate_variables(self.measured_b_radps))


@kernel
def _kernel(
    at: States,
    indices: IntArray,
    value_n_mps: FloatArray,
    whites: FloatArray,
    measured_b_radps: FloatArray,
    arm_b_m: FloatArray,
    earth_rate_n_radps: FloatArray,
    lever: int,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    value, state, shared = zero_rows(at, indices, 3)
    arm, difference, sign = arm_b_m.copy(), np.empty(3), 1.0 if len(measured_b_radps) == 0 else -1.0
    if lever >= 0:
        for c in range(3):
            arm[c] += at.constants[lever + c]
    cross = rot.skew(arm)
    for k in range(len(indices)):
        i, R = indices[k], at.R_nb[k]
        # A state of the rate is that against n, a gyroscope's that against inertial space.
        earth_b = rot.scaled(rot.times(rot.transposed(R), earth_rate_n_radps), (1.0 - sign) / 2)
        rate = _relative_rate(at.aux[k], measured_b_radps, i, earth_b)
        spin, turned = rot.skew(rate), rot.product(whites[i], R)
        arm_velocity_b = rot.times(spin, arm)
        arm_velocity_n, by_rate = rot.times(R, arm_velocity_b), rot.product(turned, cross)
        # By the rotation d it changes in b by a x (e_b x d), what R makes of it by -velocity x d.
        bend, outer = rot.product(cross, rot.skew(earth_b)), rot.skew(arm_velocity_b)
        for m in range(3):
            for c in range(3):
                bend[m, c] -= outer[m, c]
        by_rotation, by_lever = rot.product(turned, bend), rot.product(turned, spin)
        for c in range(3):
            difference[c] = at.v_n_mps[k, c] + arm_velocity_n[c] - value_n_mps[i, c]
        for m in range(3):
            for c in range(3):
                value[k, m] += whites[i, m, c] * difference[c]
                state[k, m, c] = by_rotation[m, c]
                state[k, m, 6 + c] = whites[i, m, c]
                state[k, m, 12 + c] = -sign * by_rate[m, c]
                if lever >= 0:
                    shared[k, m, lever + c] = by_lever[m, c]
    return value, state, shared


@kernel
def _relative_rate(
    aux: FloatArray, measured_b_radps: FloatArray, i: int, earth_b: FloatArray
) -> FloatArray:
    """Return the body's rate against the Earth, (3,), in body axes."""
    rate = np.empty(3)
    for c in range(3):
        rate[c] = aux[3 + c]
        if len(measured_b_radps) > 0:
            rate[c] = measured_b_radps[i, c] - aux[3 + c] - earth_b[c]
    return rate
