"""Dirty series and flights that lack too much, by ``fgnav run``: how many end in each way.

``DIRTY_CASES`` in the environment states how many of each (600 and 300), ``DIRTY_SEED`` their first
seed (70000), ``DIRTY_METHOD`` the method (smoother).
"""

import os
import shutil
import tempfile
from collections import Counter
from pathlib import Path

from fgnav.io.exports.estimate_csv import ESTIMATE
from fgnav.io.flight.folder import save_flight
from fgnav.types.flight import Flight
from tests.robustness.drawn.dirty import dirty
from tests.robustness.drawn.flights import KINDS, right_flight
from tests.robustness.drawn.lacking import lacking
from tests.robustness.outcomes import attitude_nees, called, misshapen, remarks_of

CASES = int(os.environ.get("DIRTY_CASES", "600"))
SEED = int(os.environ.get("DIRTY_SEED", "70000"))
METHOD = os.environ.get("DIRTY_METHOD", "smoother")
PER_FLIGHT = 12
# Of 3, the mean over 12 s of errors that are all but one: chance leaves 2e-2 above it, so that it
# is to be far more than that of the right flight, too.
WRONG_NEES, MORE_THAN_RIGHT = 10.0, 2.5
TEN_TIMES = 3 * 10.0**2  # the NEES of a sigma ten times too small
ENDS = ("silent", "said", "refused", "no solution", "silent and wrong", "said and wrong", "unnamed")
NAMES = (*(f"dirty_{end.replace(' ', '_')}" for end in ENDS), "lacking_ten_times")


def run() -> list[dict]:
    """Return how many cases end in each way, and how many sigmas are ten times too small."""
    with tempfile.TemporaryDirectory(prefix="fgnav-dirty-") as name:
        ends = Counter(_dirty(Path(name)))
        too_small = sum(nees > TEN_TIMES for nees in _lacking(Path(name)))
    rows = [_row(f"dirty_{end.replace(' ', '_')}", ends[end], CASES) for end in ENDS]
    return [*rows, _row("lacking_ten_times", too_small, CASES // 2)]


def _dirty(scratch: Path):
    """Yield how each dirty flight ends."""
    for seed in range(SEED, SEED + CASES):
        if (seed - SEED) % PER_FLIGHT == 0:
            number = seed // PER_FLIGHT
            right = right_flight(KINDS[number % len(KINDS)], number)
            _, said, right_nees, _ = _answer(right, right, scratch)
        flight, fault = dirty(right, seed)
        status, remarks, nees, err = _answer(flight, right, scratch)
        end = _end(status, remarks != said, nees, right_nees, err)
        if end not in ("silent", "said", "refused", "no solution"):
            print(f"{end}: seed {seed}, {fault}, NEES {nees:.0f}: {err[-200:]}")
        yield end


def _end(status: int, has_more: bool, nees: float, right_nees: float, err: str) -> str:
    if status:
        return misshapen(err, status) or ("refused" if status == 2 else "no solution")
    is_wrong = nees > max(WRONG_NEES, MORE_THAN_RIGHT * right_nees)
    return ("said" if has_more else "silent") + (" and wrong" if is_wrong else "")


def _lacking(scratch: Path):
    """Yield the NEES of each flight that lacks much; 0 without an answer."""
    for seed in range(SEED, SEED + CASES // 2):
        right = right_flight(KINDS[seed % len(KINDS)], seed)
        flight, losses = lacking(right, seed)
        _, _, nees, _ = _answer(flight, right, scratch)
        if nees > TEN_TIMES:
            print(f"ten times: seed {seed}, {losses}, NEES {nees:.0f}")
        yield nees


def _answer(flight: Flight, right: Flight, scratch: Path) -> tuple[int, str, float, str]:
    """Return status, remarks, the attitude's NEES by the right flight's truth, and errors."""
    folder, out = scratch / "flight", scratch / "out"
    shutil.rmtree(folder, ignore_errors=True)
    save_flight(flight, folder)
    command = ["run", str(folder), "--method", METHOD, "--out", str(out)]
    status, printed, err = called(command)
    nees = attitude_nees(out / ESTIMATE, right) if status == 0 else 0.0
    return status, remarks_of(printed + err), nees, err


def _row(name: str, count: int, cases: int) -> dict:
    row = {"name": name, "ours": float(count), "peer": None, "ratio": None}
    return {**row, "unit": "cases", "note": f"of {cases}, {METHOD}"}
