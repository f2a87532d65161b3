"""The array's shape from its phases: the form of a rigid array, and places estimated."""

import dataclasses
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.alignment.array.shape import (
    BaselineForm,
    baseline_information,
    fixed_phases,
    initial_shape,
    shape_at,
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


def test_the_form_has_the_variance_of_that_of_the_rotation(ranges):
    """Epoch by epoch: a filter's noise is what residuals until then ask for."""
    differences, ranges_m = ranges
    rows, later = np.arange(10, 40), np.arange(40, 60)
    rotation = RotationQuadratic.of_ranges(differences, ranges_m)
    form = BaselineForm.of_ranges(differences, ranges_m)
    quiet = form.with_variance_of(rotation[rows].with_variance_factor(4.0), rows)
    quiet = quiet.with_variance_of(rotation[later].with_variance_factor(9.0), later)
    assert_allclose(quiet.root[:10], form.root[:10], rtol=0, atol=0)
    assert_allclose(quiet.root[rows], form.root[rows] / 2, rtol=1e-9)
    assert_allclose(quiet.root[later], form.root[later] / 3, rtol=1e-9)
    moved = quiet.scatter(np.arange(60) + 5, 70)
    assert moved.valid.sum() == 60
    assert not moved.root[:5].any()
    assert_allclose(moved.root[5:65], quiet.root, rtol=0, atol=0)


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


def test_keyframes_with_an_attitude_get_the_form_about_the_stated_places(ranges):
    """Baselines where the search starts make the form; those that the flight states are kept."""
    differences, ranges_m = ranges
    form = RotationQuadratic.of_ranges(differences, ranges_m)
    t_s = np.sort(np.concatenate([differences.t_s, differences.t_s + 0.5]))
    row = np.searchsorted(t_s, differences.t_s)
    spread = np.zeros((len(t_s), 9, 9))
    spread[row] = form.information
    at_keyframes = RotationQuadratic(
        information=spread,
        vector=np.zeros((len(t_s), 9)),
        constant=np.zeros(len(t_s)),
        count=np.zeros(len(t_s), dtype=np.int64),
    )
    valid = np.zeros(len(t_s), dtype=np.bool_)
    valid[row[5:]] = True
    names = tuple(f"a{k}" for k in range(1, len(differences.baselines_b_m) + 2))
    place = flight_constant("antenna a3", ("x_b", "y_b", "z_b"), "m", 0.05)
    place = dataclasses.replace(place, start=OFF_B_M)
    shape = shape_at((differences, ranges_m), at_keyframes, t_s, valid, (place,), names)
    np.testing.assert_array_equal(shape.valid, valid)
    off_b_m = differences.baselines_b_m - shape.baselines_b_m
    assert_allclose(off_b_m[1], OFF_B_M, rtol=0, atol=1e-12)
    assert not np.delete(off_b_m, 1, axis=0).any()
    assert shape_at((differences, ranges_m), at_keyframes, t_s, valid, (), names) is None
