"""An antenna so far from its place that no integers fit: put where its phases are whole cycles."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.identification.array.displaced import displaced_antenna
from fgnav.methods.smoother import Smoother
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.flights import right_flight

OFF_B_M = np.array([0.1, -0.07, 0.08])


@pytest.fixture(scope="module")
def right():
    return right_flight("array", 9840)


def moved(flight, antenna):
    antennas = list(flight.antennas)
    one = antennas[antenna]
    antennas[antenna] = replace(one, position_b_m=one.position_b_m + OFF_B_M)
    return replace(flight, antennas=tuple(antennas))


@pytest.mark.parametrize("antenna", [0, 3])  # the reference, and another
def test_a_displaced_antenna_is_estimated_from_where_its_phases_put_it(right, antenna):
    flight = moved(right, antenna)
    found = displaced_antenna(flight)
    assert found is not None
    assert found.antenna == antenna
    true_b_m = right.antennas[antenna].position_b_m
    np.testing.assert_allclose(found.position_b_m, true_b_m, atol=0.01)
    estimate = Smoother()(flight)
    assert any(f"Antenna a{antenna + 1} is 0.15 m off its place" in one for one in estimate.notes)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 3.5


def test_no_antenna_is_displaced_where_integers_fit_or_nothing_tells_which(right):
    assert displaced_antenna(right) is None
    several = moved(moved(right, 1), 3)  # of four: no other shape fits
    assert displaced_antenna(several) is None
