"""`fgnav` as a process, imports and reading included, against RTKLIB's rnx2rtkp.

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

NAMES = ("whole_run", "whole_run_smoother", "help_s")
ROUNDS = 3
HELP_S = 0.3  # what feels immediate
PROGRAM = "rnx2rtkp"  # Debian package rtklib
MOVING_BASE = (PROGRAM, "-p", "4", "-a", "-m", "10", "-sys", "G", "-f", "1")
FGNAV = (sys.executable, "-m", "fgnav")
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
            command = [*FGNAV, "run", str(folder)]
            options = ["--method", method, "--out", str(Path(name) / method)]
            subprocess.run([*command, *options], capture_output=True, check=True, env=environment)

        def peer() -> None:
            for antenna in flight.antennas[1:]:
                files = [folder / f"{name}.rnx" for name in (antenna.name, "a1", "broadcast")]
                command = [*MOVING_BASE, "-o", str(folder / "solution.pos"), *map(str, files)]
                subprocess.run(command, capture_output=True, check=True)

        works = [lambda method=method: ours(method) for method in METHODS.values()]
        works.append(lambda: subprocess.run([*FGNAV, "--help"], capture_output=True, check=True))
        works += [peer] if shutil.which(PROGRAM) else []
        seconds = timed(works, ROUNDS).min(axis=0).tolist()
    help_s, *peers_s = seconds[len(METHODS) :]
    peer_s = peers_s[0] if peers_s else None
    note = f"peer: seven moving baselines by {PROGRAM}"
    rows = [
        row(name, took_s, peer_s, "s", f"--method {method}; {note}", less=True)
        for (name, method), took_s in zip(METHODS.items(), seconds, strict=False)
    ]
    return [*rows, row("help_s", help_s, HELP_S, "s", "fgnav --help; peer: the limit", less=True)]
