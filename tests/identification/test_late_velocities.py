"""Velocities that are old by one fix or two: by the forces of that time, and none before it."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.frontend.calibration_request import calibration_requests
from tests.identification.identified import SETTINGS, estimate_by, found_in
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.flights import right_flight


def old(flight, rows):
    """Return a flight with velocities so many fixes old, the first one repeated before."""
    k = (np.arange(len(flight.fixes.t_s)) - rows).clip(0)
    return replace(flight, fixes=replace(flight.fixes, v_n_mps=flight.fixes.v_n_mps[k]))


@pytest.mark.parametrize(("number", "rows"), [(8325011, 1), (6002, 2)])
def test_old_velocities_are_late_and_nothing_else(number, rows):
    """What no forces lead back to was noise of the gyroscope: NEES 19.5 and 14.2."""
    right = right_flight("fixes", number)
    flight = old(right, rows)
    found = found_in(flight)
    assert not found.factors
    (late,) = found.calibration
    assert abs(late.start - 0.2 * rows) < 0.03  # a sigma of the first test's
    estimate = estimate_by(found, flight)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 6.0  # 1.0, 4.3


def test_a_delay_asked_for_is_estimated_once():
    """Asked for it stands in the velocities already: it was in them twice, and half as large."""
    requested = replace(SETTINGS, calibration=calibration_requests(["velocity-delay"]))
    found = found_in(old(right_flight("fixes", 6000), 1), requested)
    (late,) = found.calibration
    assert abs(late.start - 0.2) < 0.06
