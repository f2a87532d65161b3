"""The array's shape from its phases: the form of a rigid array, and places estimated."""

import dataclasses
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.alignment.alignment import Alignment, at_keyframes
from fgnav.alignment.array.shape import (
    array_shape,
    baseline_information,
    fixed_phases,
    initial_shape,
)
from fgnav.assembly.calibration_request import calibration_requests, constants_of
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.graph.types.parameters import flight_constant
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.types.integers import fixed_ranges_m
from tests.assembly.flights import E_N, motion
from tests.attitude.arrays import synthetic
from tests.methods.simulated import flown

OFF_B_M = np.array([0.0, 0.02, 0.0224])  # three centimetres
MM = 1e-3


@pytest.fixture(scope="module")
def ranges():
    """Double differences of a minute at 1 Hz, some links missing."""
    rng = np.random.default_rng(0)
    differences, integers = synthetic(motion(np.arange(60.0), 0.3)[0], E_N, rng)
    ranges_m = fixed_ranges_m(differences, integers)
    ranges_m[rng.random(ranges_m.shape) < 0.1] = np.nan
    return differences, ranges_m


def to_baselines(arms_b_m):
    """Derivative of the baselines in n by the elements of the rotation, row by row."""
    rows = [np.kron(np.eye(3), arm) for arm in arms_b_m]
    return np.concatenate(rows)


def test_places_that_are_known_leave_the_form_of_the_rotation(ranges):
    differences, ranges_m = ranges
    T = to_baselines(differences.baselines_b_m)
    information, vector = baseline_information(differences, ranges_m)
    form = RotationQuadratic.of_ranges(differences, ranges_m)
    scale = np.abs(form.information).max()
    assert_allclose(T.T @ information @ T / scale, form.information / scale, rtol=0, atol=1e-12)
    assert_allclose(vector @ T, form.vector, rtol=1e-9, atol=1e-9 * np.abs(form.vector).max())


def off(flight, k, by_b_m):
    antennas = list(flight.antennas)
    place_b_m = antennas[k].position_b_m + by_b_m
    antennas[k] = dataclasses.replace(antennas[k], position_b_m=place_b_m)
    return dataclasses.replace(flight, antennas=tuple(antennas))


def test_an_antenna_that_is_off_is_put_where_its_phases_say():
    flight = off(flown("demo", 20.0), 3, OFF_B_M)
    constants = constants_of(calibration_requests(("antenna:a4",)), flight, gravity=False)
    fitting, started = initial_shape(flight, constants, partial(fixed_phases, flight, Lambda()))
    assert np.abs(started[0].start + OFF_B_M).max() < 1.0 * MM
    right = flown("demo", 20.0).antennas[3].position_b_m
    assert np.abs(fitting.antennas[3].position_b_m - right).max() < 1.0 * MM
    assert_allclose(started[0].covariance, constants[0].covariance, rtol=0, atol=0)


def test_flights_whose_array_is_not_asked_about_stay_as_they_are():
    flight = flown("demo", 20.0)
    constants = constants_of(calibration_requests(("lever-arm",)), flight, gravity=False)
    assert initial_shape(flight, constants, partial(fixed_phases, flight, Lambda())) == (
        flight,
        constants,
    )


def test_keyframes_with_an_attitude_get_the_form_about_the_nominal_places(ranges):
    """The start makes the form of the baselines, with the noise of that of the rotation."""
    differences, ranges_m = ranges
    form = RotationQuadratic.of_ranges(differences, ranges_m).with_variance_factor(4.0)
    n = len(differences.t_s)
    epochs = Alignment(
        t_s=differences.t_s,
        R_nb=np.tile(np.eye(3), (n, 1, 1)),
        covariance_rad2=np.tile(np.eye(3), (n, 1, 1)),
        valid=np.arange(n) >= 5,
        refused=np.zeros(n, dtype=np.bool_),
        form=form,
        phases=(differences, ranges_m),
    )
    start = at_keyframes(epochs, np.sort(np.concatenate([differences.t_s, differences.t_s + 0.5])))
    names = tuple(f"a{k}" for k in range(1, len(differences.baselines_b_m) + 2))
    place = flight_constant("antenna a3", ("x_b", "y_b", "z_b"), "m", 0.05)
    place = dataclasses.replace(place, start=OFF_B_M)
    shape = array_shape(start, (place,), names)
    np.testing.assert_array_equal(shape.row, np.flatnonzero(start.valid))
    information = baseline_information(differences, ranges_m)[0][5:] / 4
    found = shape.root.swapaxes(1, 2) @ shape.root
    assert_allclose(found, information, rtol=0, atol=1e-9 * np.abs(information).max())
    off_b_m = differences.baselines_b_m - shape.baselines_b_m
    assert_allclose(off_b_m[1], OFF_B_M, rtol=0, atol=1e-12)
    assert not np.delete(off_b_m, 1, axis=0).any()
    assert array_shape(start, (), names) is None
