"""A vehicle that speeds up on a straight line, cruises, and turns twice; fixes with velocities."""

import numpy as np

from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import from_euler, log, transpose
from fgnav.types.flight import Antenna, Fixes, Flight, Imu, Truth

STEP_S = 0.01
_EVERY = 20  # samples from fix to fix
_NOISE = {
    "accelerometer_noise_mps2_per_sqrt_hz": 5e-4,
    "accelerometer_bias_mps2": 0.3,
    "accelerometer_bias_walk_mps2_per_sqrt_s": 1e-5,
    "gyroscope_noise_radps_per_sqrt_hz": 7e-5,
    "gyroscope_bias_radps": 0.02,
    "gyroscope_bias_walk_radps_per_sqrt_s": 1e-6,
}


def driven(seed, *, late_s=0.0, late_sigma_s=0.0, span_s=60.0):
    """Return the flight of a seed; its unit's samples are of ``late_s`` after their tags."""
    rng = np.random.default_rng(seed)
    origin = Origin(latitude_rad=0.7, longitude_rad=0.3, height_m=100.0)
    t_s = np.arange(0.0, span_s + STEP_S / 2, STEP_S)
    at_s, n = t_s + late_s, len(t_s)
    heading = rng.uniform(-np.pi, np.pi)
    R_nb, v_n_mps = _motion(at_s, heading)
    _, v_true = _motion(t_s, heading)
    earth = origin.earth_rate_n_radps
    gravity = origin.gravity_n_mps2(np.zeros((n, 3)))
    e = 1e-3
    (before, v_before), (after, v_after) = (_motion(at_s + s, heading) for s in (-e, e))
    f_n = (v_after - v_before) / (2 * e) - gravity + 2 * np.cross(earth, v_n_mps)
    w_b = log(transpose(before) @ after) / (2 * e) + np.einsum("nji,j->ni", R_nb, earth)
    white = 1 / np.sqrt(STEP_S)
    f_b = np.einsum("nji,nj->ni", R_nb, f_n) + rng.normal(0, 0.15, 3)
    f_b += rng.normal(0, 5e-4 * white, (n, 3))
    w_b += rng.normal(0, 4e-3, 3) + rng.normal(0, 7e-5 * white, (n, 3))
    p_n_m = np.vstack([np.zeros(3), np.cumsum((v_true[1:] + v_true[:-1]) / 2 * STEP_S, axis=0)])
    fix = np.arange(0, n, _EVERY)
    ones = np.ones((len(fix), 3))
    return Flight(
        name="driven",
        start_gps_s=1.3e9,
        origin=origin,
        antennas=(Antenna(name="a1", position_b_m=np.zeros(3)),),
        imu=Imu(t_s=t_s, f_b_mps2=f_b, w_b_radps=w_b, clock_offset_sigma_s=late_sigma_s, **_NOISE),
        fixes=(
            Fixes(
                t_s=t_s[fix],
                antenna="a1",
                p_n_m=p_n_m[fix] + rng.normal(0, 2.0, (len(fix), 3)),
                v_n_mps=v_true[fix] + rng.normal(0, 0.05, (len(fix), 3)),
                position_sigma_m=2.0 * ones,
                velocity_sigma_mps=0.05 * ones,
            ),
        ),
        truth=Truth(t_s=t_s, p_n_m=p_n_m, v_n_mps=v_true, R_nb=_motion(t_s, heading)[0]),
    )


def _motion(t_s, heading):
    """Return attitudes and velocities: twenty seconds at 0.8 m/s2, a turn, another one back."""
    turned = _step((t_s - 35.0) / 8.0) - 1.5 * _step((t_s - 48.0) / 8.0)
    speed_mps = 2.0 + 0.8 * np.clip(t_s, 0.0, 20.0)
    yaw = heading + 1.5 * turned
    roll = 0.4 * (_bump((t_s - 35.0) / 8.0) - _bump((t_s - 48.0) / 8.0))
    v_n_mps = speed_mps[:, None] * np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=1)
    return from_euler(roll, np.zeros_like(yaw), yaw), v_n_mps


def _step(x):
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)


def _bump(x):
    x = np.clip(x, 0.0, 1.0)
    return 16 * (x * (1 - x)) ** 2
