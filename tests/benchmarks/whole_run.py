"""`fgnav run` as a process, imports and reading included, against RTKLIB's rnx2rtkp.

A minute of eight antennas at 10 Hz, GPS L1, RINEX on disk. The program solves one baseline a call,
so its seven calls stand for the array; it has neither the attitude nor its covariance by then.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from fgnav.io.flight.folder import save_flight
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import Row, row, timed
from tests.benchmarks.moving_base import PROGRAM, solved

NAMES = ("whole_run", "whole_run_smoother")
ROUNDS = 3
METHODS = {"whole_run": "maximum-likelihood", "whole_run_smoother": "smoother"}


def run() -> list[Row]:
    """Time the two programs in turn; the best of three rounds after one that compiles."""
    flight = simulate(load_scenario("demo"), np.random.default_rng(1))
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

        works = [lambda method=method: ours(method) for method in METHODS.values()]
        works += [peer] if shutil.which(PROGRAM) else []
        seconds = timed(works, ROUNDS).min(axis=0).tolist()
    peer_s = seconds[len(METHODS)] if len(seconds) > len(METHODS) else None
    note = f"peer: seven moving baselines by {PROGRAM}"
    return [
        row(name, took_s, peer_s, "s", f"--method {method}; {note}", less=True)
        for (name, method), took_s in zip(METHODS.items(), seconds, strict=False)
    ]
