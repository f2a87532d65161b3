"""Clean flights of ten kinds, their motion and noise drawn from a seed.

Satellites err by what their messages and the atmosphere's models state. Truth is sampled at 100 Hz:
between samples a tenth of a second apart a swing is known to a hundredth of a degree only.
"""

from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np

from fgnav.types.flight import Flight
from fgnav_sim.motion import Motion, Rate, Sine
from fgnav_sim.scenario import FixesTable, Scenario, load_scenario
from fgnav_sim.simulate import simulate
from tests.robustness.drawn.flights import Weave

ONE_B_M = ((0.3, 0.0, -0.2),)
SEEN_FROM_M = 2e4  # the landmark, all along the flight
change = msgspec.structs.replace


def clean_flight(kind: str, seed: int) -> Flight:
    """Return a flight of a kind of ``KINDS``."""
    rng = np.random.default_rng([94, seed])
    return simulate(change(KINDS[kind](rng), truth_rate_hz=100.0), rng)


def shipped(name: str, duration_s: float, *, gyro: bool = False, **gnss: Any) -> Scenario:
    """Return a scenario of the simulator whose satellites err, with a gyroscope if asked for."""
    scenario = load_scenario(name)
    imu = load_scenario("surroundings").imu if gyro else scenario.imu
    receivers = change(scenario.gnss, message_errors=True, **gnss)
    return change(scenario, duration_s=duration_s, imu=imu, gnss=receivers)


def drawn_sine(rng: np.random.Generator) -> Sine:
    """Return a swing about one axis."""
    return Sine(
        amplitude_deg=rng.uniform(8.0, 25.0),
        rate_radps=rng.uniform(0.7, 1.4),
        phase_deg=rng.uniform(0.0, 180.0),
    )


def array(rng: np.random.Generator, duration_s: float = 30.0, **receivers: Any) -> Scenario:
    """Return eight antennas and an accelerometer on a weaving, swinging body."""
    roll, pitch, yaw = (drawn_sine(rng) for _ in range(3))
    motion = Motion(path=Weave(rng), roll=roll, pitch=pitch, yaw=yaw)  # type: ignore[arg-type]
    return change(shipped("demo", duration_s, **receivers), motion=motion)


def single(rng: np.random.Generator, duration_s: float, **tables: Any) -> Scenario:
    """Return one antenna and a gyroscope, raw phases or with another table of positions."""
    scenario = array(rng, duration_s, rate_hz=5.0, gyro=True)
    return change(scenario, antennas_b_m=ONE_B_M, **tables)


def spin(rng: np.random.Generator) -> Scenario:
    """Return an array on a body that rolls at a constant rate."""
    scenario = shipped("spin", 30.0)
    roll = Rate(rate_degps=rng.uniform(180.0, 540.0), start_deg=rng.uniform(0.0, 360.0))
    return change(scenario, motion=change(scenario.motion, roll=roll))


def instruments(rng: np.random.Generator) -> Scenario:
    """Return fixes and a gyroscope with barometer, magnetometer and line of sight."""
    approach = shipped("approach", 40.0, gyro=True)
    surroundings = load_scenario("surroundings")
    return change(
        approach,
        motion=change(approach.motion, roll=drawn_sine(rng)),
        antennas_b_m=ONE_B_M,
        gnss=None,
        fixes=FixesTable(rate_hz=5.0),
        barometer=surroundings.barometer,
        magnetometer=surroundings.magnetometer,
        photodetector=change(approach.photodetector, range_m=SEEN_FROM_M),
    )


KINDS: dict[str, Callable[[np.random.Generator], Scenario]] = {
    "array": array,
    "spin": spin,
    "rocket": lambda _: shipped("rocket", 30.0),
    "glider": lambda _: shipped("glider", 40.0),
    "array_1hz": lambda rng: array(rng, 60.0, rate_hz=1.0),
    "array_gyro": lambda rng: array(rng, gyro=True),
    "raw": lambda rng: single(rng, 40.0),
    "fixes_1hz": lambda rng: single(rng, 60.0, gnss=None, fixes=FixesTable(rate_hz=1.0)),
    "fixes_5hz": lambda rng: single(rng, 40.0, gnss=None, fixes=FixesTable(rate_hz=5.0)),
    "instruments": instruments,
}
