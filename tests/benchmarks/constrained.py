"""The array-constrained search: right answers and microseconds."""

from functools import partial
from time import perf_counter

import numpy as np

from fgnav.checks import FloatArray
from fgnav.integers.constrained import Constrained
from fgnav.integers.constrained_search import PROVEN, search_constrained
from tests.benchmarks.integers import array_search
from tests.integers.arrays import PAPER_ANTENNAS_B_M, make

EPOCHS, NODES = 20_000, 10**6
CODE_M = (0.1, 0.3, 1.0)
SATELLITES = {4: 99.3, 5: 99.9, 7: 100.0, 8: 100.0}  # %, target at code 1 m
NAMES = (
    *(f"constrained_success_{code_m}m" for code_m in CODE_M),
    *(f"constrained_success_s{s}" for s in SATELLITES),
    "constrained_four_antennas",
    "constrained_batch",
    "constrained_single",
)


def run() -> list[dict[str, object]]:
    """Count right answers, then time."""
    rng = np.random.default_rng(20)
    rows = [
        _success(rng, f"constrained_success_{c}m", 100.0, code_m=c, satellites=(6,)) for c in CODE_M
    ]
    for s, target in SATELLITES.items():
        name = f"constrained_success_s{s}"
        rows.append(_success(rng, name, target, satellites=(s,), code_m=1.0))
    four_b_m = PAPER_ANTENNAS_B_M[[0, 1, 3, 7]]
    name = "constrained_four_antennas"
    rows.append(_success(rng, name, 100.0, antennas_b_m=four_b_m, code_m=1.0))
    return [*rows, *_times()]


def _success(
    rng: np.random.Generator,
    name: str,
    target: float,
    *,
    code_m: float,
    satellites: tuple[int, ...] = (6,),
    antennas_b_m: FloatArray = PAPER_ANTENNAS_B_M,
) -> dict[str, object]:
    n = EPOCHS if satellites == (6,) and len(antennas_b_m) == len(PAPER_ANTENNAS_B_M) else 4000
    made = make(rng, epochs=n, code_m=code_m, satellites=satellites, antennas_b_m=antennas_b_m)
    start = perf_counter()
    found = search_constrained(made.differences, NODES)
    each_us = (perf_counter() - start) / n * 1e6
    right = (found.cycles == made.cycles).all(axis=(1, 2))
    sure = found.wrong_probability <= 1e-3
    note = (
        f"{right.sum()} of {n} right, {(found.status == PROVEN).sum()} proven, {sure.sum()} with "
        f"P(wrong) below 1e-3, {(sure & ~right).sum()} of them wrong; {each_us:.0f} us per epoch"
    )
    share = 100.0 * float(right.mean())
    row: dict[str, object] = {"name": name, "ours": share, "peer": target}
    return {**row, "ratio": share / target, "unit": "%", "note": note}


def _times() -> list[dict[str, object]]:
    differences = make(np.random.default_rng(2), epochs=500, code_m=0.3, sine=True).differences
    batch_us = _best_us(partial(search_constrained, differences, NODES)) / 500
    one = make(np.random.default_rng(3), epochs=1, code_m=0.3, sine=True)
    single_us = _best_us(partial(search_constrained, one.differences, NODES))
    call_us = _best_us(partial(Constrained(), one.differences, one.flight))
    peer_us = float(str(array_search(np.random.default_rng(4))[0]["peer"]))
    note = "8 antennas, 6 satellites, 35 integers; peer: RTKLIB's LAMBDA of as many, same run"
    return [
        _time_row("constrained_batch", batch_us, peer_us, note),
        _time_row("constrained_single", single_us, peer_us, f"{note}; {call_us:.0f} validated"),
    ]


def _time_row(name: str, ours_us: float, peer_us: float, note: str) -> dict[str, object]:
    row: dict[str, object] = {"name": name, "ours": ours_us, "peer": peer_us}
    return {**row, "ratio": peer_us / ours_us, "unit": "us", "note": note}


def _best_us(work: partial[object]) -> float:
    best = np.inf
    for _ in range(7):
        start = perf_counter()
        work()
        best = min(best, (perf_counter() - start) * 1e6)
    return float(best)
