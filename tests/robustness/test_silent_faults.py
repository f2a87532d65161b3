"""A sensor that is damaged is said, and no estimate is wrong by far more than it states."""

import re

import pytest

from fgnav.diagnostics import describe
from fgnav.evaluation.comparison import compare
from fgnav.evaluation.report.summary import remarks
from fgnav.methods.smoother import Smoother
from tests.robustness.faults import FAULTS, right_flights

# Of 3, mean over seconds of errors that are all but one: chance leaves 1e-2 above it.
WRONG_NEES = 10.0
# Verdicts, what is screened or excluded, findings, and noise above the nominal.
SAID = re.compile("inconsistent: |left out|stuck: |spike of|axes: | x the nominal; used")


def outcome(flight):
    """Return what ``run`` says of faults, and the attitude's NEES; NaN without an estimate."""
    findings = [str(finding) for finding in describe(flight, quick=True).findings]
    comparison = compare(flight, [Smoother()])
    (method,) = comparison.methods
    solved = method.estimate is not None and method.estimate.converged
    nees = method.score.attitude_nees_mean if solved else float("nan")
    lines = [line for line in (*findings, *remarks(comparison)) if SAID.search(line)]
    return lines, nees


@pytest.mark.parametrize("name", ["array", "single", "photodetector"])
def test_nothing_is_said_of_a_right_flight(name):
    lines, nees = outcome(right_flights()[name])
    assert lines == []
    assert nees < WRONG_NEES


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_damaged_sensor_is_said_and_nothing_is_silently_wrong(fault):
    lines, nees = outcome(fault.damaged(right_flights()[fault.flight]))
    assert any(re.search(fault.words, line, re.I) for line in lines), lines
    inconsistent = any("inconsistent: " in line for line in lines)
    assert inconsistent or not nees > WRONG_NEES, lines


def test_verdicts_are_of_estimates_at_any_times_as_well():
    fault = next(one for one in FAULTS if one.name == "accelerometer axes exchanged")
    estimate = Smoother().at(fault.damaged(right_flights()[fault.flight]), rate_hz=5.0)
    assert "accelerometer" in {one.sensor for one in estimate.verdicts}
