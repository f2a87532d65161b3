"""`fgnav check`: mistakes found, the right culprit named, false alarms on right flights.

Flights differ in motion, sky, noise and seed; each mistake is made on all of them.
"""

from collections.abc import Iterator
from dataclasses import replace
from time import perf_counter

import msgspec
import numpy as np

from fgnav.diagnostics import describe
from fgnav.types.flight import Flight
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import Row, row
from tests.diagnostics.faults import FAULTS, NEEDS_PHOTODETECTOR

FLIGHTS, RIGHT = 20, 200
MOVING = ("demo", "rough", "approach", "six")
GYROSCOPE = {
    "gyroscope_noise_radps_per_sqrt_hz": 1e-4,
    "gyroscope_bias_radps": 1e-3,
    "gyroscope_bias_walk_radps_per_sqrt_s": 1e-6,
}
NAMES = (
    "diagnostics_found",
    "diagnostics_culprit",
    "diagnostics_false_alarms",
    "diagnostics_seconds",
)


def run() -> list[Row]:
    """Check broken and right flights; the targets of the project are the peers."""
    rng = np.random.default_rng(7)
    found, named, whole = {}, {}, 0
    for name, fault in FAULTS.items():
        found[name] = named[name] = 0
        for flight in flights(FLIGHTS, ("approach",) if name in NEEDS_PHOTODETECTOR else MOVING):
            broken, culprit = fault(flight, rng)
            findings = describe(broken).findings
            found[name] += bool(findings)
            named[name] += any(culprit in f"{f.name}: {f.text}" for f in findings)
            whole += 1
    alarms, times = [], []
    for flight in flights(RIGHT, (*MOVING, "spin", "ramp", "beacon")):
        begin = perf_counter()
        findings = describe(flight).findings
        times.append(perf_counter() - begin)
        if findings:
            alarms.append(f"{flight.name}: {findings[0].name}")
    share = 100 * len(alarms) / RIGHT
    told = ", ".join(f"{name} {found[name]}/{named[name]}" for name in FAULTS)
    note = f"found/named of {FLIGHTS} each: {told}"
    return [
        row("diagnostics_found", 100 * sum(found.values()) / whole, 95.0, "%", note),
        row("diagnostics_culprit", 100 * sum(named.values()) / whole, 90.0, "%", note),
        row("diagnostics_false_alarms", share, 1.0, "%", "; ".join(alarms), less=True),
        row("diagnostics_seconds", np.median(times), None, "s", "a minute of flight, median"),
    ]


def flights(count: int, names: tuple[str, ...], first_seed: int = 0) -> Iterator[Flight]:
    """Yield right flights of a minute or less, with a gyroscope and an accelerometer off centre."""
    for k in range(count):
        scenario = load_scenario(names[k % len(names)])
        rng = np.random.default_rng([first_seed, k])
        arm_b_m = tuple(float(x) for x in rng.choice([-1, 1], 3) * rng.uniform(0.15, 0.4, 3))
        if scenario.imu is None:
            continue
        imu = msgspec.structs.replace(scenario.imu, position_b_m=arm_b_m, **GYROSCOPE)
        flight = simulate(msgspec.structs.replace(scenario, imu=imu), rng)
        yield replace(flight, name=f"{flight.name} {k}")
