"""Barometric height and the magnetic field in the smoother."""

import dataclasses

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.flight import Flight, Imu
from fgnav.methods.smoother import Batch, GtsamBatch, Smoother
from fgnav.methods.smoother.surroundings import heights, magnetic_field
from fgnav.surroundings import Barometer, Magnetometer
from tests.methods.simulated import euler_rmse_deg, flown

from .flights import ACCELEROMETER, ORIGIN

T_S = np.arange(0.0, 30.0, 0.1)
IMU = Imu(t_s=T_S, f_b_mps2=np.zeros((300, 3)), position_b_m=np.array([0.2, 0, 0]), **ACCELEROMETER)
P_N_M = np.stack([100 * T_S, 0 * T_S, -5 * T_S], axis=1)


def pressed(t_s, **options):
    height_m = 700 + 5 * t_s + (100 * t_s) ** 2 / (2 * 6.37e6)
    options = {"noise_m": 0.3, "offset_m": 20.0, **options}
    return Barometer(t_s=t_s, height_m=height_m, **options)


def bare(**parts):
    return Flight(name="bare", start_gps_s=0.0, origin=ORIGIN, imu=IMU, **parts)


def test_heights_become_places_along_down_wherever_the_vehicle_is():
    barometer = pressed(T_S, position_b_m=np.array([1.2, 0, 0]))
    found, losses = heights(bare(barometer=barometer), IMU, T_S, P_N_M)
    np.testing.assert_allclose(found.down_n_m, P_N_M[:, 2], rtol=0, atol=0.01)
    np.testing.assert_allclose(found.arm_b_m, [1.0, 0, 0], rtol=0, atol=1e-15)
    assert losses == ()
    assert found.sigma_m == pytest.approx(0.3)
    assert found.offset.axes == ("height",)


def test_a_drift_is_told_at_times_as_correlated_as_it_is():
    barometer = pressed(T_S, wander_m=2.0, wander_time_s=40.0)
    found, _ = heights(bare(barometer=barometer), IMU, T_S, P_N_M)
    times = len(found.offset.axes)
    assert times == 7  # eight in a time constant
    P = found.offset.covariance
    np.testing.assert_allclose(np.diag(P), 20.0**2 + 2.0**2, rtol=1e-12)
    assert P[0, -1] == pytest.approx(20.0**2 + 2.0**2 * np.exp(-29.9 / 40))
    np.testing.assert_allclose(found.place[[0, -1]], [0, times - 1], rtol=0, atol=1e-12)
    assert found.sigma_m > 0.3


def test_what_lines_between_those_times_miss_is_not_believed_on_average():
    """Means over the flight of what is left of drifts, against white noise of the sigma used."""
    barometer = pressed(T_S, wander_m=2.0, wander_time_s=20.0, noise_m=1e-3)
    found, _ = heights(bare(barometer=barometer), IMU, T_S, P_N_M)
    rng, kept = np.random.default_rng(0), np.exp(-0.1 / 20.0)
    steps = 2.0 * np.sqrt(1 - kept**2) * rng.standard_normal((400, 300))
    drift = np.empty((400, 300))
    drift[:, 0] = 2.0 * rng.standard_normal(400)
    for k in range(1, 300):
        drift[:, k] = kept * drift[:, k - 1] + steps[:, k]
    times_s = np.linspace(0, T_S[-1], len(found.offset.axes))
    lines = np.array([np.interp(T_S, times_s, np.interp(times_s, T_S, row)) for row in drift])
    variance = (drift - lines).mean(axis=1).var()
    assert variance == pytest.approx(found.sigma_m**2 / 300, rel=0.25)


def test_each_sample_is_used_once_and_the_rest_is_counted():
    fast, slow = pressed(np.arange(0.0, 30.0, 0.02)), pressed(np.arange(0.03, 30.0, 1.0))
    found, losses = heights(bare(barometer=fast), IMU, T_S, P_N_M)
    assert np.isfinite(found.down_n_m).all()
    assert losses[0].count == 1200
    found, losses = heights(bare(barometer=slow), IMU, T_S, P_N_M)
    there = np.isfinite(found.down_n_m)
    assert there.sum() == 29  # the keyframe nearest to the first lies before it
    np.testing.assert_allclose(found.down_n_m[there], P_N_M[there, 2], rtol=0, atol=0.01)
    assert losses[0].count == 1


def test_nothing_is_put_into_holes_of_a_recording():
    t_s = np.concatenate([np.arange(0.0, 10.0, 0.1), np.arange(20.0, 30.0, 0.1)])
    found, _ = heights(bare(barometer=pressed(t_s)), IMU, T_S, P_N_M)
    there = np.isfinite(found.down_n_m)
    assert not there[(T_S > 10.0) & (T_S < 19.9)].any()
    assert there.sum() == 200


def test_a_magnetometer_that_reads_zero_says_nothing():
    field_b_ut = np.tile([20.0, 0.0, 40.0], (300, 1))
    field_b_ut[7] = 0.0
    sensor = Magnetometer(
        t_s=T_S,
        field_b_ut=field_b_ut,
        field_n_ut=np.array([20.0, 0.0, 40.0]),
        noise_ut=0.4,
        hard_iron_ut=2.0,
    )
    found, _ = magnetic_field(bare(magnetometer=sensor), T_S)
    assert np.setdiff1d(np.arange(len(T_S)), found.directions.row).tolist() == [7]
    weight = np.linalg.norm(found.directions.across_b, axis=2)
    assert weight[0] == pytest.approx(np.hypot(20, 40) / 0.4)
    assert not weight[7].any()


def test_a_magnetometer_tells_a_lone_antennas_heading_and_the_vehicles_own_field():
    flight = flown("surroundings", 25.0)
    without = dataclasses.replace(flight, magnetometer=None, barometer=None)
    found = Batch()(flight)
    assert found.converged
    assert euler_rmse_deg(flight, found)[2] < 0.5
    assert euler_rmse_deg(flight, Batch()(without))[2] > 5.0
    iron = next(one for one in found.constants if one.name == "hard iron")
    own_b_ut = 2.0 * np.random.default_rng(1).spawn(8)[7].standard_normal(3)
    error = iron.value - own_b_ut
    assert error @ np.linalg.solve(iron.covariance, error) < 14.2
    kinds = {part.what: part for part in found.consistency}
    field = kinds["magnetic field"]
    assert abs(field.nis - 1) < 5 * np.sqrt(2 / field.freedom)
    assert kinds["barometric height"].nis < 1.2
    unused = [loss for loss in found.losses if loss.what in ("magnetic field", "barometric height")]
    assert all(loss.count == 1 for loss in unused)  # before the first attitude


def test_the_window_estimates_them_with_the_flight_too():
    flight = flown("surroundings", 25.0)
    batch, window = Batch()(flight), Smoother()(flight)
    assert window.converged
    assert [one.name for one in window.constants] == ["barometer", "hard iron"]
    for a, b in zip(window.constants, batch.constants, strict=True):
        sigma = np.sqrt(np.diag(b.covariance))
        assert np.abs((a.value - b.value) / sigma).max() < 0.1


def test_gtsam_refuses_a_flight_with_a_barometer():
    with pytest.raises(NoSolutionError, match="barometer: gtsam has factors for the landmark"):
        GtsamBatch()(flown("surroundings", 25.0))
