"""Attitude from the first epoch on, beside a gyroscope: level, heading open until motion tells."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.geometry.rotations import to_euler, transpose
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.types.estimate import open_angle_variance_rad2
from fgnav.types.flight import InitialAttitude
from tests.assembly.standing import standing
from tests.methods.simulated import errors_rad, nees, shared
from tests.robustness.drawn.flights import right_flight

STANDS_S = 15.0


def heading_sigma_rad(estimate):
    P = estimate.R_nb @ estimate.attitude_covariance_rad2 @ transpose(estimate.R_nb)
    return np.sqrt(P[:, 2, 2])


@pytest.fixture(scope="module")
def flight():
    return standing(20_003)


@pytest.mark.parametrize("method", [Forward(), Smoother(), Batch()])
def test_a_car_that_stands_first_is_answered_from_its_first_epoch(flight, method):
    estimate = shared(method, flight)
    assert estimate.converged
    assert estimate.available > 0.995
    assert estimate.t_s[0] == 0.0
    assert estimate.unused == ()
    assert 0.5 < nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 4.5
    sigma_rad, at_rest = heading_sigma_rad(estimate), estimate.t_s < STANDS_S - 6.0
    is_open = sigma_rad > 0.9 * np.sqrt(open_angle_variance_rad2())
    assert is_open[at_rest].all() == (method.name != "batch")
    assert (sigma_rad[estimate.t_s > STANDS_S + 8.0] < np.radians(5.0)).all()


@pytest.fixture(scope="module")
def late_unit():
    """Return a flight whose unit begins 20 ms after its first fix, and that without this fix."""
    right = right_flight("fixes", 78_666_671)
    begun = replace(right, imu=right.imu[1:])
    return begun, replace(begun, fixes=(right.fixes[0][1:],))


@pytest.mark.parametrize("method", [Forward(), Smoother(), Batch()])
def test_a_fix_before_the_inertial_record_is_as_if_there_were_none(method, late_unit):
    estimate, without = (shared(method, flight) for flight in late_unit)
    # No keyframe before anything is measured.
    assert estimate.t_s[0] == late_unit[0].fixes[0].t_s[1]
    np.testing.assert_array_equal(estimate.t_s, without.t_s)
    np.testing.assert_allclose(estimate.R_nb, without.R_nb, atol=1e-5)
    P, without_P = (one.attitude_covariance_rad2 for one in (estimate, without))
    np.testing.assert_allclose(P, without_P, rtol=1e-3, atol=1e-8)


@pytest.mark.parametrize("method", [Forward(), Smoother()])
def test_a_heading_that_nothing_tells_is_named(method):
    flight = standing(20_004, stands_s=100.0, span_s=20.0)
    estimate = method(flight)
    assert estimate.unobservable == ("heading",)
    assert any("heading" in note for note in estimate.notes)
    down_b = estimate.R_nb[-1, 2]
    tilt_b = np.cross(flight.truth.R_nb[-1, 2], down_b)
    across = np.linalg.svd(down_b[None])[2][1:]
    P = across @ estimate.attitude_covariance_rad2[-1] @ across.T
    assert across @ tilt_b @ np.linalg.solve(P, across @ tilt_b) < 13.8  # of 2, one in a thousand


@pytest.mark.parametrize("method", [Forward(), Smoother(), Batch()])
def test_a_stated_heading_holds_where_nothing_else_tells_it(method):
    plain = standing(20_004, stands_s=100.0, span_s=10.0)
    yaw = float(to_euler(plain.truth.R_nb)[0, 2])
    initial = InitialAttitude(heading_rad=yaw, heading_sigma_rad=0.02)
    estimate = method(standing(20_004, stands_s=100.0, span_s=10.0, initial=initial))
    assert "heading" not in estimate.unobservable
    sigma_rad = heading_sigma_rad(estimate)
    assert 0.02 < sigma_rad[-1] < 0.07  # the gyroscope's bias turns by 0.05 in ten seconds
    assert np.abs(errors_rad(plain, estimate)[-1, 2]) < 3 * sigma_rad[-1]
