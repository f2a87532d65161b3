"""Inertial units of tests."""

from fgnav.types.flight import Imu


def imu_of(
    t_s, f_b_mps2, w_b_radps=None, *, accelerometer=(1e-3, 3e-2, 1e-4), gyroscope=None, **other
):
    """Return an inertial unit; of each sensor white noise, 1-sigma of its bias, and its walk."""
    gyroscope = gyroscope or (1e-4, 1e-3, 1e-6)
    white, bias, walk = gyroscope if w_b_radps is not None else (None, None, None)
    return Imu(
        t_s=t_s,
        f_b_mps2=f_b_mps2,
        w_b_radps=w_b_radps,
        accelerometer_noise_mps2_per_sqrt_hz=accelerometer[0],
        accelerometer_bias_mps2=accelerometer[1],
        accelerometer_bias_walk_mps2_per_sqrt_s=accelerometer[2],
        gyroscope_noise_radps_per_sqrt_hz=white,
        gyroscope_bias_radps=bias,
        gyroscope_bias_walk_radps_per_sqrt_s=walk,
        **other,
    )
