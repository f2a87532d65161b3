"""What may be asked to be estimated with a flight, and the constants that are made of it."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.assembly.calibration_request import (
    MEAN_RATE,
    SURVEYED_M,
    calibration_requests,
    constants_of,
    mean_rate,
    with_landmark,
)
from fgnav.checks import BadInputError, NoSolutionError
from fgnav.graph.types.parameters import flight_constant
from tests.methods.simulated import flown

LANDMARK_N_M = np.array([2000.0, 300.0, 10.0])


def test_words_state_what_and_how_well():
    requests = calibration_requests(("landmark", "boresight=1.5", "antenna:a4=0.02", "lever-arm"))
    assert [(one.kind, one.antenna) for one in requests] == [
        ("landmark", None),
        ("boresight", None),
        ("antenna", "a4"),
        ("lever-arm", None),
    ]
    assert [one.sigma for one in requests] == [10.0, np.radians(1.5), 0.02, 0.3]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("landmrk",), "'landmrk' is none of landmark, boresight, gravity, lever-arm, clock"),
        (("antenna",), "must name one, antenna:a4"),
        (("landmark:a4",), "'landmark:a4' is none of"),
        (("boresight=",), "after = comes a positive 1-sigma, got ''"),
        (("boresight=-1",), "after = comes a positive 1-sigma"),
        (("boresight=inf",), "after = comes a positive 1-sigma"),
        (("landmark", "landmark=3"), "'landmark' is asked for twice"),
        (("antennas", "antenna:a2"), "'antenna:a2' is asked for twice"),
    ],
)
def test_words_that_mean_nothing_are_named(words, text):
    with pytest.raises(BadInputError, match=text):
        calibration_requests(words)


@pytest.mark.parametrize(
    ("word", "text"),
    [
        ("landmark", r"calibrate landmark: the flight has no \[photodetector\]"),
        ("boresight", r"calibrate boresight: the flight has no \[photodetector\]"),
        ("gravity", "calibrate gravity: no source of the direction of gravity"),
        ("antenna:b7", "calibrate antenna:b7: not one of a1, a2"),
        ("antenna:a1", "calibrate antenna:a1: is the reference of the array; ask for lever-arm"),
    ],
)
def test_what_a_flight_has_not_cannot_be_estimated_with_it(word, text):
    with pytest.raises(BadInputError, match=text):
        constants_of(calibration_requests((word,)), flown("demo", 5.0), gravity=False)


def test_a_lever_arm_needs_an_accelerometer():
    without = dataclasses.replace(flown("demo", 5.0), imu=None)
    with pytest.raises(BadInputError, match=r"calibrate lever-arm: the flight has no \[imu\]"):
        constants_of(calibration_requests(("lever-arm",)), without, gravity=False)


def test_flights_without_an_array_have_no_places_of_antennas():
    alone = dataclasses.replace(flown("demo", 5.0), observations=None)
    with pytest.raises(BadInputError, match="the flight has no array of antennas"):
        constants_of(calibration_requests(("antennas",)), alone, gravity=False)


def test_all_antennas_but_the_reference_get_a_place_each():
    requests = calibration_requests(("antennas=0.02", "gravity"))
    constants = constants_of(requests, flown("demo", 5.0), gravity=True)
    names = [f"antenna a{k}" for k in range(2, 9)]
    assert [one.name for one in constants] == [*names, "gravity"]
    assert_allclose(constants[0].covariance, 0.02**2 * np.eye(3))
    assert constants[-1].axes == ("about x_b", "about y_b")
    assert constants[-1].unit == "rad"
    assert_allclose(constants[-1].covariance, np.radians(2.0) ** 2 * np.eye(2))
    assert all(one.reported and not one.start.any() for one in constants)


@pytest.mark.parametrize("name", ["landmark", "boresight"])
def test_a_detector_that_never_sees_tells_of_no_landmark(name):
    asked = (flight_constant(name, ("a", "b"), "rad", 0.1),)
    with pytest.raises(NoSolutionError, match=f"{name}: the detector never sees the landmark"):
        with_landmark(asked, None)
    assert with_landmark((), None) == ()


def test_a_landmark_that_is_not_asked_for_stands_where_it_was_surveyed():
    (landmark,) = with_landmark((), LANDMARK_N_M)
    assert not landmark.reported
    assert_allclose(landmark.mean, LANDMARK_N_M)
    assert_allclose(landmark.start, LANDMARK_N_M)
    assert_allclose(landmark.covariance, SURVEYED_M**2 * np.eye(3))


def test_a_landmark_that_is_asked_for_has_its_own_doubt():
    requests = calibration_requests(("landmark=30",))
    seeing = flown("approach", 60.0)
    (landmark,) = with_landmark(constants_of(requests, seeing, gravity=False), LANDMARK_N_M)
    assert landmark.reported
    assert_allclose(landmark.mean, LANDMARK_N_M)
    assert_allclose(landmark.covariance, 30.0**2 * np.eye(3))


def test_the_mean_rate_is_a_constant_of_fifteen_radians_a_second():
    one = mean_rate()
    assert (one.name, one.unit) == (MEAN_RATE, "rad/s")
    assert one.linear
    assert not one.reported
    assert_allclose(one.covariance, 15.0**2 * np.eye(3))
