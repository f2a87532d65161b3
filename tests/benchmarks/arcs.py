"""Integers over arcs beside integers of single epochs: real antennas, and simulated flights.

The real ones are the Wettzell recordings of FGNAV_SHARED, GPS L1 at rising elevation masks; without
them these rows are left out. A wrong epoch is one with any wrong integer among those accepted.
"""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import msgspec
import numpy as np

from fgnav.checks import BoolArray, IntArray
from fgnav.gnss.difference import double_differences
from fgnav.integers.acceptance import phase_links
from fgnav.integers.arcs.resolver import constrained_arcs, lambda_arcs
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.truth import attitude_at, true_integers
from fgnav.io.flight.folder import load_flight
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Resolver
from fgnav_sim.gnss.tables import MultipathTable
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import DATA, Row, row
from tests.integers.wettzell import of_signals, surveyed_cycles, write_flight

MASKS = (10, 15, 20, 25, 30, 35)
SECONDS, SEEDS = 40.0, 12
ECHOES = MultipathTable(code_m=1.0, phase_m=0.002, time_constant_s=20.0)
FLIGHTS: dict[str, tuple[str, dict[str, object]]] = {
    "rough": ("rough", {}),
    "echoes": ("demo", {"code_noise_m": 1.0, "multipath": ECHOES}),
}
# the reference, one antenna beside it: 1 m apart
PAIR_M = (1.0, 0.0, 0.0)
RESOLVERS: dict[str, tuple[Resolver, Resolver]] = {
    "constrained": (constrained_arcs(), Constrained()),
    "lambda": (lambda_arcs(), Lambda(success_min=0.999)),
}
NAMES = (
    *(f"arcs_{name}_mask_{mask}" for mask in MASKS for name in RESOLVERS),
    *(f"arcs_{name}_{flight}" for flight in (*FLIGHTS, "pair") for name in RESOLVERS),
)


@dataclass(frozen=True)
class Tally:
    """What a resolver accepted."""

    links: float  # share of those with code and phase, %
    epochs: float  # share with all of those, %
    wrong: int  # epochs
    seconds: float


def run() -> list[Row]:
    """Return the rows."""
    return [*_wettzell(), *_flights()]


def _wettzell() -> list[Row]:
    if not (DATA / "wettzell").is_dir():
        return []
    with TemporaryDirectory() as folder:
        flight = load_flight(write_flight(Path(folder), DATA))
    differences = double_differences(flight)
    rows = []
    for mask in MASKS:
        d = of_signals(differences, {"G1"}, mask)
        enough = d.resolvable.sum(axis=(1, 2)) >= 4
        rows += _rows(f"mask_{mask}", [(d, flight, surveyed_cycles(d), enough)])
    return rows


def _flights() -> list[Row]:
    """Return what is accepted of two arrays, and of a pair under echoes: many seeds."""
    rows = []
    for name, (scenario, gnss) in FLIGHTS.items():
        rows += _rows(name, [_simulated(scenario, gnss, 1)])
    return rows + _rows("pair", [_simulated(*FLIGHTS["echoes"], s, 2) for s in range(SEEDS)])


Case = tuple[DoubleDifferences, Flight, IntArray, BoolArray]


def _simulated(name: str, gnss: dict[str, object], seed: int, antennas: int = 8) -> Case:
    scenario = load_scenario(name)
    table = msgspec.structs.replace(scenario.gnss, **gnss)
    changed: dict[str, object] = {"duration_s": SECONDS, "gnss": table, "imu": None}
    if antennas == 2:
        changed["antennas_b_m"] = ((0.0, 0.0, 0.0), PAIR_M)
    flight = simulate(msgspec.structs.replace(scenario, **changed), np.random.default_rng(seed))
    d = double_differences(flight)
    true = true_integers(d, attitude_at(flight.truth, d.t_s)[0])
    return d, flight, true, d.resolvable.any(axis=(1, 2))


def _rows(label: str, cases: list[Case]) -> list[Row]:
    rows = []
    for name, (over_arcs, alone) in RESOLVERS.items():
        ours, peer = _tally(over_arcs, cases), _tally(alone, cases)
        note = (
            f"links accepted; epochs with all {ours.epochs:.1f} against {peer.epochs:.1f} % of "
            f"single epochs; epochs with a wrong one {ours.wrong} against {peer.wrong}; "
            f"{ours.seconds:.2f} against {peer.seconds:.2f} s"
        )
        rows.append(row(f"arcs_{name}_{label}", ours.links, peer.links, "%", note))
    return rows


def _tally(resolver: Resolver, cases: list[Case]) -> Tally:
    fixed_links, links, whole, epochs, wrong = 0, 0, 0, 0, 0
    start = perf_counter()
    answers = [resolver(d, flight) for d, flight, _, _ in cases]
    seconds = perf_counter() - start
    for (d, _, true, wanted), found in zip(cases, answers, strict=True):
        there = (d.resolvable & phase_links(d))[wanted]
        fixed = found.fixed[wanted]
        fixed_links += int((fixed & there).sum())
        links += int(there.sum())
        whole += int((fixed | ~there).all(axis=(1, 2)).sum())
        epochs += len(there)
        wrong += int((fixed & (found.cycles != true)[wanted]).any(axis=(1, 2)).sum())
    return Tally(100 * fixed_links / max(links, 1), 100 * whole / max(epochs, 1), wrong, seconds)
