import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import exp, log
from fgnav_sim.vehicle.flown_motion import FlownMotion, flown_motion
from fgnav_sim.vehicle.rigid_body import Flown
from fgnav_sim.vehicle.tables import BodyTable, Vehicle
from tests.sim.vehicle.reference import (
    fly,
    launch,
    position_e_m,
    rate_ib_b_radps,
    rotation_eb,
    velocity_e_mps,
)

ORIGIN = Origin(latitude_rad=0.7, longitude_rad=-0.07, height_m=500.0)
BODY = Vehicle(body=BodyTable(mass_kg=3.0, inertia_kgm2=(0.02, 0.3, 0.31)))
OFF_ROWS_S = np.array([0.0033, 1.5519, 4.9987, 9.9951])


def flown(row_interval_s: float = 0.01, ground_m: float = -5000.0) -> Flown:
    start = launch(
        *(0.701, -0.071, 900.0),
        v_n_mps=np.array([100.0, 30.0, -80.0]),
        euler_rad=np.array([0.1, 0.6, -2.0]),
        w_ib_b_radps=np.array([30.0, 0.5, -0.4]),
    )
    return fly(BODY, start, row_interval_s=row_interval_s, ground_m=ground_m, air=False)


@pytest.fixture(scope="module")
def motion() -> FlownMotion:
    return flown_motion(flown(), ORIGIN)


def test_a_freely_falling_body_feels_no_specific_force_at_any_time(motion: FlownMotion) -> None:
    f_b = motion(OFF_ROWS_S).specific_force_b_mps2(ORIGIN, np.zeros(3), "wgs84-normal")
    assert np.abs(f_b).max() < 2e-4  # m/s2, the rounding of positions over 10 ms


def test_between_rows_the_motion_is_that_of_the_flight(motion: FlownMotion) -> None:
    fine = flown(row_interval_s=1e-3)
    t_s = fine.t_s[4::997]
    state = motion(t_s)
    rows = np.searchsorted(fine.t_s, t_s - 1e-9)
    assert np.abs(state.p_n_m - ORIGIN.to_n(position_e_m(fine)[rows])).max() < 1e-6  # m
    v_n = velocity_e_mps(fine)[rows] @ ORIGIN.R_ne.T
    assert np.abs(state.v_n_mps - v_n).max() < 1e-6  # m/s
    turn = state.R_nb.swapaxes(1, 2) @ ORIGIN.R_ne @ rotation_eb(fine)[rows]
    assert np.abs(log(turn)).max() < 1e-8  # rad
    w_ib_b = state.inertial_rate_b_radps(ORIGIN)
    assert np.abs(w_ib_b - rate_ib_b_radps(fine)[rows]).max() < 1e-6  # rad/s


def test_rates_and_accelerations_are_derivatives_of_the_motion(motion: FlownMotion) -> None:
    h = 1e-4
    before, now, after = (motion(OFF_ROWS_S + step) for step in (-h, 0.0, h))
    assert np.abs((after.p_n_m - before.p_n_m) / (2 * h) - now.v_n_mps).max() < 1e-6
    assert np.abs((after.v_n_mps - before.v_n_mps) / (2 * h) - now.a_n_mps2).max() < 1e-6
    turned = before.R_nb @ exp(2 * h * now.w_nb_b_radps)
    assert np.abs(log(after.R_nb.swapaxes(1, 2) @ turned)).max() < 1e-7
    alpha = (after.w_nb_b_radps - before.w_nb_b_radps) / (2 * h)
    assert np.abs(alpha - now.alpha_nb_b_radps2).max() < 1e-3


def test_times_outside_the_flight_are_named(motion: FlownMotion) -> None:
    with pytest.raises(
        BadInputError, match="t_s: must lie within the flight, 0 to 10, got 5 to 11"
    ):
        motion(np.array([5.0, 11.0]))


def test_a_flight_that_meets_the_ground_at_once_is_named() -> None:
    with pytest.raises(BadInputError, match=r"flown\.start: the flight meets the ground at once"):
        flown_motion(flown(ground_m=2000.0), ORIGIN)
