"""`fgnav run` as a process, imports and reading included, against RTKLIB's rnx2rtkp.

A minute of eight antennas at 10 Hz, GPS L1, RINEX on disk. The program solves one baseline a call,
so its seven calls stand for the array; it has neither the attitude nor its covariance by then.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np

from fgnav.io.flight.folder import save_flight
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks.moving_base import PROGRAM, SCENARIO, solved

NAMES = ("whole_run", "whole_run_smoother")
ROUNDS = 3
METHODS = {"whole_run": "maximum-likelihood", "whole_run_smoother": "smoother"}


def run() -> list[dict[str, object]]:
    """Time the two programs in turn; the best of three rounds after one that compiles."""
    flight = simulate(load_scenario(SCENARIO), np.random.default_rng(1))
    # Users' Python keeps its byte code; where it must not, each call would compile 750 modules.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "flight"
        save_flight(flight, folder)

        def ours(method: str) -> None:
            command = [sys.executable, "-m", "fgnav", "run", str(folder)]
            options = ["--method", method, "--out", str(Path(name) / method)]
            subprocess.run([*command, *options], capture_output=True, check=True, env=environment)

        def peer() -> None:
            for antenna in flight.antennas[1:]:
                files = (f"{antenna.name}.rnx", "a1.rnx", "broadcast.rnx")
                solved(flight, folder, files, "-p", "4", "-a")

        jobs: dict[str, Callable[[], None]] = {
            row: lambda method=method: ours(method) for row, method in METHODS.items()
        }
        if shutil.which(PROGRAM) is not None:
            jobs["peer"] = peer
        times: dict[str, list[float]] = {job: [] for job in jobs}
        for k in range(ROUNDS + 1):
            for job, do in jobs.items():
                begin = perf_counter()
                do()
                if k:
                    times[job].append(perf_counter() - begin)
    peer_s = min(times["peer"]) if "peer" in times else None
    return [
        {
            "name": row,
            "ours": min(times[row]),
            "peer": peer_s,
            "ratio": peer_s / min(times[row]) if peer_s else None,
            "unit": "s",
            "note": f"--method {method}; peer: seven moving baselines by {PROGRAM}",
        }
        for row, method in METHODS.items()
    ]
