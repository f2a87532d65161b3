"""Slips nobody announced, in simulated flights: how many are found, and how many are made up.

A flight without slips of the same seed says where they are. Only links above the estimators' mask
count: others are in no difference. Clock jumps of a millisecond come in both ways receivers make
them, of time tag and code with the phase and without it, on the reference antenna too.
"""

from dataclasses import replace

import msgspec
import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.earth import C_MPS
from fgnav.gnss.cycle_slips.detection import PhaseArcs, phase_arcs
from fgnav.gnss.single_differences import SingleDifferences, single_differences
from fgnav.types.flight import Flight
from fgnav_sim.gnss.tables import SlipsTable
from fgnav_sim.scenario import Scenario, load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import Row, row

SKY = {"G": ("1C",), "E": ("1C",), "C": ("2I",)}
FLIGHTS: dict[str, dict[str, object]] = {
    "demo": {},
    "multi": {"signals": SKY},
    "spin": {},
    "rough": {},
}
SPAN_S = {1.0: 300.0, 10.0: 60.0}
SLIPS_PER_HOUR = {1.0: 10.0, 10.0: 30.0}
JUMP_M = 1e-3 * C_MPS
NAMES = (
    *(
        f"slips_{name}_{rate_hz:g}hz{what}"
        for name in FLIGHTS
        for rate_hz in SPAN_S
        for what in ("", "_half", "_false", "_jump")
    ),
)


def run() -> list[Row]:
    """Return the rows."""
    return [
        row for name, gnss in FLIGHTS.items() for rate in SPAN_S for row in _rows(name, rate, gnss)
    ]


def _rows(name: str, rate_hz: float, gnss: dict[str, object]) -> list[Row]:
    scenario = load_scenario("demo" if name == "multi" else name)
    calm = _flight(scenario, rate_hz, {**gnss, "slips": None})
    slips = SlipsTable(rate_per_hour=SLIPS_PER_HOUR[rate_hz], largest_cycles=10, flagged_share=0.0)
    slipping = _flight(scenario, rate_hz, {**gnss, "slips": slips})
    label = f"slips_{name}_{rate_hz:g}hz"
    return [
        *_found(label, calm, slipping),
        _halves(label, calm),
        _jumps(label, calm),
    ]


def _flight(scenario: Scenario, rate_hz: float, gnss: dict[str, object]) -> Flight:
    table = msgspec.structs.replace(scenario.gnss, rate_hz=rate_hz, **gnss)
    flown = msgspec.structs.replace(scenario, duration_s=SPAN_S[rate_hz], gnss=table, imu=None)
    return simulate(flown, np.random.default_rng(1))


def _found(label: str, calm: Flight, slipping: Flight) -> list[Row]:
    single, arcs = _arcs(slipping)
    steps, broken, flagged = _steps(slipping, single, arcs)
    slipped = _changed(calm, slipping, single) & steps
    quiet = slipped & ~flagged
    testable = arcs.steps - arcs.untested
    note = (
        f"{(broken & quiet).sum()} of {quiet.sum()} unannounced slips of 1 to 10 cycles; "
        f"{100 * testable / max(arcs.steps, 1):.1f} % of {arcs.steps} steps testable"
    )
    false = broken & ~slipped & ~flagged
    share = 100.0 * false.sum() / steps.sum()
    made_up = f"{false.sum()} breaks of {steps.sum()} steps"
    return [
        row(label, 100.0 * (broken & quiet).sum() / max(quiet.sum(), 1), 99.0, "%", note),
        row(f"{label}_false", share, 0.1, "%", made_up, less=True),
    ]


def _halves(label: str, calm: Flight) -> Row:
    """Add half-cycle slips at random links and epochs, one of a link at most."""
    rng = np.random.default_rng(2)
    seen = calm.observations
    phase = seen.phase_cycles.copy()
    n, a, m = phase.shape
    at = np.argwhere(rng.random((a, m)) < 0.3)
    for antenna, channel in at:
        phase[rng.integers(1, n) :, antenna, channel] += rng.choice([-0.5, 0.5])
    flight = replace(calm, observations=replace(seen, phase_cycles=phase))
    single, arcs = _arcs(flight)
    steps, broken, flagged = _steps(flight, single, arcs)
    slipped = _changed(calm, flight, single) & steps & ~flagged
    found = (broken & slipped).sum()
    note = f"{found} of {slipped.sum()} unannounced slips of half a cycle"
    return row(f"{label}_half", 100.0 * found / max(slipped.sum(), 1), 99.0, "%", note)


def _jumps(label: str, calm: Flight) -> Row:
    """Let the clocks of three antennas jump, and count the breaks that were not there before."""
    seen = calm.observations
    n = len(seen.t_s)
    code_m, tag_s = seen.code_m.copy(), seen.tag_s.copy()
    phase = seen.phase_cycles.copy()
    single, before = _arcs(calm)
    wavelength_m = dict(
        zip(zip(single.satellites, single.signals, strict=True), single.wavelength_m, strict=True)
    )
    cycles = [
        JUMP_M / wavelength_m.get(channel, np.nan)
        for channel in zip(seen.satellites, seen.signals, strict=True)
    ]
    code_m[n // 4 :, 1] += JUMP_M
    tag_s[n // 4 :, 1] += 1e-3
    code_m[n // 2 :, 2] += JUMP_M
    tag_s[n // 2 :, 2] += 1e-3
    phase[n // 2 :, 2] += np.nan_to_num(cycles)
    code_m[3 * n // 4 :, 0] -= JUMP_M
    tag_s[3 * n // 4 :, 0] -= 1e-3
    jumped = replace(seen, code_m=code_m, tag_s=tag_s, phase_cycles=phase)
    _, after = _arcs(replace(calm, observations=jumped))
    more = int(_breaks(after).sum()) - int(_breaks(before).sum())
    note = f"breaks more than {_breaks(before).sum()} after 3 clock jumps of 1 ms"
    return row(f"{label}_jump", more, 0.0, "count", note, less=True)


def _arcs(flight: Flight) -> tuple[SingleDifferences, PhaseArcs]:
    single = single_differences(flight)
    return single, phase_arcs(single, tuple(antenna.name for antenna in flight.antennas))


def _breaks(arcs: PhaseArcs) -> BoolArray:
    there = (arcs.arc[1:] >= 0) & (arcs.arc[:-1] >= 0)
    return np.asarray(there & (arcs.arc[1:] != arcs.arc[:-1]))


def _steps(
    flight: Flight, single: SingleDifferences, arcs: PhaseArcs
) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Return the steps, (n - 1, a, m), that count, that break, and that are announced."""
    usable = np.isfinite(single.elevation_rad)
    there = (arcs.arc[1:] >= 0) & (arcs.arc[:-1] >= 0)
    steps = there & (usable[1:] & usable[:-1])[:, None]
    flagged = flight.observations.lock_flags[1:][..., _columns(flight, single)] != 0
    return steps, _breaks(arcs) & steps, flagged


def _changed(calm: Flight, other: Flight, single: SingleDifferences) -> BoolArray:
    """Return where the integers of the same flight begin to differ, (n - 1, a, m)."""
    change: FloatArray = (other.observations.phase_cycles - calm.observations.phase_cycles)[
        ..., _columns(other, single)
    ]
    return np.asarray(np.diff(np.round(2 * np.nan_to_num(change)), axis=0) != 0)


def _columns(flight: Flight, single: SingleDifferences) -> list[int]:
    seen = flight.observations
    channels = list(zip(seen.satellites, seen.signals, strict=True))
    return [channels.index(c) for c in zip(single.satellites, single.signals, strict=True)]
