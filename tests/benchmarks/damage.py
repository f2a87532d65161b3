"""Damaged flights and killed commands: how many end in each way, of 5,000 and of 180."""

import tempfile
from pathlib import Path

import numpy as np

from tests.benchmarks._rows import Row, row
from tests.robustness.kills import commands, commands_of_models, killed
from tests.robustness.outcomes import BAD, GOOD, case, undamaged
from tests.robustness.small_flights import write_flights
from tests.robustness.test_kills import small_inputs

NAMES = ("damage", "kills", *(f"damage_{kind.replace(' ', '_')}" for kind in (*GOOD, *BAD)))
FIRST, CASES = 2_000_000, 5000
KILLS, KILLS_OF_MODELS = 40, 20  # of each command


def run() -> list[Row]:
    """Return how many damaged flights end in each way, those that should not as one figure."""
    with tempfile.TemporaryDirectory(prefix="fgnav-damage-") as name:
        folder = Path(name)
        flights = [undamaged(flight, folder / "u") for flight in write_flights(folder)]
        seeds = range(FIRST, FIRST + CASES)
        outcomes = [case(flights[seed % 2], seed, folder / "case") for seed in seeds]
        faults, hits = _kills(flights[0].folder, folder)
    bad = [one for one in outcomes if one.kind in BAD]
    print(*bad, *faults, sep="\n")
    note = f"of {CASES} damaged flights: silent losses, tracebacks, hangs, nameless errors and such"
    rows = [row("damage", len(bad), None, "cases", note)]
    for kind in (*GOOD, *BAD):
        count = sum(one.kind == kind for one in outcomes)
        name = f"damage_{kind.replace(' ', '_')}"
        rows.append(row(name, count, None, "cases", f"of {CASES}: {kind}"))
    note = f"torn, lost or other bytes after {hits} kills of commands that were still running"
    return [*rows, row("kills", len(faults), None, "cases", note)]


def _kills(flight: Path, folder: Path) -> tuple[list[str], int]:
    """Kill every command that writes; return what was wrong, and how often it was still running."""
    todo = [(command, KILLS) for command in commands(flight, *small_inputs(folder))]
    todo += [(command, KILLS_OF_MODELS) for command in commands_of_models()]
    faults, hits = list[str](), 0
    for k, (command, times) in enumerate(todo):
        more, hit = killed(command, times, folder / "kills", np.random.default_rng([6, k]))
        faults, hits = faults + more, hits + hit
    return faults, hits
