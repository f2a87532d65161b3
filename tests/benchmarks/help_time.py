"""Seconds until ``fgnav --help`` has answered, as a process of its own."""

import subprocess
import sys

import numpy as np

from tests.benchmarks._rows import Row, row, timed

NAMES = ("help_s",)
PEER_S = 0.3  # what feels immediate, the project's own limit
RUNS = 7
COMMAND = [sys.executable, "-m", "fgnav", "--help"]


def run() -> list[Row]:
    """Time the help several times, after one run that fills the caches."""
    seconds = timed([lambda: subprocess.run(COMMAND, check=True, stdout=subprocess.DEVNULL)], RUNS)
    note = f"fgnav --help, median of {RUNS} processes; peer: the limit"
    return [row("help_s", np.median(seconds), PEER_S, "s", note, less=True)]
