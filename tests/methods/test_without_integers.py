"""Four seconds of a flight whose arcs have no integers: the attitude is known all the same."""

import numpy as np
import pytest

from fgnav.methods.smoother import Batch, Smoother
from tests.alignment.array.test_float_arcs import WITHOUT_S, Cut, flown_without_integers
from tests.methods.simulated import errors_rad, nees


@pytest.fixture(scope="module")
def flight():
    return flown_without_integers()


@pytest.mark.parametrize("method", [Batch(resolver=Cut()), Smoother(resolver=Cut())])
def test_attitude_is_known_without_a_single_integer(flight, method):
    estimate = method(flight)
    error_rad = errors_rad(flight, estimate)
    inside = (estimate.t_s >= WITHOUT_S[0]) & (estimate.t_s < WITHOUT_S[1])
    assert estimate.converged
    assert np.degrees(np.sqrt((error_rad[inside] ** 2).sum(axis=1).mean())) < 0.4
    assert nees(error_rad[inside], estimate.attitude_covariance_rad2[inside]) < 6
    assert not estimate.calibration
