"""Two real antennas, one epoch of GPS L1 at a time, the elevation mask rising rung by rung.

Reads the Wettzell recordings from FGNAV_SHARED; without them there are no rows.
"""

import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from fgnav.checks import BoolArray
from fgnav.gnss.difference import double_differences
from fgnav.integers.array.noise import with_estimated_noise
from fgnav.integers.array.search import PROVEN, search_constrained
from fgnav.integers.ils.affine import search_array
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.io.flight.folder import load_flight
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers
from tests.benchmarks._rows import DATA, Row, row
from tests.integers.wettzell import of_signals, right_cycles, write_flight

MASKS = (10, 15, 20, 25, 30, 35)
SHARES = (1e-4, 1e-3, 1e-2, 3e-2, 0.1)  # of the accepted that may be wrong: the curve
MORE_SIGNALS = ({"G1", "G2"}, {"G1", "E1", "C2"})
NODES = 10**6
NAMES = tuple(f"ladder_mask_{mask}" for mask in MASKS)


def run() -> list[Row]:
    """Climb it."""
    if not (DATA / "wettzell").is_dir():
        return []
    published = json.loads((DATA / "integers" / "wtz_single_epoch_success.json").read_text())
    with TemporaryDirectory() as folder:
        flight = load_flight(write_flight(Path(folder), DATA))
    rows = {row["mask_deg"]: row for row in published["rows"]}
    return [_rung(flight, mask, rows[mask]) for mask in MASKS]


def _rung(flight: Flight, mask: int, published: dict[str, float]) -> Row:
    """Resolve the epochs that have five satellites, as the published row counts them."""
    d = of_signals(double_differences(flight), {"G1"}, mask)
    enough = d.resolvable.sum(axis=(1, 2)) >= 4
    raw = search_constrained(d, NODES)
    share = 100.0 * float(right_cycles(d, raw.cycles)[enough].mean())
    free = 100.0 * float(right_cycles(d, search_array(d, joint=True).cycles)[enough].mean())
    known, of_lambda = published["length_constrained_pct"], published["LAMBDA_pct"]
    more = [
        f"{'+'.join(sorted(signals))} {_accepted(flight, mask, signals)}"
        for signals in MORE_SIGNALS
    ]
    note = (
        f"{enough.sum()} epochs; peer: published known length; LAMBDA {free:.1f} %, published "
        f"{of_lambda:.1f} %; accepted % (of them wrong) where a share may be wrong: "
        f"{_curve(d, flight, enough)}; more signals at the default: {', '.join(more)}; "
        f"proven {(raw.status[enough] == PROVEN).sum()}"
    )
    return row(f"ladder_mask_{mask}", share, known, "%", note)


def _curve(d: DoubleDifferences, flight: Flight, enough: BoolArray) -> str:
    noisy = with_estimated_noise(d, NODES)
    told = []
    for wrong_max in SHARES:
        resolved = Constrained(wrong_max=wrong_max, estimate_noise=False)(noisy, flight)
        told.append(f"{wrong_max:g}: {_counted(d, resolved, enough)}")
    every = Constrained(wrong_max=None, estimate_noise=False)(noisy, flight)
    return ", ".join([*told, f"any: {_counted(d, every, enough)}"])


def _accepted(flight: Flight, mask: int, signals: set[str]) -> str:
    d = of_signals(double_differences(flight), signals, mask)
    return _counted(d, Constrained()(d, flight), d.resolvable.any(axis=(1, 2)))


def _counted(d: DoubleDifferences, resolved: Integers, among: BoolArray) -> str:
    """Return the share of epochs accepted and how many have a wrong integer among the fixed."""
    accepted = resolved.fixed.any(axis=(1, 2)) & among
    fixed_only = replace(d, code_m=np.where(resolved.fixed, d.code_m, np.nan))
    wrong = accepted & ~right_cycles(fixed_only, resolved.cycles)
    return f"{100.0 * accepted.sum() / among.sum():.1f} ({wrong.sum()})"
