"""Right flights raise no alarm; each mistake is named, with the one to blame."""

from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest

from fgnav.cli.arguments.estimators import log_findings_of_check
from fgnav.diagnostics import describe
from fgnav.io.flight.folder import load_flight
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.diagnostics.faults import FAULTS, NEEDS_PHOTODETECTOR, moved
from tests.integers.wettzell import write_flight
from tests.methods.simulated import SCENARIOS
from tests.robustness.drawn.flights import right_flight

GYROSCOPE = {
    "gyroscope_noise_radps_per_sqrt_hz": 1e-4,
    "gyroscope_bias_radps": 1e-3,
    "gyroscope_bias_walk_radps_per_sqrt_s": 1e-6,
}


@cache
def flown(name):
    scenario = load_scenario(SCENARIOS / f"{name}.toml")
    imu = msgspec.structs.replace(scenario.imu, position_b_m=(0.3, -0.15, 0.2), **GYROSCOPE)
    span_s = 60.0 if name == "approach" else 30.0
    scenario = msgspec.structs.replace(scenario, imu=imu, duration_s=span_s)
    return simulate(scenario, np.random.default_rng(3))


@pytest.mark.parametrize("name", ["demo", "rough", "approach", "spin"])
def test_a_right_flight_raises_no_alarm(name):
    assert describe(flown(name)).findings == ()


def test_a_lever_arm_that_noise_of_the_rates_hides_is_not_judged():
    """Noise draws what velocities tell of it to zero: half way to the reversed one."""
    scenario, rng = load_scenario(SCENARIOS / "ramp.toml"), np.random.default_rng([0, 54])
    arm_b_m = tuple(rng.choice([-1, 1], 3) * rng.uniform(0.15, 0.4, 3))
    imu = msgspec.structs.replace(scenario.imu, position_b_m=arm_b_m, **GYROSCOPE)
    set_up = describe(simulate(msgspec.structs.replace(scenario, imu=imu), rng))
    assert set_up.findings == ()
    assert "imu lever arm" in {unchecked.name for unchecked in set_up.unchecked}


@pytest.mark.parametrize("name", FAULTS)
def test_a_mistake_is_found_and_the_right_one_blamed(name):
    flight = flown("approach" if name in NEEDS_PHOTODETECTOR else "demo")
    broken, culprit = FAULTS[name](flight, np.random.default_rng(5))
    findings = describe(broken).findings
    assert any(culprit in f"{f.name}: {f.text}" for f in findings), findings


@pytest.mark.parametrize("name", ["demo", "rough", "approach", "spin"])
@pytest.mark.parametrize("seed", range(3))
def test_axes_are_certain_beside_an_array_before_an_estimate_too(name, seed):
    assert describe(flown(name), quick=True).findings == ()
    broken, _ = FAULTS["axes wrong"](flown(name), np.random.default_rng(seed))
    (finding,) = describe(broken, quick=True).findings
    assert finding.certain
    assert finding.name in ("imu axes", "antenna axes")


def test_what_is_too_long_before_an_estimate_follows_one_that_failed(caplog):
    broken, _ = FAULTS["lever arm reversed"](flown("demo"), np.random.default_rng(0))
    assert describe(broken, quick=True).findings == ()
    log_findings_of_check(broken)
    assert caplog.messages[0].startswith("check: imu lever arm: ")


def test_one_velocity_is_no_motion_to_check():
    flight = right_flight("raw", 3)
    doppler_hz = flight.observations.doppler_hz.copy()
    doppler_hz[1:] = np.nan
    once = replace(flight.observations, doppler_hz=doppler_hz)
    names = {one.name for one in describe(replace(flight, observations=once), quick=True).findings}
    assert names == set()


def test_a_record_over_few_epochs_is_no_clock_to_check():
    """Damage 7402616, a record cut after its first rows, ended in a traceback."""
    flight = flown("demo")
    imu = flight.imu
    few = imu.t_s < imu.t_s[0] + 0.2 * (imu.t_s[-1] - imu.t_s[0])
    series = {name: getattr(imu, name)[few] for name in ("t_s", "f_b_mps2", "w_b_radps")}
    cut = replace(imu, **series)
    assert "imu clock" not in {one.name for one in describe(replace(flight, imu=cut)).findings}


def test_what_the_motion_cannot_tell_is_said():
    flight = flown("demo")
    still = replace(flight, antennas=flight.antennas[:1], observations=None, truth=None)
    (unchecked,) = describe(still).unchecked
    assert unchecked.text == "requires fixes, or raw GNSS data of three antennas, within its record"


def test_two_antennas_cannot_judge_motion_and_say_so(shared, tmp_path):
    set_up = describe(load_flight(write_flight(tmp_path, shared)))
    names = {finding.name for finding in set_up.findings}
    assert names == {"collinear antennas", "no orbits for BeiDou"}  # both true of that recording


def test_antennas_that_no_exchange_explains_are_all_doubted():
    flight = flown("demo")
    places = np.stack([a.position_b_m for a in flight.antennas])
    (finding,) = describe(moved(flight, 1.3 * places)).findings
    assert finding.name == "antennas misplaced"
    assert finding.mend == "check position_b_m of all"
