"""A car that stands, then drives: positions of one antenna, accelerometer and gyroscope."""

import numpy as np

from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import from_euler, log, transpose
from fgnav.types.flight import Antenna, Fixes, Flight, Truth
from tests.imu import imu_of

ARM_B_M = np.array([0.3, 0.1, -0.5])
_STEP_S = 0.02


def standing(seed, stands_s=15.0, span_s=45.0, initial=None):
    """Return the flight of a seed: any heading, fixes of 5 cm at 2 Hz, no velocities."""
    rng = np.random.default_rng(seed)
    origin = Origin(latitude_rad=0.7, longitude_rad=0.3, height_m=100.0)
    t_s = np.arange(0.0, span_s + _STEP_S / 2, _STEP_S)
    n, share = len(t_s), np.clip((t_s - stands_s) / 3, 0, 1)
    moves = share**2 * (3 - 2 * share)
    phase = rng.uniform(0, 2 * np.pi, 4)
    speed_mps = moves * (8 + 3 * np.sin(0.4 * t_s + phase[0]) + np.sin(t_s + phase[1]))
    rate_radps = moves * 0.2 * np.sin(0.3 * t_s + phase[2])
    yaw = rng.uniform(-np.pi, np.pi) + np.cumsum(rate_radps) * _STEP_S
    roll, pitch = 0.03 + moves * 0.02 * np.sin(0.7 * t_s), -0.02 + moves * 0.03 * np.sin(0.5 * t_s)
    R_nb = from_euler(roll, pitch, yaw)
    v_n_mps = np.stack([speed_mps * np.cos(yaw), speed_mps * np.sin(yaw), np.zeros(n)], axis=1)
    steps = (v_n_mps[1:] + v_n_mps[:-1]) / 2 * _STEP_S
    p_n_m = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    earth = origin.earth_rate_n_radps
    f_n = np.gradient(v_n_mps, t_s, axis=0) - origin.gravity_n_mps2(p_n_m)
    f_b = np.einsum("nji,nj->ni", R_nb, f_n + 2 * np.cross(earth, v_n_mps))
    turns = log(transpose(R_nb[:-2]) @ R_nb[2:]) / (2 * _STEP_S)
    w_b = np.vstack([turns[:1], turns, turns[-1:]]) + np.einsum("nji,j->ni", R_nb, earth)
    f_b += rng.normal(0, 0.05, 3) + rng.normal(0, 0.01 / np.sqrt(_STEP_S), (n, 3))
    w_b += rng.normal(0, 0.005, 3) + rng.normal(0, 1e-3 / np.sqrt(_STEP_S), (n, 3))
    at = np.arange(0, n, 25)
    fixes_n_m = p_n_m[at] + R_nb[at] @ ARM_B_M + rng.normal(0, 0.05, (len(at), 3))
    return Flight(
        name="standing",
        start_gps_s=1.3e9,
        origin=origin,
        antennas=(Antenna(name="a1", position_b_m=ARM_B_M),),
        imu=imu_of(t_s, f_b, w_b, accelerometer=(0.01, 0.05, 1e-5), gyroscope=(1e-3, 0.005, 1e-6)),
        fixes=(
            Fixes(
                t_s=t_s[at],
                antenna="a1",
                p_n_m=fixes_n_m,
                v_n_mps=None,
                position_sigma_m=np.full((len(at), 3), 0.05),
                velocity_sigma_mps=None,
            ),
        ),
        truth=Truth(t_s=t_s[at], p_n_m=p_n_m[at], v_n_mps=v_n_mps[at], R_nb=R_nb[at]),
        initial=initial,
    )
