"""Currents of the beacon, turned back into the line of sight they came from."""

import numpy as np
import pytest

from fgnav.seeker import line_of_sight
from fgnav_sim.detector import calibration, watch
from fgnav_sim.motion import Motion, Sine, Straight
from fgnav_sim.scenario import Place, Scenario, SeekerTable

BEACON = Place(latitude_deg=40.36, longitude_deg=-3.88, height_m=700.0)  # 3.3 km north
TOWARD = Scenario(
    duration_s=20.0,
    motion=Motion(
        path=Straight(speed_mps=100.0),
        roll=Sine(amplitude_deg=30.0),
        pitch=Sine(amplitude_deg=6.0),
        yaw=Sine(amplitude_deg=6.0, rate_radps=2.0),
    ),
)


def true_direction_b(sensor, scenario, t_s):
    state = scenario.motion(t_s)
    beacon_n_m = scenario.origin.frame.to_n(sensor.landmark.frame.p_e_m[None])[0]
    sight_n_m = beacon_n_m - state.p_n_m - state.R_nb @ np.array(sensor.position_b_m)
    sight_b_m = np.einsum("nji,nj->ni", state.R_nb, sight_n_m)
    return sight_b_m / np.linalg.norm(sight_b_m, axis=1, keepdims=True)


def test_the_reconstruction_returns_the_true_line_of_sight():
    sensor = SeekerTable(landmark=BEACON, range_m=1e4, line_of_sight_noise_rad=1e-12)
    seen = line_of_sight(watch(sensor, TOWARD, rng=np.random.default_rng(1)))
    assert len(seen.t_s) == 200
    assert not seen.losses
    error = seen.e_b - true_direction_b(sensor, TOWARD, seen.t_s)
    assert np.abs(error).max() < 1e-10  # rad


def test_noise_of_the_line_of_sight_has_the_size_asked_for():
    steady = Scenario(duration_s=100.0, motion=Motion(path=Straight(speed_mps=0.0)))
    beacon = Place(latitude_deg=40.34, longitude_deg=-3.88, height_m=700.0)
    sensor = SeekerTable(landmark=beacon, rate_hz=50.0, line_of_sight_noise_rad=1e-3)
    seen = line_of_sight(watch(sensor, steady, rng=np.random.default_rng(1)))
    error = seen.e_b - true_direction_b(sensor, steady, seen.t_s)
    assert np.std(error[:, 1:], axis=0) == pytest.approx([1e-3, 1e-3], rel=0.05)
    assert np.abs(error[:, 1:].mean(axis=0)).max() < 1e-4


def test_the_beacon_is_seen_within_range_and_field_of_view_only():
    sensor = SeekerTable(landmark=BEACON, range_m=2500.0, field_of_view_deg=4.0)
    seeker = watch(sensor, TOWARD, rng=np.random.default_rng(1))
    t_s = TOWARD.epochs_s(sensor.rate_hz)
    state = TOWARD.motion(t_s)
    place_n_m = state.p_n_m + state.R_nb @ np.array(sensor.position_b_m)
    near = np.linalg.norm(seeker.landmark_n_m - place_n_m, axis=1) <= 2500.0
    ahead = true_direction_b(sensor, TOWARD, t_s)[:, 0] >= np.cos(np.radians(4.0))
    assert 0 < len(seeker.t_s) < len(t_s)
    assert np.array_equal(seeker.t_s, t_s[near & ahead])


def test_a_beacon_behind_is_never_seen():
    away = SeekerTable(landmark=Place(latitude_deg=40.32), range_m=1e5)
    assert watch(away, TOWARD, rng=np.random.default_rng(1)) is None


def test_the_built_in_calibration_increases_and_stays_on_the_detector():
    table = calibration()
    assert (np.diff(table, axis=0) > 0).all()
    assert table[0] == pytest.approx([0.0, 0.0])
    assert table[-1, 1] < 1.0
