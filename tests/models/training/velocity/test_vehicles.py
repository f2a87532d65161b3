"""Vehicles of many kinds: motions that are their own derivatives, and what tells them apart."""

import numpy as np
import pytest

from fgnav.geometry.rotations import log, transpose
from fgnav_models.training.velocity.vehicles.world import (
    KINDS,
    VehiclesWorld,
    drawn_kind,
    vehicle_scenario,
)
from fgnav_sim.simulate import simulate

STEP_S = 1e-3
WORLD = VehiclesWorld(flight_s=30.0)


@pytest.fixture(scope="module", params=KINDS)
def moved(request):
    rng = np.random.default_rng(3)
    motion = vehicle_scenario(WORLD, request.param, rng).motion
    t_s = np.arange(1.0, 29.0, 0.37)
    return request.param, *(motion.calm(t_s + h) for h in (-STEP_S, 0.0, STEP_S))


def test_velocity_acceleration_and_rates_are_derivatives(moved):
    _, before, now, after = moved
    for value, rate in (("p_n_m", "v_n_mps"), ("v_n_mps", "a_n_mps2"), ("w_nb_b_radps",) * 2):
        change = (getattr(after, value) - getattr(before, value)) / (2 * STEP_S)
        expected = now.alpha_nb_b_radps2 if value == "w_nb_b_radps" else getattr(now, rate)
        # Central differences of accelerations that change by 100 m/s2 per s2: 1e-4 of them.
        np.testing.assert_allclose(change, expected, rtol=0, atol=2e-3)
    turn_rad = log(transpose(before.R_nb) @ after.R_nb) / (2 * STEP_S)
    np.testing.assert_allclose(turn_rad, now.w_nb_b_radps, rtol=0, atol=2e-3)


def test_each_kind_moves_as_its_own_laws_have_it():
    speeds = {}
    for kind in KINDS:
        v_b_mps, f_b_mps2 = [], []
        for rng in np.random.default_rng(5).spawn(12):
            motion = vehicle_scenario(WORLD, kind, rng).motion
            t_s = np.arange(0.0, 30.0, 0.1)
            state = motion.calm(t_s)
            v_b_mps.append(np.einsum("nij,ni->nj", state.R_nb, state.v_n_mps))
            f_n_mps2 = state.a_n_mps2 - [0.0, 0.0, 9.81]
            f_b_mps2.append(np.einsum("nij,ni->nj", state.R_nb, f_n_mps2))
        v, f = np.concatenate(v_b_mps), np.concatenate(f_b_mps2)
        speeds[kind] = np.sqrt((v**2).mean(axis=0))
        assert f[:, 2].max() < 0  # none falls freely, or flies on its back
    assert speeds["car"][1] < 0.15 * speeds["car"][0]  # wheels
    assert speeds["aeroplane"][1] < 0.15 * speeds["aeroplane"][0]  # coordinated turns
    assert speeds["multirotor"][1] > 0.3 * speeds["multirotor"][0]  # goes anywhere


def test_a_car_that_stands_is_quiet():
    for rng in np.random.default_rng(1).spawn(20):
        motion = vehicle_scenario(WORLD, "car", rng).motion
        t_s = np.arange(0.0, 30.0, 0.01)
        v_mps = np.linalg.norm(motion.calm(t_s).v_n_mps, axis=1)
        shaken = np.linalg.norm(motion(t_s).a_n_mps2 - motion.calm(t_s).a_n_mps2, axis=1)
        stands, drives = v_mps < 0.01, v_mps > 10.0
        if stands.sum() > 100 and drives.sum() > 100:
            assert np.median(shaken[stands]) < np.median(shaken[drives])
            return
    pytest.fail("no car of twenty stands and drives")


def test_a_vehicle_is_a_flight_of_the_simulator():
    rng = np.random.default_rng(2)
    flight = simulate(vehicle_scenario(WORLD, "car", rng), rng)
    assert flight.imu.w_b_radps is not None
    assert len(flight.imu.t_s) == 3000


def test_kinds_are_as_likely_as_the_world_has_them():
    rng = np.random.default_rng(4)
    world = VehiclesWorld(car=0.0, multirotor=3.0, aeroplane=1.0)
    kinds = [drawn_kind(world, rng) for _ in range(400)]
    assert kinds.count("car") == 0
    assert 0.68 < kinds.count("multirotor") / 400 < 0.82


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"car": 0.0, "multirotor": 0.0, "aeroplane": 0.0}, "car: must be above zero"),
        ({"gyroscope_noise_radps_per_sqrt_hz": (2.0, 1.0)}, "must be above zero, and a range"),
    ],
)
def test_a_world_of_nothing_is_refused(wrong, words):
    with pytest.raises(ValueError, match=words):
        VehiclesWorld(**wrong)
