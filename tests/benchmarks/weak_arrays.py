"""Wrong fixes of arrays that hardly tell their integers, where noise is as stated and where not.

Each flight stays under one sky, so that its epochs share what is wrong with the noise they are told
to have; ``Constrained`` as it is resolves it. What it would accept were the true noise stated, and
taken as it is, stands beside.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from tests.benchmarks._rows import Row, row
from tests.benchmarks.wrong_fix import lower_bound
from tests.integers.arrays import make, simulated

SPREADS = {"as_stated": 1.0, "louder_1.5": 1.5, "louder_2": 2.0}  # true by stated deviations
NAMES = tuple(f"weak_arrays_{name}" for name in SPREADS)
WRONG_MAX = 1e-2


@dataclass(frozen=True, kw_only=True)
class Weak:
    """An array under some satellites, and how many flights of how many epochs."""

    antennas_b_m: FloatArray
    satellites: int
    code_m: float
    flights: int
    epochs: int = 200


CORNER_B_M = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
CASES = {
    "3 ant., 4 sat.": Weak(antennas_b_m=CORNER_B_M, satellites=4, code_m=0.3, flights=5, epochs=60),
    "2 ant., 5 sat.": Weak(antennas_b_m=CORNER_B_M[:2], satellites=5, code_m=0.3, flights=20),
    "3 ant., 5 sat.": Weak(antennas_b_m=CORNER_B_M, satellites=5, code_m=0.3, flights=20),
}


def run() -> list[Row]:
    """Return a row for each spread."""
    return [_row(name, factor) for name, factor in SPREADS.items()]


def counts(case: Weak, factor: float, rng: np.random.Generator) -> FloatArray:
    """Return epochs accepted, wrong and declared to be wrong, (2, 3): told from the data; known."""
    out = np.zeros((2, 3))
    for _ in range(case.flights):
        d, flight = _flight(case, rng)
        stated = replace(
            d,
            code_variance_m2=d.code_variance_m2 / factor**2,
            phase_variance_m2=d.phase_variance_m2 / factor**2,
        )
        known = Constrained(wrong_max=WRONG_MAX, estimate_noise=False)
        out[0] += _counted(Constrained(wrong_max=WRONG_MAX), stated, flight)
        out[1] += _counted(known, d, flight)
    return out


def _flight(case: Weak, rng: np.random.Generator) -> tuple[DoubleDifferences, Flight]:
    """Return epochs under one sky, all integers zero, attitudes any."""
    made = make(
        rng, antennas_b_m=case.antennas_b_m, satellites=(case.satellites,), code_m=case.code_m
    )
    return simulated(made.differences, np.zeros(case.epochs, dtype=np.int64), rng), made.flight


def _counted(resolver: Constrained, d: DoubleDifferences, flight: Flight) -> FloatArray:
    resolved = resolver(d, flight)
    accepted = resolved.fixed.any(axis=(1, 2))
    wrong = accepted & ((resolved.cycles != 0) & resolved.fixed).any(axis=(1, 2))
    p = resolved.wrong_probability
    declared = 0.0 if p is None else float(p[accepted].sum())
    return np.array([accepted.sum(), wrong.sum(), declared])


def _row(name: str, factor: float) -> Row:
    told, total = [], np.zeros(2)
    rng = np.random.default_rng(400)  # the same flights for every spread
    for case, what in CASES.items():
        (accepted, wrong, declared), (of_known, wrong_of_known, _) = counts(what, factor, rng)
        total += accepted, wrong
        least = 100.0 * lower_bound(int(wrong), int(accepted))
        told.append(
            f"{case}: {what.flights} flights of {what.epochs} epochs, accepted {accepted:.0f}, "
            f"declared {declared:.2f} wrong, observed {wrong:.0f}, at least {least:.2f} % at 95 %; "
            f"noise known: accepted {of_known:.0f}, wrong {wrong_of_known:.0f}"
        )
    accepted, wrong = total
    share, asked = 100.0 * float(wrong / max(accepted, 1)), 100.0 * WRONG_MAX
    note = "% wrong of the accepted; peer: the share asked for. " + ". ".join(told)
    return row(f"weak_arrays_{name}", share, asked, "%", note, less=True)
