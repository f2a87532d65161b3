"""Flights by fixes and an accelerometer alone: commanded motions of every kind, in turn."""

import numpy as np

from fgnav_sim.data_sets.gravity_motions import MOTIONS, drawn_motion
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.ranges import uniform
from fgnav_sim.scenario import FixesTable, Scenario
from fgnav_sim.simulate import simulate

DURATION_S = 30.0


def flights(count, seed):
    """Return flights of climb, cruise, descent, turn and spin, with ten fixes a second."""
    world, out = GravityWorld(), []
    for number, rng in enumerate(np.random.default_rng([seed]).spawn(count)):
        kind = list(MOTIONS)[number % len(MOTIONS)]
        scenario = Scenario(
            name=f"{kind} {number}",
            duration_s=DURATION_S,
            motion=drawn_motion(world, kind, uniform(rng)),
            imu=world.imu,
            fixes=FixesTable(rate_hz=10.0, velocity_noise_mps=0.05),
        )
        out.append(simulate(scenario, rng))
    return out
