"""Straight flights of one antenna: next to nothing tells the heading, and sigmas say so."""

import dataclasses
from functools import cache

import msgspec
import numpy as np
import pytest

from fgnav.geometry import rotations
from fgnav.integers.resolvers.truth import attitude_at
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.types.flight import InitialAttitude
from fgnav_sim.motion import Motion, Sine, Straight
from fgnav_sim.scenario import FixesTable, ImuTable, Scenario, load_scenario
from fgnav_sim.simulate import simulate
from tests.methods.simulated import SCENARIOS, errors_rad, nees, shared

SEEDS = (0, 1, 2, 3)


@cache
def cruising(seed):
    """Return twenty seconds at 50 m/s that sway, heading apart from its course; fixes at 5 Hz."""
    rng = np.random.default_rng(seed)
    swaying = [
        Sine(amplitude_deg=size, rate_radps=2 * np.pi / rng.uniform(5, 12), offset_deg=offset)
        for size, offset in ((10.0, 0.0), (5.0, 0.0), (10.0, rng.uniform(-180, 180)))
    ]
    path = Straight(speed_mps=50.0, course_deg=rng.uniform(-180, 180), climb_mps=2.0)
    imu = ImuTable(
        accelerometer_bias_mps2=5e-2,
        gyroscope_noise_radps_per_sqrt_hz=5e-4,
        gyroscope_bias_radps=1e-2,
        gyroscope_bias_walk_radps_per_sqrt_s=1e-5,
    )
    scenario = Scenario(
        duration_s=20.0,
        motion=Motion(path=path, roll=swaying[0], pitch=swaying[1], yaw=swaying[2]),
        antennas_b_m=((0.0, 0.0, 0.0),),
        fixes=FixesTable(rate_hz=5.0, position_noise_m=0.5, velocity_noise_mps=0.05),
        imu=imu,
    )
    return simulate(scenario, rng)


@pytest.mark.parametrize(
    "method",
    [Batch(), Smoother(), Forward()],
    ids=lambda method: method.name,
)
def test_a_heading_that_nothing_tells_is_open_and_the_rest_is_honest(method):
    squares = []
    for seed in SEEDS:
        flight = cruising(seed)
        found = shared(dataclasses.replace(method, noise="nominal"), flight)
        assert found.sigma_deg[:, 2].min() > 60  # uniform over the circle: 104
        squares.append(nees(errors_rad(flight, found), found.attitude_covariance_rad2))
    # Roll and pitch tell 1 each; the heading's mean square is 1 if uniform, 3 at most.
    assert 1.0 < np.mean(squares) < 5.0


def test_a_heading_stated_roughly_weighs_the_headings_of_a_batch():
    flight = cruising(0)
    R_nb, _ = attitude_at(flight.truth, flight.fixes[0].t_s[:1])
    heading_rad = float(rotations.to_euler(R_nb)[0, 2]) + 0.3
    initial = InitialAttitude(heading_rad=heading_rad, heading_sigma_rad=0.5)
    found = Batch(noise="nominal")(dataclasses.replace(flight, initial=initial))
    assert 20 < found.sigma_deg[0, 2] < 45  # 0.5 rad are 29 degrees
    assert nees(errors_rad(flight, found), found.attitude_covariance_rad2) < 5


def told(flight, sigma_rad, rng):
    """Return a flight that states its first heading, in error by a draw of its sigma."""
    R_nb, _ = attitude_at(flight.truth, flight.observations.t_s[:1])
    heading_rad = float(rotations.to_euler(R_nb)[0, 2]) + sigma_rad * rng.standard_normal()
    initial = InitialAttitude(heading_rad=heading_rad, heading_sigma_rad=sigma_rad)
    return dataclasses.replace(flight, initial=initial)


@pytest.mark.parametrize(
    "method",
    [Smoother(), Forward()],
    ids=lambda method: method.name,
)
def test_phases_tell_a_window_no_heading_that_is_none(method):
    """A level known later, beside what was marginalised before, made it sure: NEES 22 to 685."""
    scenario = load_scenario(SCENARIOS / "surroundings.toml")
    changes = {"duration_s": 15.0, "barometer": None, "magnetometer": None}
    scenario = msgspec.structs.replace(scenario, **changes)
    squares = []
    for seed in range(4):
        rng = np.random.default_rng(400 + seed)
        flight = told(simulate(scenario, rng), np.radians(1.0), rng)
        found = dataclasses.replace(method, noise="nominal")(flight)
        assert found.sigma_deg[-1, 2] > 1.0  # nothing tells it better than it is stated
        squares.append(nees(errors_rad(flight, found), found.attitude_covariance_rad2))
    assert 1.5 < np.mean(squares) < 4.5
