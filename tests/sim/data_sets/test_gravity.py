"""Windows for learning gravity: the physics that connects what is measured with the answer."""

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fgnav.checks import BadInputError
from fgnav_sim.data_sets.gravity import PHASES, gravity_epochs, gravity_flight
from fgnav_sim.data_sets.gravity_world import GravityWorld, PhasesTable, WindowsTable
from fgnav_sim.scenario import ImuTable

CALM = ImuTable(
    accelerometer_noise_mps2_per_sqrt_hz=1e-9,
    accelerometer_bias_mps2=1e-9,
    accelerometer_bias_walk_mps2_per_sqrt_s=1e-9,
)
EXACT = GravityWorld(
    imu=CALM,
    velocity_noise_mps=(1e-9, 1e-9),
    accelerometer_arm_m=(0.0, 0.0, 0.0),
    antenna_arm_m=(0.0, 0.0, 0.0),
)
NONE = dict.fromkeys(PHASES, 0.0)


def drawn(world, count=400, seed=1):
    return gravity_epochs(world, np.random.default_rng(seed), count)


def only(world, *phases):
    """Return a world of some kinds of flight."""
    weights = PhasesTable(**(NONE | dict.fromkeys(phases, 1.0)))
    return msgspec.structs.replace(world, phases=weights)


def angle_deg(a, b):
    cosine = (a * b).sum(axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


@pytest.mark.parametrize("phase", PHASES)
def test_what_velocities_gain_is_felt_specific_force_and_gravity(phase):
    """Over a tenth of a second: ``dv = R (f + g_b g) dt``, where the attitude hardly changes."""
    epochs = drawn(only(EXACT, phase), 200)
    R_nb, f_b_mps2 = epochs.R_nb, epochs.f_b_mps2[:, -11:].mean(axis=1)
    gained = (epochs.v_n_mps[:, -1] - epochs.v_n_mps[:, -2]) / 0.1
    felt = np.einsum("nij,nj->ni", R_nb, f_b_mps2) + np.array([0.0, 0.0, 9.8])
    # The median: spins turn far in that time, and 250 m/s have .04 m/s2 by the Earth's turn.
    assert np.median(np.linalg.norm(gained - felt, axis=1)) < (5.0 if phase == "spin" else 1.0)


def test_gravity_is_down_in_body_axes():
    epochs = drawn(GravityWorld())
    g_n = np.einsum("nij,nj->ni", epochs.R_nb, epochs.g_b)
    assert_allclose(g_n, np.tile([0.0, 0.0, 1.0], (len(g_n), 1)), atol=1e-12)


def test_windows_hold_consecutive_samples_and_noise_as_specified():
    quiet = msgspec.structs.replace(only(GravityWorld(), "cruise"), imu=CALM)
    noisy = msgspec.structs.replace(
        quiet, imu=msgspec.structs.replace(CALM, accelerometer_noise_mps2_per_sqrt_hz=1e-2)
    )
    difference = drawn(noisy).f_b_mps2 - drawn(quiet).f_b_mps2
    assert difference.shape == (400, 150, 3)
    assert difference.std() == pytest.approx(0.1, rel=0.02)


def test_a_motor_shows_and_a_coasting_rocket_feels_the_air_alone():
    epochs = drawn(only(GravityWorld(), "rocket"), 2000)
    size = np.linalg.norm(epochs.f_b_mps2[:, -1], axis=1)
    assert size.max() > 30.0
    assert (size < 0.6 * 9.8).mean() > 0.4


def test_nothing_acts_on_a_body_without_air():
    epochs = drawn(only(EXACT, "vacuum"))
    assert np.abs(epochs.f_b_mps2).max() < 1e-3


@pytest.mark.parametrize("phase", PHASES)
def test_a_flight_of_each_kind_has_sensors_and_truth(phase):
    flight = gravity_flight(GravityWorld(), phase, rng=np.random.default_rng(3))
    assert flight.name == phase
    assert_allclose(flight.fixes[0].t_s, flight.truth.t_s)
    assert 0.01 <= flight.fixes[0].velocity_sigma_mps[0, 0] <= 0.1
    assert np.abs(flight.imu.position_b_m).max() <= 0.5


def test_a_turn_banks_as_lift_requires():
    calm = msgspec.structs.replace(
        only(EXACT, "turn"),
        motion=msgspec.structs.replace(EXACT.motion, wobble_deg=(0, 0), surge_mps2=(0, 0)),
    )
    f_b_mps2 = drawn(calm).f_b_mps2[:, -1]
    # Without the Coriolis acceleration, 250 m/s turn over the Earth by at most 0.04 m/s2.
    assert np.abs(f_b_mps2[:, 1]).max() < 0.1
    assert (f_b_mps2[:, 2] < -9.7).all()


def test_same_seed_same_windows_and_a_count_below_one_is_refused():
    one, again = drawn(GravityWorld(), 50), drawn(GravityWorld(), 50)
    assert_array_equal(one.f_b_mps2, again.f_b_mps2)
    assert len(one) == 50
    assert one.flight[-1] == 2
    assert not np.array_equal(one.g_b, drawn(GravityWorld(), 50, seed=2).g_b)
    with pytest.raises(BadInputError, match="count: must be 1 or more, got -1"):
        drawn(GravityWorld(), -1)


def test_a_flight_shorter_than_a_window_is_refused():
    world = msgspec.structs.replace(
        only(GravityWorld(), "cruise"), windows=WindowsTable(flight_s=1.0)
    )
    with pytest.raises(BadInputError, match=r"windows\.flight_s: the cruise flew 0\.99 s"):
        drawn(world, 20)
