from dataclasses import replace

import numpy as np
import pytest

from fgnav.set_up.instruments import instrument_findings
from tests.robustness.faults import right_flights


@pytest.fixture(scope="module")
def single():
    return right_flights(20.0)["single"]


def found(flight):
    return [(one.name, one.text) for one in instrument_findings(flight)]


def test_right_instruments_raise_no_alarm():
    assert [found(flight) for flight in right_flights(20.0).values()] == [[], [], []]


def test_a_height_that_is_rounded_coarsely_is_not_stuck(single):
    height_m = np.round(single.barometer.height_m / 2) * 2
    assert found(replace(single, barometer=replace(single.barometer, height_m=height_m))) == []


def test_a_sample_that_is_repeated_is_named_with_its_span(single):
    field = single.magnetometer.field_b_ut.copy()
    field[50:100] = field[50]
    stuck = replace(single, magnetometer=replace(single.magnetometer, field_b_ut=field))
    ((name, text),) = found(stuck)
    assert name == "magnetometer stuck"
    assert text == "one sample is repeated 50 times from 5.000 to 9.900 s"


def test_a_detector_that_never_changes_is_stuck():
    flight = right_flights(20.0)["seeker"]
    currents = np.tile(flight.seeker.currents[3], (len(flight.seeker.t_s), 1))
    ((name, _),) = found(replace(flight, seeker=replace(flight.seeker, currents=currents)))
    assert name == "seeker stuck"


@pytest.mark.parametrize("factor", [57.3, 1000.0, 0.01])
def test_a_field_in_another_unit_is_named(single, factor):
    field = factor * single.magnetometer.field_b_ut
    other = replace(single, magnetometer=replace(single.magnetometer, field_b_ut=field))
    ((name, text),) = found(other)
    assert name == "magnetometer unit"
    assert "in 200 of 200 samples" in text
    assert "the Earth's is 44.8 uT" in text


def test_a_field_that_changes_its_unit_is_named_with_its_span(single):
    field = single.magnetometer.field_b_ut.copy()
    field[120:] *= 57.3
    other = replace(single, magnetometer=replace(single.magnetometer, field_b_ut=field))
    ((_, text),) = found(other)
    assert "in 80 of 200 samples, 12.000 to 19.900 s" in text
