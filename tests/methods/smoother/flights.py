"""Keyframes of a turning flight whose truth is known, without a file or a receiver."""

from dataclasses import dataclass

import numpy as np

from fgnav import rotations
from fgnav.attitude import RotationQuadratic, maximum_likelihood
from fgnav.earth import Origin
from fgnav.flight import Imu, Truth
from fgnav.methods.smoother import preintegration as pre
from fgnav.methods.smoother.density import angular_acceleration_density
from fgnav.methods.smoother.keyframes import ArrayForm, Keyframes, Timed
from tests.attitude.arrays import synthetic

ORIGIN = Origin(latitude_rad=np.radians(40.3), longitude_rad=np.radians(-3.9), height_m=700.0)
SKY = [(0, 1.57), (0.3, 0.4), (1.6, 0.6), (2.9, 0.5), (4.1, 0.35), (5.3, 0.8)]  # azimuth, elevation
E_N = np.array([[np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), -np.sin(e)] for a, e in SKY])
ACCELEROMETER = {
    "accelerometer_noise_mps2_per_sqrt_hz": 1e-3,
    "accelerometer_bias_mps2": 3e-2,
    "accelerometer_bias_walk_mps2_per_sqrt_s": 1e-4,
}
POSITION_M, VELOCITY_MPS = 1.0, 0.05


def motion(t_s, amplitude_rad):
    """Sine Euler angles in a 100 m/s turn of 800 m radius: attitude, p, v, a."""
    angle = amplitude_rad * np.sin(t_s)
    turn = t_s / 8
    zero = 0 * t_s
    p = 800 * np.stack([np.sin(turn), 1 - np.cos(turn), zero], axis=1)
    v = 100 * np.stack([np.cos(turn), np.sin(turn), zero], axis=1)
    a = 12.5 * np.stack([-np.sin(turn), np.cos(turn), zero], axis=1)
    return rotations.from_euler(angle, angle, angle), p, v, a


@dataclass
class Case:
    keyframes: Keyframes
    truth: Truth
    form: RotationQuadratic


def turning(rng, *, span_s=60.0, amplitude_deg=20.0, rate_hz=10, imu_hz=100, gyro=False):
    """Return keyframes and their truth."""
    amplitude_rad = np.radians(amplitude_deg)
    t = np.arange(round(span_s * imu_hz) + 1) / imu_hz
    R, p, v, a = motion(t, amplitude_rad)
    f_n = a + 2 * np.cross(ORIGIN.earth_rate_n_radps, v) - ORIGIN.gravity_n_mps2(p)
    noise = ACCELEROMETER["accelerometer_noise_mps2_per_sqrt_hz"] * np.sqrt(imu_hz)
    bias = ACCELEROMETER["accelerometer_bias_mps2"] * rng.standard_normal(3)
    f_b = np.einsum("nji,nj->ni", R, f_n) + bias + noise * rng.standard_normal((len(t), 3))
    gyroscope = {}
    if gyro:
        step = 1e-4
        ahead, behind = motion(t + step, amplitude_rad)[0], motion(t - step, amplitude_rad)[0]
        w_b = rotations.log(rotations.transpose(behind) @ ahead) / (2 * step)
        w_b += np.einsum("nji,j->ni", R, ORIGIN.earth_rate_n_radps)
        w_b += 2e-3 * rng.standard_normal(3) + 1e-4 * np.sqrt(imu_hz) * rng.standard_normal(
            w_b.shape
        )
        gyroscope = {
            "w_b_radps": w_b,
            "gyroscope_noise_radps_per_sqrt_hz": 1e-4,
            "gyroscope_bias_radps": 2e-3,
            "gyroscope_bias_walk_radps_per_sqrt_s": 1e-6,
        }
    imu = Imu(t_s=t, f_b_mps2=f_b, **ACCELEROMETER, **gyroscope)
    t = t[:: imu_hz // rate_hz]
    R, p, v, _ = motion(t, amplitude_rad)
    differences, true = synthetic(R, E_N, rng)
    form = RotationQuadratic.of_double_differences(differences, true)
    array = maximum_likelihood(form)
    n, one = len(t), np.eye(3)
    position = p + POSITION_M * rng.standard_normal((n, 3))
    velocity = v + VELOCITY_MPS * rng.standard_normal((n, 3))
    gravity = ORIGIN.gravity_n_mps2(position)
    density = np.zeros(3)
    if not gyro:
        density = angular_acceleration_density(t, array.R_nb, array.covariance_rad2)
    slot = np.zeros((n, 6))
    if not gyro:
        slot[:, 3:] = -pre.angular_rates(t, array.R_nb)
    keyframes = Keyframes(
        t_s=t,
        array=ArrayForm.of(form, np.ones(n, dtype=bool)),
        R_nb=array.R_nb,
        p_n_m=position,
        v_n_mps=velocity,
        slot=slot,
        slot_sigma=np.repeat([3e-2, 2e-3 if gyro else 30.0], 3),
        position=Timed(
            value=position, covariance=np.tile(POSITION_M**2 * one, (n, 1, 1)), arm_b_m=np.zeros(3)
        ),
        velocity=Timed(
            value=velocity,
            covariance=np.tile(VELOCITY_MPS**2 * one, (n, 1, 1)),
            arm_b_m=np.zeros(3),
        ),
        gravity=None,
        gravity_n_mps2=gravity,
        sight=None,
        landmark_n_m=None,
        preintegrate=pre.Preintegrator(
            imu=imu,
            increments=pre.increments(imu, t),
            gravity_n_mps2=gravity,
            earth_rate_n_radps=ORIGIN.earth_rate_n_radps,
            angular_acceleration_density=density,
        ),
    )
    return Case(keyframes, Truth(t_s=t, p_n_m=p, v_n_mps=v, R_nb=R), form)


def attitude_errors_rad(R_nb, truth):
    return rotations.log(rotations.transpose(R_nb) @ truth.R_nb)


def euler_rmse_deg(R_nb, truth):
    change = rotations.to_euler(R_nb) - rotations.to_euler(truth.R_nb)
    return np.degrees(np.sqrt((rotations.wrap(change) ** 2).mean(axis=0)))


def nees(error, covariance):
    return np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error)
