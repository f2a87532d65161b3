"""Turns at 30 m/s with fixes and an inertial unit."""

from fgnav_sim.motion import Arc, Motion, Rate
from fgnav_sim.scenario import FixesTable, ImuTable, Scenario
from fgnav_sim.simulate import simulate

TURN = Motion(path=Arc(speed_mps=30.0, radius_m=80.0), yaw=Rate(rate_degps=21.5))
GYROSCOPE = {
    "gyroscope_noise_radps_per_sqrt_hz": 1e-3,
    "gyroscope_bias_radps": 1e-2,
    "gyroscope_bias_walk_radps_per_sqrt_s": 1e-6,
}


def turning(rng, duration_s=12.0, fixes=None, **imu):
    """Return a turn; fixes come five times a second, some of the unit's figures are others."""
    unit, fixes = ImuTable(**GYROSCOPE | imu), fixes or FixesTable(rate_hz=5.0)
    scenario = Scenario(duration_s=duration_s, motion=TURN, imu=unit, fixes=fixes)
    return simulate(scenario, rng)
