import msgspec
import numpy as np
import pytest

from fgnav_sim.motion import Command, Hold, Ramp, Rate, Sine
from fgnav_sim.vehicle.atmosphere import dryden
from fgnav_sim.vehicle.autopilot import commanded
from fgnav_sim.vehicle.flown_table import AttitudeTable, FlownTable
from fgnav_sim.vehicle.forces import SPIN
from fgnav_sim.vehicle.model import pack
from fgnav_sim.vehicle.rigid_body import Flown
from tests.sim.vehicle.reference import (
    ROCKET,
    deflections_rad,
    euler_rad,
    fly,
    launch,
    places,
    rotation_eb,
    velocity_e_mps,
)

COASTING = msgspec.structs.replace(ROCKET, motor=None)


def flown(*commands: Command, **table: object) -> Flown:
    start = launch(
        height_m=2000.0,
        v_n_mps=np.array([240.0, 0.0, -60.0]),
        euler_rad=np.radians([0.0, 14.0, 0.0]),
        spin_radps=60.0,
    )
    attitude = AttitudeTable(*commands) if commands else None
    return fly(COASTING, start, 8.0, attitude=attitude, **table)


def test_the_forebody_follows_commanded_angles_while_the_rear_body_spins() -> None:
    roll = Ramp(amplitude_deg=30.0, rise_s=2.0)
    flight = flown(roll, Hold(angle_deg=12.0), Hold(angle_deg=1.0))
    euler_deg = np.degrees(euler_rad(flight))
    settled = flight.t_s > 4.0
    assert np.abs(euler_deg[settled, 0] - 30.0).max() < 0.2
    assert np.abs(euler_deg[settled, 1] - 12.0).max() < 1.0
    assert np.abs(euler_deg[settled, 2] - 1.0).max() < 1.0
    assert flight.y[10, SPIN] > 10.0
    assert np.abs(euler_deg[:10, 0]).max() < 0.5


def test_deflections_and_their_rates_stay_within_their_limits() -> None:
    flight = flown(Hold(angle_deg=60.0), Hold(angle_deg=35.0), Hold(angle_deg=-20.0))
    assert ROCKET.canards is not None
    limit, rate = ROCKET.canards.deflection_deg, ROCKET.canards.rate_degps
    deflections_deg = np.degrees(deflections_rad(flight))
    assert np.abs(deflections_deg).max() == pytest.approx(limit, abs=1e-6)
    rates_degps = np.diff(deflections_deg, axis=0) / np.diff(flight.t_s)[:, None]
    assert np.abs(rates_degps).max() == pytest.approx(rate, rel=1e-3)


def test_without_commands_canards_rest_where_they_are() -> None:
    assert not deflections_rad(flown()).any()


def test_the_autopilot_holds_roll_in_turbulence() -> None:
    gust = dryden(
        np.random.default_rng(2), sigma_mps=2.0, direction_n=np.array([1.0, 0, -0.2]), length_m=3e3
    )
    flight = flown(Hold(), Hold(angle_deg=12.0), Hold(), gust_mps=gust)
    assert np.degrees(np.abs(euler_rad(flight)[:, 0])).max() < 2.0


def test_commands_in_the_table_are_those_of_the_motion_and_their_rates() -> None:
    commands = (Sine(amplitude_deg=20.0), Ramp(amplitude_deg=5.0, rise_s=3.0), Rate(rate_degps=4.0))
    table = FlownTable(vehicle=ROCKET, attitude=AttitudeTable(*commands))
    model = pack(ROCKET, table, 10.0)
    for t_s in (0.0, 0.37, 2.99, 7.77, 10.0):
        angle, rate = commanded(model.body, model.tables, t_s)
        exact = np.array([command(np.array([t_s]))[:2, 0] for command in commands])
        assert np.array(angle) == pytest.approx(exact[:, 0], abs=1e-7)
        assert np.array(rate) == pytest.approx(exact[:, 1], abs=1e-4)


def test_a_boosted_rocket_leaves_the_ground_stable_and_comes_down_whole() -> None:
    v_n_mps, euler_rad = np.array([3.0, 0.0, -30.0]), np.radians([0.0, 84.0, 0.0])
    start = launch(height_m=100.0, v_n_mps=v_n_mps, euler_rad=euler_rad)
    passive = msgspec.structs.replace(ROCKET, autopilot=None, canards=None)
    flight = fly(passive, start, 80.0, row_interval_s=0.1, ground_m=100.0)
    height = places(flight)[:, 2]
    assert 1000.0 < height.max() < 6000.0
    assert flight.t_s[-1] < 80.0
    boost = (flight.t_s > 0.5) & (flight.t_s < 8.0)
    v_e, u_e = velocity_e_mps(flight)[boost], rotation_eb(flight)[boost, :, 0]
    cosine = np.sum(v_e * u_e, axis=1) / np.linalg.norm(v_e, axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 5.0
