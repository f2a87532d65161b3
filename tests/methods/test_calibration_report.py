"""What a result lists of the constants that were estimated with the flight."""

import dataclasses

import numpy as np
from numpy.testing import assert_allclose

from fgnav.graph.types.parameters import Parameters, flight_constant
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.methods.smoothing.calibration_report import calibrated_parameters, constant_note

AXES = ("north", "east", "down")


def solution(value, covariance):
    """Of two keyframes; at the first nothing is known of the constants yet."""
    n, b = 2, len(value)
    states = States(
        R_nb=np.tile(np.eye(3), (n, 1, 1)),
        p_n_m=np.zeros((n, 3)),
        v_n_mps=np.zeros((n, 3)),
        aux=np.zeros((n, 6)),
        constants=np.asarray(value, dtype=float),
    )
    return Solution(
        states=states,
        covariance=np.tile(np.eye(15), (n, 1, 1)),
        cross=None,
        constant_covariance=np.stack([1e6 * np.eye(b), covariance]),
        constant_cross=np.zeros((n, 15, b)),
        converged=True,
    )


def test_constants_that_were_asked_for_are_listed_off_what_was_expected():
    mean = np.array([2000.0, 300.0, 10.0])
    landmark = dataclasses.replace(flight_constant("landmark", AXES, "m", 10.0), mean=mean)
    hidden = flight_constant("mean rate", ("x_b", "y_b", "z_b"), "rad/s", 15.0, reported=False)
    boresight = flight_constant("boresight", ("about y_b", "about z_b"), "rad", 0.1)
    constants = Parameters((landmark, hidden, boresight))
    P = np.diag([1.0, 4.0, 9.0, 1, 1, 1, 1e-4, 4e-4])
    found = calibrated_parameters(constants, solution([2001, 298, 13, 7, 7, 7, 0.02, -0.01], P))
    assert [one.name for one in found] == ["landmark", "boresight"]
    assert_allclose(found[0].value, [1.0, -2.0, 3.0])
    assert_allclose(found[0].covariance, P[:3, :3])  # as known at the end
    assert_allclose(found[1].value, [0.02, -0.01])
    assert_allclose(found[1].covariance, P[6:, 6:])


def test_angles_are_listed_in_degrees():
    boresight = flight_constant("boresight", ("about y_b", "about z_b"), "rad", 0.1)
    value, P = np.radians([1.0, -2.0]), np.diag(np.radians([0.1, 0.2]) ** 2)
    (found,) = calibrated_parameters(Parameters((boresight,)), solution(value, P))
    assert constant_note(found) == (
        "Boresight, difference from the nominal: about y_b +1.0000 ± 0.1000, "
        "about z_b -2.0000 ± 0.2000 deg (1 sigma)."
    )


def test_of_many_axes_the_first_and_the_last_are_listed():
    axes = tuple(f"at {t}.0 s" for t in range(5))
    drift = flight_constant("barometer", axes, "m", 20.0)
    (found,) = calibrated_parameters(Parameters((drift,)), solution(np.arange(5.0), np.eye(5)))
    assert constant_note(found) == (
        "Barometer, difference from the nominal: at 0.0 s +0.00 ± 1.00, "
        "at 4.0 s +4.00 ± 1.00 m (1 sigma)."
    )
