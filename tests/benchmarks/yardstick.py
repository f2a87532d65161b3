"""Clean flights, recordings and drawn faulty flights in one run: errors, NEES, time, outcomes.

Three parts: ten kinds of clean flights with eight seeds each; recordings, where there are any; and
short drawn flights, 60 clean and each with two faults of its own. Outcomes and limits are defined
in ``_yardstick_results``. The seeds of each part begin at a base that chose nothing.

``YARDSTICK_SHARE`` (1) sets the share of the flights, ``YARDSTICK_PARTS`` names some of the parts.
Every estimate is written to ``yardstick.json`` as it comes, the rows at the end.
"""

import json
import math
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from itertools import count

import numpy as np
from scipy.special import betaincinv

from fgnav.io.atomic_write import write_text
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.types.flight import Flight
from tests.benchmarks._rows import DATA, ROOT, Row, row
from tests.benchmarks._yardstick_flights import KINDS, clean_flight
from tests.benchmarks._yardstick_recordings import RECORDINGS
from tests.benchmarks._yardstick_results import OUTCOMES, STATES, UNITS, Result, judged
from tests.robustness.drawn import flights as drawn_flights
from tests.robustness.faults import faulty

SHARE = float(os.environ.get("YARDSTICK_SHARE", "1"))
YARDSTICK_JSON = ROOT / "yardstick.json"
CLEAN_SEED, DRAWN_SEED, FAULT_SEED, REDRAWN = 530_000_000, 560_000_000, 570_000_000, 1_000_000
SEEDS, DRAWN, FAULTS_EACH = 8, 60, 2
METHODS = {"batch": Batch(), "smoother": Smoother(), "forward": Forward()}
CAUSAL_KINDS, CAUSAL_SEEDS = ("array", "fixes_5hz"), 2  # of the methods other than the batch
CONFIDENCE = 0.95
NAMES = tuple(
    f"yardstick_{name}".replace(" ", "_")
    for name in (
        *KINDS,
        *(f"{kind}_{method}" for kind in CAUSAL_KINDS for method in ("smoother", "forward")),
        *RECORDINGS,
        *(f"{part}_{outcome}" for part in ("drawn", "faulty") for outcome in OUTCOMES),
        "false_alarms",
    )
)


def run() -> list[Row]:
    """Return a row for each kind, each recording, and each outcome of the drawn flights."""
    for kind in drawn_flights.KINDS:  # kernels are compiled, on flights that are not counted
        flight = drawn_flights.right_flight(kind, DRAWN_SEED - 1)
        for method in METHODS.values():
            judged(lambda m=method, f=flight: m(f), flight.truth)
    results: list[Result] = []
    for part in os.environ.get("YARDSTICK_PARTS", ",".join(PARTS)).split(","):
        for result in PARTS[part]():
            results.append(result)
            write(results, [])
    groups: dict[str, list[Result]] = {}
    for one in results:
        label = one.name if one.part != "clean" else f"{one.name}_{one.method}"
        if one.part in ("clean", "recordings"):
            groups.setdefault(label.removesuffix("_batch"), []).append(one)
    rows = [_row_of_group(name, group) for name, group in groups.items()]
    for part in ("drawn", "faulty"):
        rows += _rows_of_outcomes(part, [one for one in results if one.part == part])
    write(results, rows)
    return rows


def write(results: list[Result], rows: list[Row]) -> None:
    """Write all results and rows."""
    whole = {"share": SHARE, "rows": rows, "results": [asdict(result) for result in results]}
    write_text(YARDSTICK_JSON, json.dumps(whole, indent=1) + "\n")


def _clean() -> Iterator[Result]:
    """Yield the clean flights of all kinds."""
    for k, kind in enumerate(KINDS):
        print(f"  clean: {kind}", flush=True)
        for n in range(_some(SEEDS)):
            seed = CLEAN_SEED + 100 * k + n
            flight = clean_flight(kind, seed)
            causal = kind in CAUSAL_KINDS and n < CAUSAL_SEEDS
            for name in METHODS if causal else ("batch",):
                fields = judged(lambda m=METHODS[name], f=flight: m(f), flight.truth)
                yield Result(part="clean", name=kind, seed=seed, method=name, **fields)


def _recordings() -> Iterator[Result]:
    """Yield the recordings, where there are any."""
    for name in list(RECORDINGS)[: _some(len(RECORDINGS))] if DATA.is_dir() else []:
        print(f"  recordings: {name}", flush=True)
        yield Result(part="recordings", name=name, **RECORDINGS[name]())


def _drawn() -> Iterator[Result]:
    """Yield drawn flights, each clean and then with its faults."""
    for k in range(_some(DRAWN)):
        if k % 10 == 0:
            print(f"  drawn: {k} of {_some(DRAWN)}", flush=True)
        kind, seed = drawn_flights.KINDS[k % len(drawn_flights.KINDS)], DRAWN_SEED + k
        flight = drawn_flights.right_flight(kind, seed)
        fields = judged(lambda f=flight: METHODS["batch"](f), flight.truth)
        clean = Result(part="drawn", name=kind, seed=seed, **fields)
        yield clean
        for fault_seed in range(FAULT_SEED + FAULTS_EACH * k, FAULT_SEED + FAULTS_EACH * (k + 1)):
            wrong, fault = with_fault(flight, fault_seed)
            fields = judged(lambda f=wrong: METHODS["batch"](f), flight.truth, clean)
            yield Result(part="faulty", name=kind, seed=fault_seed, fault=fault, **fields)


PARTS = {"clean": _clean, "recordings": _recordings, "drawn": _drawn}


def with_fault(flight: Flight, seed: int) -> tuple[Flight, str]:
    """Return a flight with a drawn fault that its measurements could show.

    Fixes all displaced alike are drawn again: that is a flight elsewhere, and as consistent.
    """
    for again in count(seed, REDRAWN):
        wrong, fault = faulty(flight, again)
        if not flight.fixes:
            break
        moved_m = wrong.fixes[0].p_n_m - flight.fixes[0].p_n_m
        if not moved_m.any() or np.ptp(moved_m, axis=0).max() > 1e-6:
            break
    return wrong, fault


def _some(number: int) -> int:
    return max(1, math.ceil(SHARE * number))


def _typical(group: list[Result], measure: str) -> dict[str, float]:
    """Return by state the root mean square of RMSE, or the mean of NEES; NaN without any."""
    power = {"rmse": 2, "nees": 1}[measure]
    columns = [getattr(one, measure) for one in group]
    known = {state: [x[state] ** power for x in columns if state in x] for state in STATES}
    return {s: float(np.mean(x)) ** (1 / power) if x else math.nan for s, x in known.items()}


def _seconds(group: list[Result]) -> float:
    return float(np.median([one.seconds for one in group]))


def _row_of_group(name: str, group: list[Result]) -> Row:
    """Return the row of a kind or recording: its first RMSE, or else its time."""
    rmse = zip(_typical(group, "rmse").values(), UNITS, strict=True)
    known = [(x, unit) for x, unit in rmse if not math.isnan(x)]
    parts = [f"{x:.3g} {unit}" for x, unit in known]
    nees = _typical(group, "nees").items()
    parts += [f"NEES {state} {x:.2f}" for state, x in nees if not math.isnan(x)]
    parts += [f"{key} {x:.4g}" for one in group for key, x in one.figures.items()]
    outcomes = Counter(one.outcome for one in group if one.outcome not in ("", "right"))
    parts += [f"{number} {outcome}" for outcome, number in outcomes.items()]
    parts += [f"{_seconds(group):.2f} s", f"{sum(one.said for one in group)} of {len(group)} said"]
    ours, unit = (known or [(_seconds(group), "s")])[0]
    return row(f"yardstick_{name}", ours, None, unit, ", ".join(parts))


def _rows_of_outcomes(part: str, group: list[Result]) -> list[Row]:
    """Return a row for each outcome of drawn flights; of clean ones also the false alarms."""
    rows = []
    for outcome in OUTCOMES if group else ():
        said = [one.said for one in group if one.outcome == outcome]
        note = f"{_limit(len(said), len(group))}; {sum(said)} said"
        name = f"yardstick_{part}_{outcome}".replace(" ", "_")
        rows.append(row(name, len(said), None, "flights", note))
    if part == "drawn" and group:
        alarms = sum(one.said for one in group)
        note = _limit(alarms, len(group))
        rows.append(row("yardstick_false_alarms", alarms, None, "flights", note))
    return rows


def _limit(number: int, of: int) -> str:
    """Return the upper confidence limit of a share (Clopper and Pearson 1934)."""
    most = 1.0 if number == of else betaincinv(number + 1, of - number, CONFIDENCE)
    return f"of {of}, at most {100 * most:.1f} % ({100 * CONFIDENCE:.0f} % confidence)"
