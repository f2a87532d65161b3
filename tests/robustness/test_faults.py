"""A sensor that is wrong is said to be, and hardly any estimate is wrong by far and says nothing.

How often is counted by the benchmark ``yardstick``, of more flights and all states.
"""

import re
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.diagnostics import describe
from fgnav.evaluation.comparison import compare
from fgnav.evaluation.report.summary import remarks
from fgnav.methods.smoother import Batch, Smoother
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.flights import KINDS, right_flight
from tests.robustness.faults import BY_NAME, FAULTS, faulty
from tests.robustness.shapes import Draw

SHORT_S = 8.0  # of flights with severe faults
RIGHT_SEED, FAULT_SEED = 620_000_000, 630_000_000
RIGHT, FAULTS_EACH = 2, 1
# Of 3: mean over seconds of errors that are all but one, chance leaves 1e-2 above it; and one in a
# thousand errors that last all along a flight.
WRONG_NEES, LASTING_NEES = 10.0, 16.3
# Verdicts, what is screened or excluded, findings, and noise above the nominal.
SAID = re.compile("inconsistent: |left out|stuck: |spike of|axes: | x the nominal; used")
INERTIAL, GNSS = "inertial|accelerometer|gyroscope", "position|velocit|phase"
NAMED = (
    ("magnetometer field_b_ut channel scaled", "instruments", "gyroscope|magnet"),
    ("magnetometer field_b_ut outlying", "instruments", "magnetometer noise|magnetic field"),
    ("barometer height_m outlying", "instruments", "barom"),
    ("photodetector currents stuck", "photodetector", "photodetector stuck"),
    ("photodetector currents exchanged", "photodetector", "line of sight"),
    ("imu f_b_mps2 stuck", "array", "imu stuck"),
    ("imu f_b_mps2 outlying", "instruments", "spike of the accelerometer"),
    ("imu f_b_mps2 channel scaled", "instruments", INERTIAL),
    ("imu f_b_mps2 exchanged", "array", INERTIAL),
    ("antennas misaligned", "array", INERTIAL),
    ("fixes frozen", "instruments", GNSS),
    ("fixes sigmas too small", "instruments", GNSS),
)


@dataclass
class Severe(Draw):
    """A draw of the largest size and the first choice, that strikes the second half."""

    def size(self, _low, high):
        return self.told(float(high))

    def choice(self, *options):
        return self.told(options[0])

    def span(self, t_s):
        return t_s >= (t_s[0] + t_s[-1]) / 2


@cache
def right(kind):
    return right_flight(kind, RIGHT_SEED - 1, SHORT_S)


def outcome(flight):
    """Return what ``run`` says of faults, and the attitude's NEES; NaN without an estimate."""
    findings = [str(finding) for finding in describe(flight, quick=True).findings]
    comparison = compare(flight, [Smoother()])
    (method,) = comparison.methods
    solved = method.estimate is not None and method.estimate.converged
    nees_mean = method.score.attitude_nees_mean if solved else float("nan")
    lines = [line for line in (*findings, *remarks(comparison)) if SAID.search(line)]
    return lines, nees_mean


@pytest.mark.parametrize("name", ["array", "instruments", "photodetector"])
def test_nothing_is_said_of_a_right_flight(name):
    lines, nees_mean = outcome(right(name))
    assert lines == []
    assert nees_mean < WRONG_NEES


@pytest.mark.parametrize(("fault", "flight", "words"), NAMED, ids=[row[0] for row in NAMED])
def test_a_severe_fault_is_said_of_its_sensor_and_nothing_is_silently_wrong(fault, flight, words):
    draw = Severe(np.random.default_rng(0))
    lines, nees_mean = outcome(BY_NAME[fault].change(right(flight), draw))
    assert any(re.search(words, line, re.I) for line in lines), lines
    inconsistent = any("inconsistent: " in line for line in lines)
    assert inconsistent or not nees_mean > WRONG_NEES, lines


def test_verdicts_are_of_estimates_at_any_times_as_well():
    draw = Severe(np.random.default_rng(0))
    wrong = BY_NAME["imu f_b_mps2 exchanged"].change(right("array"), draw)
    estimate = Smoother().at(wrong, rate_hz=5.0)
    assert "accelerometer" in {one.sensor for one in estimate.verdicts}


@pytest.mark.parametrize("kind", KINDS)
def test_every_fault_of_a_flight_changes_it_and_says_how(kind):
    right, rng = right_flight(kind, 1), np.random.default_rng(0)
    for fault in FAULTS:
        if fault.concerns(right):
            flight, text = fault(right, rng)
            assert flight is not right
            assert text.startswith(fault.name)
    assert faulty(right, 7)[1] == faulty(right, 7)[1]


@pytest.mark.parametrize("kind", KINDS)
def test_right_flights_have_no_verdict(kind):
    for seed in range(RIGHT_SEED, RIGHT_SEED + RIGHT):
        flight = right_flight(kind, seed)
        estimate = Batch()(flight)
        assert estimate.verdicts == ()
        assert attitude_nees(flight, estimate) < LASTING_NEES


def test_hardly_any_drawn_fault_is_silent_and_its_attitude_wrong():
    """One in five at most: those within what real noise is allowed to be show in nothing."""
    silent = []
    for k, kind in enumerate(KINDS):
        flight = right_flight(kind, RIGHT_SEED)
        for seed in range(FAULT_SEED + FAULTS_EACH * k, FAULT_SEED + FAULTS_EACH * (k + 1)):
            wrong, fault = faulty(flight, seed)
            try:
                estimate = Batch()(wrong)
            except NoSolutionError:
                continue
            says_nothing = estimate.consistent and estimate.converged
            if says_nothing and attitude_nees(flight, estimate) > LASTING_NEES:
                silent.append(f"{kind}, {fault}")
    assert len(silent) <= len(KINDS) * FAULTS_EACH / 5, silent


def attitude_nees(right, estimate):
    return nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2)
