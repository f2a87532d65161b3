"""Drawing epochs for training: eight antennas, six satellites, against simulating flights."""

import json
from pathlib import Path
from time import process_time

import msgspec
import numpy as np

from fgnav_sim.data_sets.epochs import array_epochs
from fgnav_sim.data_sets.gravity import gravity_epochs
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.data_sets.world import AnySites, AnyTimes, RunsTable, SatellitesTable, World
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

SCENARIO = Path(__file__).resolve().parents[2] / "sim" / "fgnav_sim" / "scenarios" / "six.toml"
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
REPEATS = 3


def run() -> list[dict]:
    """Return the rows; times are those of the processor, which neighbours disturb less."""
    flown = _flown()
    rows = []
    for name, (world, note) in WORLDS.items():
        took_s = _shortest(
            lambda world=world: array_epochs(world, np.random.default_rng(1), EPOCHS)
        )
        rows.append(
            _row(name, EPOCHS / took_s, flown, f"{note}; peer: epochs of simulated flights")
        )
    count = 2000
    took_s = _shortest(lambda: gravity_epochs(GravityWorld(), np.random.default_rng(1), count))
    note = "windows of ten samples, a motion for each 20"
    return [*rows, _row("data_sets_gravity", count / took_s, None, note)]


def _flown() -> float:
    """Return epochs per second of a flight's receivers: no inertial unit, the same six."""
    scenario = msgspec.structs.replace(load_scenario(SCENARIO), imu=None)
    took_s = _shortest(lambda: simulate(scenario, np.random.default_rng(1)))
    return scenario.duration_s * scenario.gnss.rate_hz / took_s


def _shortest(call) -> float:
    """Return the least processor time of some calls, the first left out."""
    times_s = []
    for _ in range(REPEATS + 1):
        started_s = process_time()
        call()
        times_s.append(process_time() - started_s)
    return min(times_s[1:])


def _row(name: str, ours: float, peer: float | None, note: str) -> dict:
    return {
        "name": name,
        "ours": ours,
        "peer": peer,
        "ratio": None if peer is None else ours / peer,
        "unit": "epochs/s",
        "note": note,
    }


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
