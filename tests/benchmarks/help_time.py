"""Seconds until ``fgnav --help`` has answered, as a process of its own."""

import subprocess
import sys
from statistics import median
from time import perf_counter

NAMES = ("help_s",)
PEER_S = 0.3  # what feels immediate, the project's own limit
RUNS = 7


def run() -> list[dict[str, object]]:
    """Time the help several times, after one run that fills the caches."""
    command = [
        sys.executable,
        "-c",
        "import sys; from fgnav.cli import main; sys.exit(main())",
        "--help",
    ]
    seconds = []
    for _ in range(RUNS + 1):
        start_s = perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        seconds.append(perf_counter() - start_s)
    ours = median(seconds[1:])
    return [
        {
            "name": "help_s",
            "ours": ours,
            "peer": PEER_S,
            "ratio": PEER_S / ours,
            "unit": "s",
            "note": f"fgnav --help, median of {RUNS} processes; peer: the limit",
        }
    ]
