"""The truncation test: a recording is cut, and what was due before the cut is the same."""

from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest

from fgnav.assembly.truncation import truncated
from fgnav.io.exports.tables import write_outcome
from fgnav.methods.smoother import Forward, Smoother
from fgnav_sim.gnss.tables import OutageTable
from fgnav_sim.scenario import FixesTable, load_scenario
from fgnav_sim.simulate import simulate
from tests.methods.simulated import SCENARIOS

FORWARD, WINDOW = Forward(), Smoother(causal=True, lag_s=2.0)
# What a method may wait for: nothing, or its lag and the block that the window is updated with,
# which ends at the latest epoch a second after it began.
WAITS_S = {"forward": 0.0, "smoother": 3.2}
SHARES = (0.45, 0.65, 0.9)
GYROSCOPE = {
    "gyroscope_noise_radps_per_sqrt_hz": 1e-4,
    "gyroscope_bias_radps": 2e-3,
    "gyroscope_bias_walk_radps_per_sqrt_s": 1e-6,
}
SPAN_S = 9.0
LOOKED_AT_S = 11.0  # of a flight whose noise is looked at after 5 s, as of all, and after 10 s
OUTAGE = OutageTable(from_s=5.0, until_s=7.0)
RISING = OutageTable(until_s=7.0, azimuth_deg=(0.0, 150.0))


def scenario(name, span_s, *, gyroscope=False, fixes=False, range_m=None, **gnss):
    """Return a scenario, shortened; fixes: without raw data; gnss: what differs of receivers."""
    change = msgspec.structs.replace
    found = change(load_scenario(SCENARIOS / f"{name}.toml"), duration_s=span_s)
    if gyroscope is None:
        found = change(found, imu=change(found.imu, **dict.fromkeys(GYROSCOPE)))
    if gyroscope:
        found = change(found, imu=change(found.imu, **GYROSCOPE))
    if fixes:
        found = change(found, gnss=None, fixes=FixesTable(rate_hz=10.0))
    if range_m is not None:  # the detector sees from the start
        found = change(found, photodetector=change(found.photodetector, range_m=range_m))
    return change(found, gnss=change(found.gnss, **gnss)) if gnss else found


def with_gap(made):
    baseline = msgspec.structs.replace(made.baseline, gaps_s=((0.0, 1.0), (3.0, 5.0)))
    return msgspec.structs.replace(made, baseline=baseline)


# Scenario, and what is estimated with the flight.
FLIGHTS = {
    "demo": (scenario("demo", SPAN_S), ()),
    "rough": (scenario("rough", SPAN_S), ()),
    "approach": (scenario("approach", SPAN_S, range_m=9000.0), ()),
    "spin": (scenario("spin", SPAN_S), ()),
    "surroundings": (scenario("surroundings", SPAN_S), ()),
    "gyroscope": (scenario("demo", SPAN_S, gyroscope=True), ()),
    "one epoch a second": (scenario("demo", SPAN_S, rate_hz=1.0), ()),
    "outage": (scenario("demo", SPAN_S, outages=(OUTAGE,)), ()),
    "satellites that rise later": (scenario("demo", SPAN_S, outages=(RISING,)), ()),
    "fixes": (scenario("six", SPAN_S, fixes=True), ()),
    "fixes and gyroscope": (scenario("six", LOOKED_AT_S, fixes=True, gyroscope=True), ()),
    "baseline": (with_gap(scenario("drone", LOOKED_AT_S)), ()),
    "baseline, no gyroscope": (with_gap(scenario("drone", SPAN_S, gyroscope=None)), ()),
    "landmark": (scenario("approach", SPAN_S, range_m=9000.0), ("landmark",)),
    "lever-arm": (scenario("demo", SPAN_S), ("lever-arm",)),
    "antennas": (scenario("demo", SPAN_S), ("antennas",)),
}


@cache
def flown(which):
    return simulate(FLIGHTS[which][0], np.random.default_rng(20_001))


def cuts_s(flight):
    """Return times between two epochs; the second is within what is without satellites."""
    end_s = (flight.imu or flight.fixes[0]).t_s[-1]
    return [round(share * end_s) + 0.43 for share in SHARES]


def table(estimate, flight, path, until_s=np.inf):
    """Return what a user reads: names and numbers of estimate.csv."""
    write_outcome(path.parent, estimate, flight.origin, {})
    names, *lines = path.read_text().splitlines()
    values = np.array([line.split(",") for line in lines], dtype=float)
    return names.split(","), values[values[:, 0] <= until_s]


def assert_same_before_cuts(estimator, flight, path):
    """Compare what an estimator makes of a flight and of its beginnings, up to the last epoch."""
    whole = estimator(flight)
    for cut_s in cuts_s(flight):
        part = estimator(truncated(flight, cut_s))
        assert part.t_s[-1] > cut_s - 0.11
        due_s = min(cut_s - WAITS_S[whole.method], part.t_s[-1])
        names, before = table(whole, flight, path, due_s)
        same_names, after = table(part, flight, path, due_s)
        assert same_names == names
        assert len(before) > 5
        np.testing.assert_allclose(after, before, rtol=0, atol=1e-9)


# Both have one problem: a window waits for more of it, of outages, constants and noise.
CASES = [(FORWARD, which) for which in FLIGHTS]
CASES += [(WINDOW, which) for which in ("demo", "outage", "fixes and gyroscope", "landmark")]


@pytest.mark.parametrize(("method", "which"), CASES, ids=lambda case: getattr(case, "name", case))
def test_what_was_due_before_a_cut_is_the_same(method, which, tmp_path):
    method = replace(method, calibrate=FLIGHTS[which][1])
    assert_same_before_cuts(method, flown(which), tmp_path / "estimate.csv")


@pytest.mark.parametrize(
    ("method", "which"),
    [(FORWARD, "demo"), (FORWARD, "one epoch a second"), (WINDOW, "demo")],
    ids=lambda case: getattr(case, "name", case),
)
def test_states_between_epochs_are_the_same_too(method, which, tmp_path):
    def estimator(flight):
        return method.at(flight, rate_hz=20.0)

    assert_same_before_cuts(estimator, flown(which), tmp_path / "estimate.csv")


def test_a_window_that_is_not_causal_does_look_ahead(tmp_path):
    """The test has teeth: hyperparameters and positions by phase come from all of the flight."""
    with pytest.raises(AssertionError, match="Not equal to tolerance"):
        assert_same_before_cuts(Smoother(lag_s=2.0), flown("demo"), tmp_path / "estimate.csv")
