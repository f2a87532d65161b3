"""Instruments that repeat one sample: what they repeat is left out."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.integrity.instrument_screen import screen_instruments
from tests.robustness.drawn.flights import right_flight


@pytest.fixture(scope="module")
def flights():
    return {kind: right_flight(kind, 1, 20.0) for kind in ("instruments", "photodetector")}


def test_right_instruments_are_as_they_were(flights):
    for flight in flights.values():
        left, unused = screen_instruments(flight)
        assert left is flight
        assert unused == ()


@pytest.mark.parametrize(
    ("of", "name", "field"),
    [
        ("instruments", "magnetometer", "field_b_ut"),
        ("instruments", "barometer", "height_m"),
        ("photodetector", "photodetector", "currents"),
    ],
)
@pytest.mark.parametrize("rows", [slice(50, 130), slice(0, None)])
def test_what_repeats_the_sample_before_is_left_out(flights, of, name, field, rows):
    one = getattr(flights[of], name)
    values = getattr(one, field).copy()
    values[rows] = values[rows][0]
    stuck = replace(flights[of], **{name: replace(one, **{field: values})})
    left, (loss,) = screen_instruments(stuck)
    t_s = getattr(left, name).t_s
    assert loss.count == len(one.t_s) - len(t_s) == len(one.t_s[rows]) - 1
    assert loss.what == f"{name} sample"
    assert "repeat the sample before" in loss.reason
    np.testing.assert_array_equal(t_s, np.delete(one.t_s, np.arange(len(one.t_s))[rows][1:]))


def test_a_height_recorded_in_steps_beyond_its_noise_may_stand(flights):
    flight = flights["instruments"]
    height_m = np.round(flight.barometer.height_m / 2) * 2
    height_m[:60] = height_m[0]  # on the ground
    rounded = replace(flight, barometer=replace(flight.barometer, height_m=height_m))
    assert screen_instruments(rounded)[1] == ()


def test_a_detector_that_sees_nothing_is_not_stuck(flights):
    flight = flights["photodetector"]
    currents = flight.photodetector.currents.copy()
    currents[40:] = 0.0
    dark = replace(flight, photodetector=replace(flight.photodetector, currents=currents))
    assert screen_instruments(dark)[1] == ()
