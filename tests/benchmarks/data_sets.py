"""Drawing epochs for training: eight antennas, six satellites, against simulating flights."""

from time import process_time

import msgspec
import numpy as np

from fgnav_sim.data_sets.epochs import array_epochs
from fgnav_sim.data_sets.gravity import gravity_epochs
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.data_sets.world import AnySites, AnyTimes, RunsTable, SatellitesTable, World
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import Row, row, timed

WORLDS = {
    "data_sets_paper": (World(runs=RunsTable(epochs=5760)), "whole days over Madrid"),
    "data_sets_day": (World(), "any moment of a day over Madrid, the day's choice of satellites"),
    "data_sets_anywhere": (
        World(
            sites=AnySites(), times=AnyTimes(), satellites=SatellitesTable(choose=6, pick="random")
        ),
        "any place, any moment of a year, six satellites at random",
    ),
}
NAMES = (*WORLDS, "data_sets_gravity")
EPOCHS = 57_600  # ten of the paper's days
WINDOWS, REPEATS = 2000, 3


def run() -> list[Row]:
    """Return the rows; times are those of the processor, which neighbours disturb less."""
    # a flight's receivers: no inertial unit, the same six
    scenario = msgspec.structs.replace(load_scenario("six"), imu=None)
    works = [lambda: simulate(scenario, np.random.default_rng(1))]
    for world, _ in WORLDS.values():
        works.append(lambda world=world: array_epochs(world, np.random.default_rng(1), EPOCHS))
    works.append(lambda: gravity_epochs(GravityWorld(), np.random.default_rng(1), WINDOWS))
    counts = [scenario.duration_s * scenario.gnss.rate_hz, *[EPOCHS] * len(WORLDS), WINDOWS]
    flown, *drawn, windows = counts / timed(works, REPEATS, process_time).min(axis=0)
    rows = [
        row(name, rate, flown, "epochs/s", f"{note}; peer: epochs of simulated flights")
        for rate, (name, (_, note)) in zip(drawn, WORLDS.items(), strict=True)
    ]
    note = "windows of ten samples, a motion for each 20"
    return [*rows, row("data_sets_gravity", windows, None, "epochs/s", note)]
