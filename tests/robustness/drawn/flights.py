"""Right flights, their paths, swings and noise drawn from a seed."""

import msgspec
import numpy as np

from fgnav.types.flight import Flight
from fgnav_sim.motion import Motion, Sine
from fgnav_sim.scenario import FixesTable, load_scenario
from fgnav_sim.simulate import simulate

DURATION_S = 12.0  # of most
RATE_HZ = 50.0
ANTENNAS_B_M = ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.1), (0.3, -0.8, 0.0))
KINDS = ("array", "fixes", "instruments", "raw", "photodetector")


def right_flight(kind: str, seed: int, duration_s: float = DURATION_S) -> Flight:
    """Return a flight of a kind of ``KINDS``, its path, its swings and all its noise drawn."""
    rng = np.random.default_rng([92, seed])
    demo, surroundings, approach = map(load_scenario, ("demo", "surroundings", "approach"))
    change = msgspec.structs.replace
    swing = {"amplitude_deg": rng.uniform(8.0, 25.0)}
    motion = Motion(
        path=Weave(rng),  # type: ignore[arg-type]  # a path as any other
        roll=Sine(**swing),
        pitch=Sine(**swing, phase_deg=rng.uniform(0, 180)),
        yaw=Sine(**swing, phase_deg=rng.uniform(0, 180)),
    )
    accelerometer = change(demo.imu, rate_hz=RATE_HZ)
    both = change(surroundings.imu, rate_hz=RATE_HZ)
    base = change(demo, duration_s=duration_s, motion=motion, imu=accelerometer)
    one = ((0.3, 0.0, -0.2),)
    gnss = change(demo.gnss, rate_hz=5.0)
    scenario = {
        "array": change(base, antennas_b_m=ANTENNAS_B_M, gnss=gnss),
        "fixes": change(
            base, antennas_b_m=one, gnss=None, fixes=FixesTable(rate_hz=5.0), imu=both
        ),
        "instruments": change(
            base, antennas_b_m=one, gnss=None, fixes=FixesTable(rate_hz=5.0), imu=both,
            barometer=surroundings.barometer, magnetometer=surroundings.magnetometer,
        ),
        "raw": change(base, antennas_b_m=one, gnss=gnss, imu=both),
        "photodetector": change(
            approach, duration_s=duration_s, antennas_b_m=ANTENNAS_B_M, gnss=gnss,
            imu=accelerometer, photodetector=change(approach.photodetector, range_m=2e4),
        ),
    }[kind]  # fmt: skip
    return simulate(scenario, rng)


class Weave:
    """A path that weaves in all three directions: in a steady turn no clock can be told."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.speed_mps = rng.uniform(20.0, 100.0)
        self.size_mps2, self.rate_radps = rng.uniform(1.0, 6.0, 3), rng.uniform(0.5, 1.2, 3)
        self.phase_rad = rng.uniform(0.0, 2 * np.pi, 3)

    def __call__(self, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return displacement, velocity and acceleration, (n, 3) each."""
        at = self.rate_radps * t_s[:, None] + self.phase_rad
        a_n_mps2 = self.size_mps2 * np.sin(at)
        v_n_mps = -self.size_mps2 / self.rate_radps * np.cos(at)
        ahead = np.array([self.speed_mps, 0.0, 0.0])
        p_n_m = -a_n_mps2 / self.rate_radps**2
        return p_n_m - p_n_m[0] + ahead * t_s[:, None], v_n_mps + ahead, a_n_mps2
