import gtsam
import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav import rotations
from fgnav.checks import BadInputError
from fgnav.flight import Imu
from fgnav.methods.smoother import preintegration as pre

from .flights import ACCELEROMETER, ORIGIN, motion


def still(hz=100.0, span_s=2.0):
    t = np.arange(round(span_s * hz) + 1) / hz
    return Imu(t_s=t, f_b_mps2=np.tile([0.0, 0, -9.8], (len(t), 1)), **ACCELEROMETER)


def test_sub_steps_fill_each_interval_exactly():
    steps = pre.increments(still(), np.array([0.0, 0.1, 0.25, 1.0]), sub_steps=3)
    counts = np.diff(steps.first)
    assert_allclose(counts * steps.step_s, [0.1, 0.15, 0.75], rtol=1e-12)
    assert list(counts) == [30, 45, 225]
    assert len(steps.f_b_mps2) == 300
    assert not steps.w_b_radps.any()


def test_sub_steps_below_one_are_refused():
    with pytest.raises(BadInputError, match="sub_steps: must be 1 or more, got 0"):
        pre.increments(still(), np.array([0.0, 1.0]), sub_steps=0)


def test_a_turn_is_predicted_to_millimetres_when_bias_and_rate_are_known():
    """The rotating Earth, gravity where the body is, and the rate slot: all at once."""
    amplitude = np.radians(20)
    t = np.arange(1001) / 1000
    R, p, v, a = motion(t, amplitude)
    f_n = a + 2 * np.cross(ORIGIN.earth_rate_n_radps, v) - ORIGIN.gravity_n_mps2(p)
    imu = Imu(t_s=t, f_b_mps2=np.einsum("nji,nj->ni", R, f_n), **ACCELEROMETER)
    key_s = np.arange(101) / 100
    between = rotations.log(
        rotations.transpose(motion(key_s, amplitude)[0]) @ motion(key_s + 0.01, amplitude)[0]
    )
    preintegrate = pre.Preintegrator(
        imu=imu,
        increments=pre.increments(imu, key_s),
        gravity_n_mps2=ORIGIN.gravity_n_mps2(motion(key_s, amplitude)[1]),
        earth_rate_n_radps=ORIGIN.earth_rate_n_radps,
        angular_acceleration_density=np.full(3, 0.01),
    )
    state = gtsam.NavState(gtsam.Pose3(gtsam.Rot3(R[0]), p[0]), v[0])
    for k in range(100):
        turning = between[k] / 0.01 + state.attitude().matrix().T @ ORIGIN.earth_rate_n_radps
        bias = gtsam.imuBias.ConstantBias(np.zeros(3), -turning)
        state = preintegrate(k, bias).predict(state, bias)
    assert np.abs(state.position() - p[-1]).max() < 1e-3
    assert np.abs(state.velocity() - v[-1]).max() < 1e-3
    turned = rotations.log((state.attitude().matrix().T @ R[-1])[None])
    assert np.degrees(np.abs(turned).max()) < 1e-3


def test_covariance_of_an_interval_matches_many_simulated_ones():
    """Rotation, velocity and rate of white angular acceleration and white accelerometer noise."""
    rng = np.random.default_rng(1)
    runs, span_s, density = 400, 0.1, 0.04
    f_b = np.array([3.0, 1.0, -9.8])
    imu = still(span_s=0.2)
    preintegrate = pre.Preintegrator(
        imu=imu,
        increments=pre.increments(imu, np.array([0.0, span_s]), sub_steps=10),
        gravity_n_mps2=np.zeros((2, 3)),
        earth_rate_n_radps=np.zeros(3),
        angular_acceleration_density=np.full(3, density),
    )
    fine, dt = 200, span_s / 200
    rate = np.cumsum(np.sqrt(density * dt) * rng.standard_normal((fine, runs, 3)), axis=0)
    R, v = np.tile(np.eye(3), (runs, 1, 1)), np.zeros((runs, 3))
    noise = ACCELEROMETER["accelerometer_noise_mps2_per_sqrt_hz"] / np.sqrt(dt)
    for w in rate:
        v += np.einsum("nij,nj->ni", R, f_b + noise * rng.standard_normal((runs, 3))) * dt
        R = R @ rotations.exp(w * dt)
    steps = preintegrate.increments
    object.__setattr__(steps, "f_b_mps2", np.tile(f_b, (len(steps.f_b_mps2), 1)))
    pim = preintegrate(0, gtsam.imuBias.ConstantBias())
    factor = gtsam.CombinedImuFactor(0, 1, 2, 3, 4, 5, pim)
    values, chi_square = gtsam.Values(), []
    zero = gtsam.imuBias.ConstantBias()
    values.insert(0, gtsam.Pose3())
    values.insert(1, np.zeros(3))
    values.insert(4, zero)
    position = pim.deltaPij()
    for i in range(runs):
        end = values.__class__(values)
        end.insert(2, gtsam.Pose3(gtsam.Rot3(R[i]), position))
        end.insert(3, v[i])
        end.insert(5, gtsam.imuBias.ConstantBias(np.zeros(3), -rate[-1, i]))
        r = factor.unwhitenedError(end)
        keep = [0, 1, 2, 6, 7, 8, 12, 13, 14]  # rotation, velocity, rate
        P = pim.residualCovariance()[np.ix_(keep, keep)]
        chi_square.append(r[keep] @ np.linalg.solve(P, r[keep]))
    # Ten sub-steps: 9.1 of 9 was measured; the standard error of the mean is 0.21.
    assert abs(np.mean(chi_square) - 9) < 1.0


def test_density_of_white_angular_acceleration_is_found():
    rng = np.random.default_rng(2)
    n, dt, density, sigma = 10_000, 0.1, np.array([0.001, 0.002, 0.003]), 0.001
    rate = np.cumsum(np.sqrt(density * dt / 10) * rng.standard_normal((10 * n, 3)), axis=0)
    rate -= rate.mean(axis=0)
    angle = np.cumsum(rate * dt / 10, axis=0)[::10]
    R = [np.eye(3)]
    for step in rotations.exp(np.diff(angle, axis=0)):
        R.append(R[-1] @ step)
    R = np.array(R) @ rotations.exp(sigma * rng.standard_normal((n, 3)))
    covariance = np.tile(sigma**2 * np.eye(3), (n, 1, 1))
    found = pre.angular_acceleration_density(dt * np.arange(n), R, covariance)
    assert_allclose(found, density, rtol=0.15)


def test_density_of_too_few_keyframes_asks_for_it():
    t = np.arange(5) * 0.1
    one = np.tile(np.eye(3), (5, 1, 1))
    with pytest.raises(BadInputError, match="state angular_acceleration_density"):
        pre.angular_acceleration_density(t, one, one)


def test_rates_of_a_steady_spin_are_exact():
    t = np.arange(50) * 0.1
    R = rotations.exp(np.outer(t, [2 * np.pi * 1.5, 0, 0]))
    assert_allclose(pre.angular_rates(t, R), np.tile([3 * np.pi, 0, 0], (50, 1)), atol=1e-9)
