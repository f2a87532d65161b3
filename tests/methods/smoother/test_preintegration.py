import gtsam
import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav import rotations
from fgnav.checks import BadInputError
from fgnav.flight import Imu
from fgnav.methods.smoother import preintegration as pre
from fgnav.methods.smoother.motion_factor import preintegrated

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
    given = pre.Preintegrator(
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
        state = preintegrated(given, k, bias).predict(state, bias)
    assert np.abs(state.position() - p[-1]).max() < 1e-3
    assert np.abs(state.velocity() - v[-1]).max() < 1e-3
    turned = rotations.log((state.attitude().matrix().T @ R[-1])[None])
    assert np.degrees(np.abs(turned).max()) < 1e-3


def test_a_gyroscope_carries_attitude_and_velocity_without_sub_steps():
    """Rates hold for the middle of a step: at its start they would be 0.1 degree late."""
    amplitude, hz = np.radians(20), 100
    t = np.arange(2 * hz + 1) / hz
    R, p, v, a = motion(t, amplitude)
    earth, gravity = ORIGIN.earth_rate_n_radps, ORIGIN.gravity_n_mps2(p)
    f_b = np.einsum("nji,nj->ni", R, a + 2 * np.cross(earth, v) - gravity)
    ahead, behind = motion(t + 1e-4, amplitude)[0], motion(t - 1e-4, amplitude)[0]
    w_b = rotations.log(rotations.transpose(behind) @ ahead) / 2e-4
    w_b += np.einsum("nji,j->ni", R, earth)
    gyroscope = {
        "gyroscope_noise_radps_per_sqrt_hz": 1e-4,
        "gyroscope_bias_radps": 1e-3,
        "gyroscope_bias_walk_radps_per_sqrt_s": 1e-6,
    }
    imu = Imu(t_s=t, f_b_mps2=f_b, w_b_radps=w_b, **ACCELEROMETER, **gyroscope)
    key_s = np.arange(11) / 10
    given = pre.Preintegrator(
        imu=imu,
        increments=pre.increments(imu, key_s, sub_steps=1),
        gravity_n_mps2=gravity[::10],
        earth_rate_n_radps=earth,
        angular_acceleration_density=np.zeros(3),
    )
    state, none = gtsam.NavState(gtsam.Pose3(gtsam.Rot3(R[0]), p[0]), v[0]), gtsam.imuBias
    for k in range(10):
        state = preintegrated(given, k, none.ConstantBias()).predict(state, none.ConstantBias())
    turned = rotations.log((state.attitude().matrix().T @ R[hz])[None])
    assert np.degrees(np.abs(turned).max()) < 1e-3
    assert np.abs(state.velocity() - v[hz]).max() < 2e-3  # at a step's start: 60 mm/s


def test_covariance_of_an_interval_matches_many_simulated_ones():
    """Rotation, velocity and rate of white angular acceleration and white accelerometer noise."""
    rng = np.random.default_rng(1)
    runs, span_s, density = 400, 0.1, 0.04
    f_b = np.array([3.0, 1.0, -9.8])
    imu = still(span_s=0.2)
    given = pre.Preintegrator(
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
    steps = given.increments
    object.__setattr__(steps, "f_b_mps2", np.tile(f_b, (len(steps.f_b_mps2), 1)))
    pim = preintegrated(given, 0, gtsam.imuBias.ConstantBias())
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


def test_rates_of_a_steady_spin_are_exact():
    t = np.arange(50) * 0.1
    R = rotations.exp(np.outer(t, [2 * np.pi * 1.5, 0, 0]))
    assert_allclose(pre.angular_rates(t, R), np.tile([3 * np.pi, 0, 0], (50, 1)), atol=1e-9)


def test_rates_foretold_for_gaps_that_meet_stay_in_their_order():
    first = pre.Foretold(t_s=np.array([0.0, 1.0, 2.0]), w_b_radps=np.ones((3, 3)))
    second = pre.Foretold(t_s=np.array([1.5, 2.5]), w_b_radps=np.full((2, 3), 3.0))
    both = second.after(first)
    assert (np.diff(both.t_s) > 0).all()
    assert_allclose(both.at(np.array([0.5, 1.25, 2.0, 9.0]))[:, 0], [1, 2, 3, 3], atol=1e-12)
