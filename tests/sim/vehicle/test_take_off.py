"""Scenarios that a rigid body flies: what their sensors feel is what the body did."""

import msgspec
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav_sim.motion import Hold
from fgnav_sim.scenario import FixesTable, ImuTable, Place, Scenario, load_scenario
from fgnav_sim.simulate import simulate
from fgnav_sim.vehicle.flown_table import (
    AttitudeTable,
    FlownTable,
    GustsTable,
    StartTable,
)
from fgnav_sim.vehicle.planet import Planet
from fgnav_sim.vehicle.rigid_body import fly_body
from fgnav_sim.vehicle.tables import BodyTable, Vehicle, load_vehicle
from fgnav_sim.vehicle.take_off import take_off
from tests.sim.vehicle.reference import ROCKET, VEHICLES, position_e_m

FREE = Vehicle(body=BodyTable(mass_kg=3.0, inertia_kgm2=(0.02, 0.3, 0.31)))
FT = 0.3048


def scenario(vehicle: Vehicle, start: StartTable | None = None, **changes: object) -> Scenario:
    of_scenario = {k: changes.pop(k) for k in tuple(changes) if k in Scenario.__struct_fields__}
    flown = FlownTable(vehicle=vehicle, start=start or StartTable(), **changes)
    return Scenario(flown=flown, **{"duration_s": 10.0, **of_scenario})


def airborne(one: Scenario, seed: int = 1) -> Scenario:
    return take_off(one, np.random.default_rng(seed))[0]


@pytest.mark.parametrize("name", ["glider", "rocket"])
def test_specific_force_and_true_attitude_integrate_to_the_true_velocity(name: str) -> None:
    flying = airborne(load_scenario(name))
    origin, h = flying.origin.frame, 1e-3
    lever_b_m = np.array([0.4, 0.02, -0.1])
    t_s = np.arange(int(flying.duration_s / h)) * h
    state = flying.motion(t_s)
    f_b = state.specific_force_b_mps2(origin, lever_b_m, flying.gravity)
    p_n, v_n, _ = state.at(lever_b_m)
    f_n = np.einsum("nij,nj->ni", state.R_nb, f_b)
    g_n = origin.gravity_n_mps2(p_n, flying.gravity)
    a_n = f_n + g_n - 2 * np.cross(origin.earth_rate_n_radps, v_n)
    gained = np.vstack([np.zeros(3), np.cumsum(0.5 * h * (a_n[1:] + a_n[:-1]), axis=0)])
    assert t_s[-1] > 45.0
    assert np.abs(v_n[0] + gained - v_n).max() < 1e-3  # m/s


def test_antennas_stay_where_the_structure_has_them_while_the_motor_burns() -> None:
    one = scenario(ROCKET, StartTable(v_b_mps=(30.0, 0.0, 0.0), euler_deg=(0.0, 80.0, 0.0)))
    flying = airborne(one)
    t_s = np.array([0.0, 1.1, 3.0, 5.0])
    state = flying.motion(t_s)
    whole = fly_body(one.flown, one.origin.frame, 6.0)
    centre_n = one.origin.frame.to_n(position_e_m(whole)[np.round(t_s / 0.01).astype(int)])
    ahead_m = np.einsum("nij,ni->nj", state.R_nb, state.p_n_m - centre_n)
    motor = ROCKET.motor
    assert motor is not None
    assert ahead_m[0] == pytest.approx(
        [ROCKET.body.centre_m - motor.loaded_centre_m, 0.0, 0.0], abs=1e-6
    )
    assert 0.01 < ahead_m[1, 0] < ahead_m[0, 0]
    assert ahead_m[3] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    before, after = flying.motion(t_s[1:] - 1e-4), flying.motion(t_s[1:] + 1e-4)
    assert (after.p_n_m - before.p_n_m) / 2e-4 == pytest.approx(state.v_n_mps[1:], abs=1e-5)
    assert (after.v_n_mps - before.v_n_mps) / 2e-4 == pytest.approx(state.a_n_mps2[1:], abs=1e-2)


def test_a_scenario_may_fly_over_a_round_earth_at_rest() -> None:
    round_earth = Planet(semi_major_axis_m=6.371e6, flattening=0.0, rate_radps=0.0)
    start = StartTable(rate_b_degps=(10.0, 20.0, 30.0), rate_against="inertial")
    one = scenario(FREE, start, air=False, gravity="j2", earth=round_earth)
    one = msgspec.structs.replace(
        one, flown=msgspec.structs.replace(one.flown, gravity="spherical"), fixes=FixesTable()
    )
    state = airborne(one).motion(np.array([0.0, 5.0]))
    g = 3.986004418e14 / (6.371e6 + 700.0) ** 2
    assert state.p_n_m[1] == pytest.approx([0.0, 0.0, 0.5 * g * 25], abs=1e-3)
    assert np.degrees(state.w_nb_b_radps[0]) == pytest.approx([10.0, 20.0, 30.0], abs=1e-9)
    assert simulate(one, np.random.default_rng(1)).fixes


def test_rates_count_from_the_earth_unless_told_otherwise() -> None:
    at_rest = airborne(scenario(FREE, StartTable(euler_deg=(10.0, 20.0, 30.0)), air=False))
    assert np.abs(at_rest.motion(np.zeros(1)).w_nb_b_radps).max() < 1e-12
    floating = StartTable(euler_deg=(10.0, 20.0, 30.0), rate_against="inertial")
    w_nb = airborne(scenario(FREE, floating, air=False)).motion(np.zeros(1)).w_nb_b_radps
    assert np.linalg.norm(w_nb) == pytest.approx(7.2921151467e-5, rel=1e-9)


def test_a_start_off_the_origin_is_where_the_frame_n_has_it() -> None:
    start = StartTable(position_n_m=(20e3, -30e3, -5e3), euler_deg=(5.0, 10.0, 200.0))
    state = airborne(scenario(FREE, start, air=False)).motion(np.zeros(1))
    assert state.p_n_m[0] == pytest.approx([20e3, -30e3, -5e3], abs=1e-6)
    from fgnav.geometry.rotations import to_euler

    assert np.degrees(to_euler(state.R_nb)[0]) == pytest.approx([5.0, 10.0, -160.0], abs=1e-9)


def test_canards_hold_what_is_commanded_and_rest_where_nothing_is() -> None:
    start = StartTable(v_b_mps=(230.0, 0.0, 0.0), euler_deg=(0.0, 75.0, 0.0))
    held = AttitudeTable(roll=Hold(angle_deg=15.0), pitch=Hold(angle_deg=73.0))
    from fgnav.geometry.rotations import to_euler

    angles = {}
    for name, attitude in (("held", held), ("rest", None)):
        one = scenario(ROCKET, start, attitude=attitude, ignition_s=-4.0, duration_s=4.0)
        angles[name] = np.degrees(to_euler(airborne(one).motion(np.array([3.9])).R_nb)[0])
    assert angles["held"] == pytest.approx([15.0, 73.0, 0.0], abs=0.05)
    assert abs(angles["rest"][0]) < 2.0


def test_a_motor_that_has_burnt_out_adds_nothing_and_one_lit_later_burns_later() -> None:
    start = StartTable(v_b_mps=(100.0, 0.0, 0.0), euler_deg=(0.0, 80.0, 0.0))

    def feels(ignition_s: float) -> np.ndarray:
        one = airborne(scenario(ROCKET, start, ignition_s=ignition_s, duration_s=4.0))
        state = one.motion(np.array([0.5, 2.5]))
        return state.specific_force_b_mps2(one.origin.frame, np.zeros(3), one.gravity)[:, 0]

    assert (feels(-4.0) < 0).all()
    assert (feels(0.0) > 50).all()
    assert feels(2.0)[0] < 0 < 50 < feels(2.0)[1]


def test_a_flight_that_meets_the_ground_ends_there_and_says_so() -> None:
    low = Place(height_m=100.0)
    one = scenario(FREE, air=False, origin=low, ground_m=0.0, duration_s=20.0, imu=ImuTable())
    flight = simulate(one, np.random.default_rng(1))
    assert flight.truth is not None
    assert flight.imu is not None
    fall_s = np.sqrt(2 * 100.0 / 9.8)
    assert flight.truth.t_s[-1] == pytest.approx(fall_s, abs=0.11)
    assert flight.imu.t_s[-1] == pytest.approx(fall_s, abs=0.03)
    assert [loss.what for loss in flight.unused] == ["landing"]
    assert "the body met the ground after 4.5" in flight.unused[0].reason


def test_gusts_are_the_seeds_and_their_end_is_said() -> None:
    glider = load_vehicle(VEHICLES / "glider.toml")
    start = StartTable(v_b_mps=(15.0, 0.0, 0.0))
    one = scenario(glider, start, gusts=GustsTable(sigma_mps=1.0, length_m=100.0))
    (a, lost), (b, _), (c, _) = (take_off(one, np.random.default_rng(k)) for k in (1, 1, 2))
    t_s = np.array([5.0])
    assert np.array_equal(a.motion(t_s).v_n_mps, b.motion(t_s).v_n_mps)
    assert np.abs(a.motion(t_s).v_n_mps - c.motion(t_s).v_n_mps).max() > 0.05
    assert lost[0].what == "gusts"
    assert lost[0].reason.startswith("gusts end after 100 of 1")


def test_what_cannot_be_flown_is_named() -> None:
    start = StartTable(rate_b_degps=(3000.0, 4000.0, 2000.0))
    with pytest.raises(BadInputError, match=r"flown.step_s: the integration diverges"):
        airborne(scenario(FREE, start, air=False, step_s=0.1))
    with pytest.raises(BadInputError, match=r"flown.step_s: must be at most twice the canards'"):
        airborne(scenario(ROCKET, step_s=0.05, attitude=AttitudeTable()))
    with pytest.raises(BadInputError, match=r"flown.start: the flight meets the ground at once"):
        airborne(scenario(FREE, air=False, ground_m=700.0))
    with pytest.raises(BadInputError, match=r"flown.vehicle: 'a.toml' must be loaded"):
        airborne(Scenario(flown=FlownTable(vehicle="a.toml")))
