"""A sensor that is damaged is said, and no estimate is wrong by far more than it states."""

import re

import pytest

from fgnav.diagnostics import describe
from fgnav.evaluation.comparison import compare
from fgnav.evaluation.report.table import remarks
from fgnav.methods.smoother import Smoother
from tests.robustness.drawn.dirty import dirty
from tests.robustness.drawn.flights import KINDS, right_flight
from tests.robustness.faults import FAULTS, right_flights

# Of 3, mean over seconds of errors that are all but one: chance leaves 1e-2 above it.
WRONG_NEES = 10.0


def outcome(flight):
    """Return what is said by ``run``, and the attitude's NEES; NaN where there is no estimate."""
    said = [str(finding) for finding in describe(flight, quick=True).findings]
    comparison = compare(flight, [Smoother()])
    (method,) = comparison.methods
    solved = method.estimate is not None and method.estimate.converged
    nees = method.score.attitude_nees_mean if solved else float("nan")
    return [*said, *remarks(comparison)], nees


def of_contradictions(lines):
    told = (
        "what noise explains|contradicts it|used instead|field is|landmark is off"
        "|(inertial|barometer|seeker|magnetometer) sample"
    )
    return [line for line in lines if re.search(told, line)]


@pytest.mark.parametrize("name", ["array", "single", "seeker"])
def test_a_right_flight_is_not_accused(name):
    lines, nees = outcome(right_flights()[name])
    assert of_contradictions(lines) == []
    assert nees < WRONG_NEES


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_damaged_sensor_is_named_and_nothing_is_silently_wrong(fault):
    lines, nees = outcome(fault.damaged(right_flights()[fault.flight]))
    named = [line for line in of_contradictions(lines) if re.search(fault.words, line, re.I)]
    assert named, lines
    assert not nees > WRONG_NEES, lines


def test_contradictions_are_said_at_any_times():
    fault = next(one for one in FAULTS if one.name == "accelerometer axes exchanged")
    estimate = Smoother().at(fault.damaged(right_flights()[fault.flight]), rate_hz=5.0)
    assert any(note.startswith("Measurements contradict each other") for note in estimate.notes)


# Held for 18 and 15 samples, in steps of .1 rad/s: NEES 17, 87 and 38 with noise as stated.
@pytest.mark.parametrize(("number", "seed"), [(7336, 88044), (7341, 88104), (7351, 88221)])
def test_a_sensor_slower_or_coarser_than_its_record_is_as_much_noisier(number, seed):
    flight, fault = dirty(right_flight("fixes", number), seed)
    lines, nees = outcome(flight)
    assert any("stands for the stated" in line for line in lines), fault
    assert nees < 4.0  # measured 3.1, 3.2, 1.1


# An axis of the accelerometer cut at its range for half of the flight, one of the gyroscope broken
# for three seconds: NEES 24, and refused, where those samples were believed.
@pytest.mark.parametrize(("number", "seed"), [(7337, 88052), (7336, 88039)])
def test_samples_of_an_axis_that_stands_still_are_left_out(number, seed):
    flight, fault = dirty(right_flight(KINDS[number % len(KINDS)], number), seed)
    lines, nees = outcome(flight)
    assert any("stands still" in line for line in lines), fault
    assert nees < 4.0  # measured 1.7, 2.3
