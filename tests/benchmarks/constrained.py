"""The array-constrained search: right answers, microseconds, and a day in constant memory."""

from dataclasses import replace
from pathlib import Path
from resource import getpagesize
from time import perf_counter

import numpy as np

from fgnav.checks import FloatArray
from fgnav.integers.arcs.resolver import constrained_arcs, lambda_arcs
from fgnav.integers.array.search import PROVEN, search_constrained
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.types.integers import Resolver
from tests.benchmarks._rows import Row, row, timed
from tests.benchmarks.integers import array_search
from tests.integers.arrays import PAPER_ANTENNAS_B_M, make

EPOCHS, NODES = 20_000, 10**6
DAY, CHUNK = 86_400, 600  # epochs
CODE_M = (0.1, 0.3, 1.0)
SATELLITES = {4: 99.3, 5: 99.9, 7: 100.0, 8: 100.0}  # %, target at code 1 m
NAMES = (
    *(f"constrained_success_{code_m}m" for code_m in CODE_M),
    *(f"constrained_success_s{s}" for s in SATELLITES),
    "constrained_four_antennas",
    "constrained_batch",
    "constrained_single",
    "constrained_single_validated",
    "memory_day_constrained",
    "memory_day_lambda",
    "memory_day_constrained-arcs",
    "memory_day_lambda-arcs",
)


def run() -> list[Row]:
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
    return [*rows, *_times(), *_day()]


def _success(
    rng: np.random.Generator,
    name: str,
    target: float,
    *,
    code_m: float,
    satellites: tuple[int, ...] = (6,),
    antennas_b_m: FloatArray = PAPER_ANTENNAS_B_M,
) -> Row:
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
    return row(name, share, target, "%", note)


def _times() -> list[Row]:
    differences = make(np.random.default_rng(2), epochs=500, code_m=0.3, sine=True).differences
    one = make(np.random.default_rng(3), epochs=1, code_m=0.3, sine=True)
    works = [
        lambda: search_constrained(differences, NODES),
        lambda: search_constrained(one.differences, NODES),
        lambda: Constrained()(one.differences, one.flight),
    ]
    batch_us, single_us, call_us = 1e6 * timed(works, 50).min(axis=0) / [500, 1, 1]
    peer_us = array_search(np.random.default_rng(4))["peer"]
    note = "8 antennas, 6 satellites, 35 integers; peer: RTKLIB's LAMBDA of as many, same run"
    validated = f"the whole resolver: noise, search, chance of being wrong, chi-square; {note}"
    return [
        row("constrained_batch", batch_us, peer_us, "us", note, less=True),
        row("constrained_single", single_us, peer_us, "us", note, less=True),
        row("constrained_single_validated", call_us, peer_us, "us", validated, less=True),
    ]


def _day() -> list[Row]:
    """Resolve 24 h at 1 Hz in chunks: how far the process grows after the first tenth."""
    resolvers: tuple[Resolver, ...] = (Constrained(), Lambda(), constrained_arcs(), lambda_arcs())
    rows = []
    for resolver in resolvers:
        rng, start, resident_mib = np.random.default_rng(5), perf_counter(), []
        for _ in range(DAY // CHUNK):
            made = make(rng, epochs=CHUNK, code_m=0.3, sine=True)
            phase_m = made.differences.phase_m - made.differences.wavelength_m * made.cycles
            resolver(replace(made.differences, phase_m=phase_m), made.flight)  # one arc
            resident_mib.append(_resident_mib())
        growth_mib = max(resident_mib) - max(resident_mib[: len(resident_mib) // 10])
        note = (
            f"{DAY} epochs of 8 antennas and 6 satellites in chunks of {CHUNK}: growth of the "
            f"resident set after the first tenth, of {resident_mib[-1]:.0f} in all; "
            f"{perf_counter() - start:.0f} s"
        )
        rows.append(row(f"memory_day_{resolver.name}", growth_mib, None, "MiB", note))
    return rows


def _resident_mib() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * getpagesize() / 2**20
