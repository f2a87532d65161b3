"""Sensors that are damaged and say nothing of it, on three short flights whose truth is known.

Each fault has the flight it is made on and the words of which one has to be said.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import msgspec
import numpy as np

from fgnav.types.flight import Flight
from fgnav_sim.scenario import FixesTable, load_scenario
from fgnav_sim.simulate import simulate
from tests.robustness.small_flights import SCENARIOS

DURATION_S = 7.0  # of flights that are damaged: rows of damages are of them
INERTIAL = "inertial|accelerometer|gyroscope"
GNSS = "position|velocit|phase"


class Fault(NamedTuple):
    """A damage to a flight, and what is to be named where the estimate is wrong."""

    name: str
    flight: str
    words: str
    damaged: Callable[[Flight], Flight]


@cache
def right_flights(duration_s: float = DURATION_S) -> dict[str, Flight]:
    """Return an array, an antenna with gyroscope and instruments, an array that sees a beacon."""
    demo, surroundings, approach = (
        load_scenario(SCENARIOS / f"{name}.toml") for name in ("demo", "surroundings", "approach")
    )
    change = msgspec.structs.replace
    scenarios = {
        "array": change(demo, duration_s=duration_s),
        "single": change(
            demo,
            duration_s=duration_s,
            antennas_b_m=((0.3, 0.0, -0.2),),
            gnss=None,
            fixes=FixesTable(rate_hz=5.0),
            imu=surroundings.imu,
            barometer=surroundings.barometer,
            magnetometer=surroundings.magnetometer,
        ),
        "photodetector": change(
            approach,
            duration_s=duration_s,
            photodetector=change(approach.photodetector, range_m=2e4),
        ),
    }
    rng = np.random.default_rng(32_000)
    return {name: simulate(scenario, rng) for name, scenario in scenarios.items()}


def _imu(flight: Flight, **changes) -> Flight:
    return replace(flight, imu=replace(flight.imu, **changes))


def _field(flight: Flight, field_b_ut) -> Flight:
    return replace(flight, magnetometer=replace(flight.magnetometer, field_b_ut=field_b_ut))


def _currents(flight: Flight, currents) -> Flight:
    return replace(flight, photodetector=replace(flight.photodetector, currents=currents))


def _fixes(flight: Flight, **changes) -> Flight:
    return replace(flight, fixes=(replace(flight.fixes[0], **changes),))


def _stuck(values, first: int, last: int | None = None):
    """Return values that repeat one from a row on."""
    out = values.copy()
    out[first:last] = out[first]
    return out


def _spiked(values, every: int, by):
    out = values.copy()
    out[every // 2 :: every] += by
    return out


def _unit_stuck(flight: Flight) -> Flight:
    changes = {"f_b_mps2": _stuck(flight.imu.f_b_mps2, 450, 550)}
    if flight.imu.w_b_radps is not None:
        changes["w_b_radps"] = _stuck(flight.imu.w_b_radps, 450, 550)
    return _imu(flight, **changes)


def _reversed_half_way(flight: Flight) -> Flight:
    force = flight.imu.f_b_mps2.copy()
    force[len(force) // 2 :, 2] *= -1.0
    return _imu(flight, f_b_mps2=force)


def _places_turned(flight: Flight) -> Flight:
    """Give the antennas in axes that point up and left."""
    signs = np.array([1.0, -1.0, -1.0])
    return replace(
        flight,
        antennas=tuple(replace(a, position_b_m=signs * a.position_b_m) for a in flight.antennas),
    )


def _barometer(flight: Flight, height_m) -> Flight:
    return replace(flight, barometer=replace(flight.barometer, height_m=height_m))


def _frozen(flight: Flight) -> Flight:
    fixes = flight.fixes[0]
    return _fixes(flight, p_n_m=_stuck(fixes.p_n_m, 12, 28), v_n_mps=_stuck(fixes.v_n_mps, 12, 28))


def _tenth(flight: Flight) -> Flight:
    """State a tenth of the fixes' noise."""
    fixes = flight.fixes[0]
    return _fixes(
        flight,
        position_sigma_m=fixes.position_sigma_m / 10,
        velocity_sigma_mps=fixes.velocity_sigma_mps / 10,
    )


FAULTS = (
    Fault("magnetometer axis reversed", "single", "gyroscope",
          lambda f: _field(f, f.magnetometer.field_b_ut * [1.0, -1.0, 1.0])),
    Fault("magnetometer spikes", "single", "magnetometer noise",
          lambda f: _field(f, _spiked(f.magnetometer.field_b_ut, 17, [30.0, -40.0, 20.0]))),
    Fault("barometer spikes", "single", "barom",
          lambda f: _barometer(f, _spiked(f.barometer.height_m, 23, 60.0))),
    Fault("detector stuck", "photodetector", "photodetector stuck",
          lambda f: _currents(f, _stuck(f.photodetector.currents, 50))),
    Fault("currents exchanged", "photodetector", "line of sight",
          lambda f: _currents(f, f.photodetector.currents[:, [2, 1, 0, 3]])),
    Fault("unit stuck", "single", "imu stuck", _unit_stuck),
    Fault("accelerometer spikes", "single", "spike of the accelerometer",
          lambda f: _imu(f, f_b_mps2=_spiked(f.imu.f_b_mps2, 97, [0.0, 0.0, 50.0]))),
    Fault("accelerometer axis reversed half-way", "single", INERTIAL, _reversed_half_way),
    Fault("accelerometer axes exchanged", "array", "imu axes",
          lambda f: _imu(f, f_b_mps2=f.imu.f_b_mps2[:, [1, 0, 2]])),
    Fault("array axes up and left", "array", INERTIAL, _places_turned),
    Fault("fixes frozen", "single", GNSS, _frozen),
    Fault("fixes' noise a tenth", "single", GNSS, _tenth),
)  # fmt: skip
