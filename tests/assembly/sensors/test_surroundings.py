"""Barometric height and the magnetic field at keyframes."""

import numpy as np
import pytest

from fgnav.assembly.sensors.surroundings import heights, magnetic_field
from fgnav.types.flight import Flight, Imu
from fgnav.types.surroundings import Barometer, Magnetometer
from tests.assembly.flights import ACCELEROMETER, ORIGIN

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
    at_keyframes, (offset,), unused = heights(bare(barometer=barometer), IMU, T_S, P_N_M)
    np.testing.assert_allclose(at_keyframes.down_n_m, P_N_M[:, 2], rtol=0, atol=0.01)
    np.testing.assert_allclose(at_keyframes.arm_b_m, [1.0, 0, 0], rtol=0, atol=1e-15)
    assert unused == ()
    assert at_keyframes.sigma_m == pytest.approx(0.3)
    assert offset.axes == ("height",)


def test_a_drift_is_estimated_at_times_as_correlated_as_it_is():
    barometer = pressed(T_S, wander_m=2.0, wander_time_s=40.0)
    at_keyframes, (offset,), _ = heights(bare(barometer=barometer), IMU, T_S, P_N_M)
    times = len(offset.axes)
    assert times == 7  # eight in a time constant
    P = offset.covariance
    np.testing.assert_allclose(np.diag(P), 20.0**2 + 2.0**2, rtol=1e-12)
    assert P[0, -1] == pytest.approx(20.0**2 + 2.0**2 * np.exp(-29.9 / 40))
    place = at_keyframes.node + at_keyframes.share
    np.testing.assert_allclose(place[[0, -1]], [0, times - 1], rtol=0, atol=1e-12)
    assert at_keyframes.sigma_m > 0.3


def test_an_offset_that_hides_its_drift_in_digits_is_none_that_cannot_be_whitened():
    barometer = pressed(T_S, offset_m=1e9, wander_m=1e-3, wander_time_s=40.0)
    _, (offset,), _ = heights(bare(barometer=barometer), IMU, T_S, P_N_M)
    assert np.isfinite(np.linalg.cholesky(offset.covariance)).all()


def test_what_lines_between_those_times_miss_is_noise_of_the_same_mean():
    """Means over the flight of what is left of drifts, against white noise of the sigma used."""
    barometer = pressed(T_S, wander_m=2.0, wander_time_s=20.0, noise_m=1e-3)
    at_keyframes, (offset,), _ = heights(bare(barometer=barometer), IMU, T_S, P_N_M)
    rng, kept = np.random.default_rng(0), np.exp(-0.1 / 20.0)
    steps = 2.0 * np.sqrt(1 - kept**2) * rng.standard_normal((400, 300))
    drift = np.empty((400, 300))
    drift[:, 0] = 2.0 * rng.standard_normal(400)
    for k in range(1, 300):
        drift[:, k] = kept * drift[:, k - 1] + steps[:, k]
    times_s = np.linspace(0, T_S[-1], len(offset.axes))
    lines = np.array([np.interp(T_S, times_s, np.interp(times_s, T_S, row)) for row in drift])
    variance = (drift - lines).mean(axis=1).var()
    assert variance == pytest.approx(at_keyframes.sigma_m**2 / 300, rel=0.25)


def test_each_sample_is_used_once_and_the_rest_is_counted():
    fast, slow = pressed(np.arange(0.0, 30.0, 0.02)), pressed(np.arange(0.03, 30.0, 1.0))
    at_keyframes, _, unused = heights(bare(barometer=fast), IMU, T_S, P_N_M)
    assert len(at_keyframes.row) == len(T_S)
    assert unused[0].count == 1200
    at_keyframes, _, unused = heights(bare(barometer=slow), IMU, T_S, P_N_M)
    row = at_keyframes.row
    assert len(row) == 29  # the keyframe nearest to the first lies before it
    np.testing.assert_allclose(at_keyframes.down_n_m, P_N_M[row, 2], rtol=0, atol=0.01)
    assert unused[0].count == 1


def test_nothing_is_put_into_holes_of_a_recording():
    t_s = np.concatenate([np.arange(0.0, 10.0, 0.1), np.arange(20.0, 30.0, 0.1)])
    at_keyframes, _, _ = heights(bare(barometer=pressed(t_s)), IMU, T_S, P_N_M)
    at_s = T_S[at_keyframes.row]
    assert not ((at_s > 10.0) & (at_s < 19.9)).any()
    assert len(at_s) == 200


def test_a_magnetometer_that_reads_zero_has_no_direction():
    field_b_ut = np.tile([20.0, 0.0, 40.0], (300, 1))
    field_b_ut[7] = 0.0
    sensor = Magnetometer(
        t_s=T_S,
        field_b_ut=field_b_ut,
        field_n_ut=np.array([20.0, 0.0, 40.0]),
        noise_ut=0.4,
        hard_iron_ut=2.0,
    )
    at_keyframes, _, _ = magnetic_field(sensor, T_S)
    assert np.setdiff1d(np.arange(len(T_S)), at_keyframes.row).tolist() == [7]
    weight = np.linalg.norm(at_keyframes.across_b, axis=2)
    assert weight[0] == pytest.approx(np.hypot(20, 40) / 0.4)


def test_a_filter_takes_the_newest_sample_since_the_keyframe_before():
    fast, slow = pressed(np.arange(0.0, 30.0, 0.02)), pressed(np.arange(0.03, 30.0, 1.0))
    at_keyframes, _, unused = heights(bare(barometer=fast), IMU, T_S, P_N_M, causal=True)
    assert len(at_keyframes.row) == len(T_S)
    assert unused[0].count == 1200
    at_keyframes, _, _ = heights(bare(barometer=slow), IMU, T_S, P_N_M, causal=True)
    np.testing.assert_allclose(T_S[at_keyframes.row], np.arange(0.1, 30.0, 1.0), rtol=0, atol=1e-9)


def test_a_filter_takes_a_drift_for_noise_as_loud_at_low_frequencies():
    """How many values of it a flight has depends on how long the flight will be."""
    barometer = pressed(T_S, wander_m=2.0, wander_time_s=40.0)
    at_keyframes, (offset,), _ = heights(bare(barometer=barometer), IMU, T_S, P_N_M, causal=True)
    assert offset.axes == ("height",)
    density = 2 * 2.0**2 * 40.0  # of a Gauss-Markov process at low frequencies
    assert at_keyframes.sigma_m == pytest.approx(np.hypot(0.3, np.sqrt(density / 0.1)))
