"""Barometric height and the magnetic field in the smoother."""

import dataclasses

import numpy as np

from fgnav.methods.smoother import Batch, Smoother
from tests.methods.simulated import euler_rmse_deg, flown, shared


def test_a_magnetometer_tells_a_lone_antennas_heading_and_the_vehicles_own_field():
    flight = flown("surroundings", 25.0)
    without = dataclasses.replace(flight, magnetometer=None, barometer=None)
    estimate = shared(Batch(), flight)
    assert estimate.converged
    assert euler_rmse_deg(flight, estimate)[2] < 0.5
    assert euler_rmse_deg(flight, Batch(noise="nominal")(without))[2] > 5.0
    iron = next(one for one in estimate.calibration if one.name == "hard iron")
    own_b_ut = 2.0 * np.random.default_rng(1).spawn(8)[7].standard_normal(3)
    error = iron.value - own_b_ut
    assert error @ np.linalg.solve(iron.covariance, error) < 14.2  # of three at 99.7 %
    tests = {part.what: part for part in estimate.consistency}
    field = tests["magnetic field"]
    assert abs(field.nis - 1) < 5 * np.sqrt(2 / field.freedom)
    assert tests["barometric height"].nis < 1.2
    kinds = ("magnetic field", "barometric height")
    unused = [loss for loss in estimate.unused if loss.what in kinds]
    assert all(loss.count == 1 for loss in unused)  # before the first attitude


def test_the_window_estimates_them_with_the_flight_too():
    flight = flown("surroundings", 25.0)
    batch, window = (shared(method, flight) for method in (Batch(), Smoother()))
    assert window.converged
    assert [one.name for one in window.calibration] == ["barometer", "hard iron"]
    for a, b in zip(window.calibration, batch.calibration, strict=True):
        sigma = np.sqrt(np.diag(b.covariance))
        assert np.abs((a.value - b.value) / sigma).max() < 1  # docs/evidence/limitations.md
