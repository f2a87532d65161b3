"""Simulating and writing flights: one minute of eight antennas at 10 Hz, alone and in a batch."""

import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

from fgnav.io.flight.folder import save_flight
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import Row, row

SETTING = "demo.toml: 60 s, 8 antennas, 10 Hz, 100 Hz accelerometer"
BATCH = 20
REPEATS = 5
NAMES = ("flight_write", "flight_simulate", "flight_batch")
COMMAND = [sys.executable, "-m", "fgnav", "simulate", "demo", "--seed", "1"]


def run() -> list[Row]:
    """Return the rows."""
    simulating_s, writing_s = _in_process()
    with tempfile.TemporaryDirectory() as folder:
        started_s = perf_counter()
        subprocess.run([*COMMAND, "--out", f"{folder}/one"], capture_output=True, check=True)
        alone_s = perf_counter() - started_s
        batch = [*COMMAND, "--out", f"{folder}/batch", "--batch", str(BATCH)]
        started_s = perf_counter()
        subprocess.run(batch, capture_output=True, check=True)
        each_s = (perf_counter() - started_s) / BATCH
    note = f"per flight of fgnav simulate --batch {BATCH}; peer: the same command for one flight"
    return [
        row("flight_write", writing_s, None, "s", f"the folder alone; {SETTING}"),
        row("flight_simulate", simulating_s, None, "s", f"sensors alone; {SETTING}"),
        row("flight_batch", each_s, alone_s, "s", note, less=True),
    ]


def _in_process() -> tuple[float, float]:
    """Return the median seconds of simulating and of writing, kernels compiled."""
    scenario = load_scenario("demo")
    simulating_s, writing_s = [], []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(REPEATS + 1):
            started_s = perf_counter()
            flight = simulate(scenario, np.random.default_rng(k))
            between_s = perf_counter()
            save_flight(flight, Path(folder) / str(k))
            simulating_s.append(between_s - started_s)
            writing_s.append(perf_counter() - between_s)
    return float(np.median(simulating_s[1:])), float(np.median(writing_s[1:]))
