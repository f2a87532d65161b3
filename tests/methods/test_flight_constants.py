"""Flights whose description is off: that is estimated with them, and costs nothing."""

import dataclasses
import re
from functools import cache

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.evaluation.span import within
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import exp
from fgnav.methods.smoother import Batch, Smoother
from fgnav.photodetector import line_of_sight
from fgnav.process.hyperparameters import RatePrior
from tests.alignment.array.test_shape import OFF_B_M, off
from tests.methods.simulated import errors_rad, flown, nees, shared

SPAN_S = 20.0
TURN_B_RAD = np.radians([0.0, 0.6, -0.8])
PRIOR = RatePrior(length_s=1.3, variance_rad2ps2=np.full(3, 0.06), evidence=0.0)


def rms_rad(flight, estimate):
    return np.sqrt((errors_rad(flight, estimate) ** 2).sum(axis=1).mean())


def named(estimate, name):
    return next(one for one in estimate.calibration if one.name == name)


def normalised(constant, truth):
    """Error in sigmas by axis, and squared as a whole."""
    error = constant.value - truth
    sigmas = error / np.sqrt(np.diag(constant.covariance))
    return np.abs(sigmas).max(), error @ np.linalg.solve(constant.covariance, error)


@cache
def misplaced():
    return off(flown("demo", SPAN_S), 3, OFF_B_M)


@pytest.mark.parametrize("method", [Batch, Smoother])
def test_an_antenna_three_centimetres_off_costs_nothing_once_it_is_estimated(method):
    right, wrong = flown("demo", SPAN_S), misplaced()
    estimate = shared(method(calibrate=("antenna:a4",)), wrong)
    usual = rms_rad(right, shared(method(), right))
    assert rms_rad(right, shared(method(noise="nominal"), wrong)) > 3 * usual
    assert rms_rad(right, estimate) < 1.1 * usual
    assert not shared(method(), wrong).consistent
    sigmas, squared = normalised(named(estimate, "antenna a4"), -OFF_B_M)
    assert sigmas < 3
    assert squared < 14.2  # chi-square of three at 99.7 %
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 4


@pytest.fixture(scope="module")
def approach():
    """Return the end of a flight, over which its detector sees the landmark."""
    return within(flown("approach", 60.0), 46.0, None)


@pytest.fixture(scope="module")
def usual_rad(approach):
    return rms_rad(approach, Batch(noise="nominal")(approach))


def test_a_landmark_five_metres_off_is_found(approach, usual_rad):
    shift_n_m = np.array([0.0, 4.0, -3.0])
    place_n_m = approach.photodetector.landmark_n_m + shift_n_m
    wrong = dataclasses.replace(
        approach, photodetector=dataclasses.replace(approach.photodetector, landmark_n_m=place_n_m)
    )
    estimate = Batch(calibrate=("landmark",))(wrong)
    sigmas, squared = normalised(named(estimate, "landmark"), -shift_n_m)
    assert sigmas < 3
    assert squared < 14.2
    assert rms_rad(approach, estimate) < 1.1 * usual_rad
    sight = next(c for c in estimate.consistency if c.what == "line of sight")
    assert abs(sight.nis - 1) < 5 * np.sqrt(2 / sight.freedom)


def turned(flight, turn_b_rad):
    """The flight as a detector sees it that is turned in the body: currents of other directions."""
    photodetector, seen = flight.photodetector, line_of_sight(flight.photodetector)
    e_d = seen.e_b @ exp(np.array([turn_b_rad]))[0]
    spot = photodetector.focal_length_m * e_d[:, 1:] / e_d[:, :1] / photodetector.detector_radius_m
    r_c = np.linalg.norm(spot, axis=1)
    r_quad = np.interp(r_c, photodetector.calibration[:, 1], photodetector.calibration[:, 0])
    logs = spot * (r_quad / r_c)[:, None]
    zero = np.zeros(len(logs))
    currents = np.exp(np.stack([logs[:, 1], zero, zero, logs[:, 0]], axis=1))
    within = r_c < 0.95
    part = dataclasses.replace(photodetector, t_s=seen.t_s[within], currents=currents[within])
    return dataclasses.replace(flight, photodetector=part)


def test_a_detector_turned_by_a_degree_is_found(approach, usual_rad):
    wrong = turned(approach, TURN_B_RAD)
    estimate = Batch(calibrate=("boresight",))(wrong)
    constant = named(estimate, "boresight")
    assert np.abs(constant.value - TURN_B_RAD[1:]).max() < np.radians(0.05)
    assert rms_rad(approach, Batch(noise="nominal")(wrong)) > 1.5 * usual_rad
    assert rms_rad(approach, estimate) < 1.15 * usual_rad


def test_a_misaligned_detector_is_left_out_where_its_boresight_is_not_estimated(approach):
    estimate = Batch()(turned(approach, TURN_B_RAD))
    assert nees(errors_rad(approach, estimate), estimate.attitude_covariance_rad2) < 4.5
    assert any(re.match("line of sight, .*: left out", note) for note in estimate.notes)


def test_constants_that_nothing_tells_of_are_no_solution(approach):
    dark = dataclasses.replace(
        approach.photodetector, currents=np.zeros_like(approach.photodetector.currents)
    )
    blind = dataclasses.replace(flown("approach", SPAN_S), photodetector=dark)
    with pytest.raises(NoSolutionError, match="landmark: the detector never sees the landmark"):
        Batch(calibrate=("landmark",))(blind)


def test_the_estimate_lists_constants_with_their_sigmas():
    estimate = Batch(calibrate=("antenna:a4=0.1",))(flown("demo", SPAN_S))
    listed = named(estimate, "antenna a4").to_dict()
    assert listed["unit"] == "m"
    assert set(listed["value"]) == set(listed["sigma"]) == {"x_b", "y_b", "z_b"}
    assert all(0 < sigma < 0.001 for sigma in listed["sigma"].values())
    assert any(
        note.startswith("Antenna a4, difference from the nominal") for note in estimate.notes
    )


def test_constants_are_estimated_in_the_order_of_their_requests():
    estimate = Batch(calibrate=("lever-arm", "antenna:a4=0.1"), noise="nominal")(flown("demo", 6.0))
    assert [one.name for one in estimate.calibration] == ["lever-arm", "antenna a4"]


def test_an_accelerometer_that_sits_elsewhere_is_found_and_the_origin_stays_where_it_is():
    right = flown("demo", SPAN_S, 1, (0.5, 0.1, -0.2))
    imu = dataclasses.replace(right.imu, position_b_m=np.array([0.3, 0.2, 0.1]))
    wrong = dataclasses.replace(right, imu=imu)
    estimate, usual = Batch(calibrate=("lever-arm",))(wrong), Batch()(right)
    sigmas, squared = normalised(named(estimate, "lever-arm"), np.array([-0.2, 0.1, 0.3]))
    assert sigmas < 3
    assert squared < 14.2
    assert rms_rad(right, estimate) < 1.1 * rms_rad(right, usual)
    assert rms_rad(right, Batch(noise="nominal")(wrong)) > 3 * rms_rad(right, usual)
    for name in ("p_n_m", "v_n_mps"):
        apart = getattr(estimate, name) - getattr(usual, name)
        assert np.sqrt((apart**2).sum(axis=1).mean()) < 0.02, name
    truth = right.truth
    v_n_mps = interpolate(estimate.t_s, truth.t_s, truth.v_n_mps)
    assert nees(estimate.v_n_mps - v_n_mps, estimate.velocity_covariance_m2ps2) < 5


def test_times_between_keyframes_know_the_same_constants():
    """An array's shape, a barometer and a magnetometer at keyframes that measure nothing."""
    flight = flown("demo", 6.0)
    method = Batch(calibrate=("antenna:a4",), rate_prior=PRIOR, noise="nominal")
    whole, dense = method(flight), method.at(flight, np.arange(1.0, 4.0, 0.05))
    assert len(dense.t_s) == 60
    one, other = named(whole, "antenna a4"), named(dense, "antenna a4")
    sigma = np.sqrt(np.diag(one.covariance))
    assert np.abs((one.value - other.value) / sigma).max() < 0.2
    flight = flown("surroundings", 10.0)
    method = Batch(noise="nominal")
    whole, dense = method(flight), method.at(flight, np.arange(2.0, 8.0, 0.25))
    for a, b in zip(whole.calibration, dense.calibration, strict=True):
        assert np.abs((a.value - b.value) / np.sqrt(np.diag(a.covariance))).max() < 0.3
