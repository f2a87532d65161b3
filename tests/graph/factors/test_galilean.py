"""What samples sum up, compiled: against GTSAM's preintegration, and its noises one by one."""

import gtsam
import numpy as np
import pytest

from fgnav.graph.inertial import galilean_kernel as kernel
from fgnav.graph.types.motion import INERTIAL_NOISES
from tests.graph.factors.motions import EARTH_N_RADPS, GRAVITY_N_MPS2, sine
from tests.graph.factors.test_inertial import of_motion

NOISES = np.array([1e-4, 1e-6, 1e-7, 1e-3, 2e-3, 3e-3, 1e-5, 2e-5, 3e-5])
BIASES = np.array([0.1, -0.2, 0.05, 0.01, -0.02, 0.03])


def samples(rate_radps, step_s, counts=(7, 1, 12)):
    rng = np.random.default_rng(5)
    first = np.concatenate([[0], np.cumsum(counts)])
    force = rng.normal(0.0, 3.0, (first[-1], 3)) - GRAVITY_N_MPS2
    rate = rng.normal(0.0, rate_radps, (first[-1], 3))
    return first, np.full(len(counts), step_s), force, rate


def by_gtsam(steps, row, earth_rate):
    first, step_s, force, rate = steps
    made = gtsam.PreintegrationCombinedParams(GRAVITY_N_MPS2)
    made.setOmegaCoriolis(earth_rate)
    made.setAccelerometerCovariance(NOISES[0] * np.eye(3))
    made.setGyroscopeCovariance(NOISES[1] * np.eye(3))
    made.setIntegrationCovariance(NOISES[2] * np.eye(3))
    made.setBiasAccCovariance(np.diag(NOISES[3:6]))
    made.setBiasOmegaCovariance(np.diag(NOISES[6:]))
    bias = gtsam.imuBias.ConstantBias(BIASES[:3], BIASES[3:])
    measured = gtsam.PreintegratedCombinedMeasurementsG(made, bias)
    for k in range(first[row], first[row + 1]):
        measured.integrateMeasurement(force[k], rate[k], step_s[row])
    return measured


# Of slow turns, of one and two radians in a sub-step, and of forty. An earth that turns a hundred
# times as fast shows its part in velocities' noise.
@pytest.mark.parametrize(
    ("rate_radps", "step_s"), [(0.0, 0.01), (1.0, 0.01), (10.0, 0.1), (20.0, 0.1), (400.0, 0.1)]
)
@pytest.mark.parametrize("earth_rate", [np.zeros(3), EARTH_N_RADPS, 100 * EARTH_N_RADPS])
def test_sums_are_gtsams(rate_radps, step_s, earth_rate):
    steps = samples(rate_radps, step_s)
    j = len(steps[1])
    gravity = np.tile(GRAVITY_N_MPS2, (j, 1))
    rows = kernel.sums(steps, np.tile(BIASES, (j, 1)), np.tile(NOISES, (j, 1)), gravity, earth_rate)
    for row, one in enumerate(rows):
        measured = by_gtsam(steps, row, earth_rate)
        by_bias = np.zeros((9, 6), order="F")
        led = measured.predict(gtsam.NavState(), measured.biasHat(), None, by_bias)
        R = measured.deltaRij().matrix()
        G = one[kernel.FRAME : kernel.GRAVITY_POSITION].reshape(3, 3)
        p, v = measured.deltaPij(), measured.deltaVij()
        place = G @ p + one[kernel.GRAVITY_POSITION : kernel.GRAVITY_VELOCITY]
        speed = G @ v + one[kernel.GRAVITY_VELOCITY : kernel.WHITE] - np.cross(earth_rate, place)
        expected = [measured.deltaTij(), *R.ravel(), *p, *v, *BIASES]
        np.testing.assert_allclose(one[: kernel.BY_BIAS[0]], expected, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(G @ R, led.attitude().matrix(), atol=1e-13)
        np.testing.assert_allclose(place, led.position(), rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(speed, led.velocity(), rtol=1e-12, atol=1e-12)
        rows_by_bias = one[kernel.BY_BIAS[0] : kernel.FRAME].reshape(9, 6)
        by_bias[6:] += np.cross(led.attitude().matrix().T @ earth_rate, by_bias[3:6], axisb=0).T
        np.testing.assert_allclose(rows_by_bias, by_bias, atol=1e-10 * np.abs(by_bias).max())
        W = one[kernel.WHITE :].reshape(15, 15)
        whitened = W @ measured.residualCovariance() @ W.T
        np.testing.assert_allclose(whitened, np.eye(15), atol=1e-8)
        assert not np.tril(W, -1).any()


def test_sums_of_rates_that_no_body_has_end():
    steps = samples(1e150, 0.01)
    j = len(steps[1])
    rows = kernel.sums(
        steps, np.zeros((j, 6)), np.tile(NOISES, (j, 1)), np.zeros((j, 3)), np.zeros(3)
    )
    R = rows[:, kernel.ROTATION : kernel.POSITION].reshape(-1, 3, 3)
    np.testing.assert_allclose(R @ R.swapaxes(1, 2), np.tile(np.eye(3), (j, 1, 1)), atol=1e-9)


def test_noises_add_up_to_the_whole():
    motion, _ = of_motion(sine(45.0), 0.1)
    parts = motion.noise_parts()
    assert parts.names == INERTIAL_NOISES
    whole = parts.parts.sum(axis=1) + parts.rest
    np.testing.assert_allclose(whole, np.tile(np.eye(15), (len(whole), 1, 1)), atol=0.02)
