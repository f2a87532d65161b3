"""Flights without carrier phase: attitudes of vectors, and the batch that starts from them."""

import dataclasses

import msgspec
import numpy as np
import pytest

from fgnav import rotations
from fgnav.checks import NoSolutionError
from fgnav.integers.truth import attitude_at
from fgnav.methods.smoother import Batch, Forward, Smoother, blind, smoother, vector_starts
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.collect import Settings, collect
from fgnav.methods.smoother.smoother import collected_for
from fgnav.methods.smoother.vector_starts import vector_attitudes
from fgnav_sim.motion import Sine
from fgnav_sim.scenario import FixesTable, load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks import consistency
from tests.benchmarks.gravity import Pair, flights
from tests.methods.simulated import SCENARIOS, errors_rad, euler_rmse_deg, nees
from tests.methods.smoother.test_unsolvable import lacking
from tests.methods.true_gravity import TrueGravity


@pytest.fixture(scope="module")
def flight():
    """A body that swings by 20 degrees about all axes in a turn: never nose first."""
    change, swing = msgspec.structs.replace, Sine(amplitude_deg=20.0)
    scenario = load_scenario(SCENARIOS / "six.toml")
    motion = change(scenario.motion, roll=swing, pitch=swing, yaw=swing)
    fixes = FixesTable(rate_hz=10.0)
    scenario = change(scenario, motion=motion, duration_s=20.0, gnss=None, fixes=fixes)
    return simulate(scenario, np.random.default_rng(1))


def test_gravity_and_specific_force_tell_attitudes_as_well_as_they_say(flight):
    told = vector_attitudes(flight, TrueGravity()(flight))
    assert told.told.mean() > 0.95
    assert not told.rough
    assert told.notes == ()
    R_nb, _ = attitude_at(flight.truth, told.t_s)
    error = rotations.log(rotations.transpose(told.R_nb) @ R_nb)[told.told]
    assert 2 < nees(error, told.covariance_rad2[told.told]) < 5


@pytest.mark.parametrize(
    "gravity",
    [None, TrueGravity(every=100), TrueGravity(every=40)],
    ids=["none", "too little", "too seldom"],
)
def test_without_gravity_it_says_that_it_takes_the_velocity_as_the_nose(flight, gravity):
    told = vector_attitudes(flight, None if gravity is None else gravity(flight))
    assert told.rough
    assert "starts with the velocity along x_b" in told.notes[0]


def test_gravity_along_specific_force_tells_nothing_of_the_turn_about_it(flight):
    """At rest they are one vector."""
    still = np.tile(flight.fixes.p_n_m[0], (len(flight.fixes.t_s), 1))
    fixes = dataclasses.replace(flight.fixes, p_n_m=still, v_n_mps=0 * still)
    told = vector_attitudes(dataclasses.replace(flight, fixes=fixes), TrueGravity()(flight))
    assert told.rough


@pytest.mark.parametrize("method", [Batch, Smoother])
def test_a_flight_without_phases_is_solved_with_gravity_and_an_honest_covariance(flight, method):
    estimate = method(gravity=TrueGravity())(flight)
    assert estimate.converged
    assert (euler_rmse_deg(flight, estimate) < 1.5).all()
    assert 1 < nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 4.5
    assert not any(loss.what == "velocity" for loss in estimate.losses)


def test_a_heading_known_to_twenty_degrees_ends_at_its_minimum():
    """Full steps cross the valley to and fro: after a hundred they still were at it."""
    cruise = flights(2, 77)[1]
    keyframes = collected_for(Batch(gravity=Pair(interval_s=6.0)), cruise).keyframes
    assert solve_batch(keyframes).converged


@pytest.mark.parametrize("number", [4, 14])
def test_a_spin_is_solved_without_phase(number):
    """1.2 and 4.6 turns a second; before, errors squared were 179 and 25."""
    flight = flights(30, 77)[number]
    estimate = Batch()(flight)
    assert estimate.converged
    assert not any(loss.what == "velocity" for loss in estimate.losses)
    assert 0.5 < nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 4.5


@pytest.fixture
def unturned(monkeypatch):
    """A spin whose own rotation nobody tells: no search finds attitudes that explain it."""
    monkeypatch.setattr(vector_starts, "own_rotation", lambda _: None)
    return flights(5, 77)[4]


def test_a_wrong_minimum_does_not_look_like_a_flight(unturned):
    estimate = Batch()(unturned)
    assert not estimate.converged
    assert estimate.unobservable == ("turn about the specific force",)


def test_a_window_is_not_linearised_at_a_wrong_minimum(unturned):
    text = "attitude: the turn about the specific force is left open: .* explains the measurements"
    with pytest.raises(NoSolutionError, match=text):
        Smoother()(unturned)


def test_a_minimum_counts_where_it_explains_what_was_measured(flight):
    """The very same search, the noise stated three times too small."""
    fixes = flight.fixes
    loud = dataclasses.replace(
        flight, fixes=dataclasses.replace(fixes, velocity_sigma_mps=fixes.velocity_sigma_mps / 3)
    )
    for one, explained in ((flight, True), (loud, False)):
        collected = collected_for(Batch(), one)
        found = blind.fitting(collected, solve_batch)(collected.keyframes)
        assert found.converged is explained


@pytest.mark.parametrize("every", [20, 30, 60])
def test_gravity_now_and_then_tells_how_far_from_nose_first_a_body_flies(flight, every):
    """Once in two to six seconds; before, squares of errors were 91 to 136."""
    estimate = Batch(gravity=TrueGravity(every=every))(flight)
    assert estimate.converged
    assert 0.5 < nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 6


@pytest.mark.parametrize("method", [Batch, Smoother])
def test_one_antenna_tells_the_attitude_of_two_turns_a_second(method):
    """Its accelerometer is off the axis and feels 3 m/s2 of that."""
    spin = msgspec.structs.replace(consistency.cases()["spin2hz"], duration_s=20.0)
    flight = simulate(spin, np.random.default_rng(1))
    alone = dataclasses.replace(lacking(flight, antennas=[0]), truth=flight.truth)
    estimate = method()(alone)
    assert estimate.converged
    assert (euler_rmse_deg(flight, estimate) < 1.0).all()
    assert nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 4.5


@pytest.mark.parametrize("gravity", [None, TrueGravity(every=100)], ids=["none", "too little"])
@pytest.mark.parametrize("method", [Batch, Smoother])
def test_a_gyroscope_tells_the_attitude_of_a_body_that_is_never_nose_first(method, gravity):
    """Specific forces of different times are vectors enough: no direction of travel is assumed."""
    gyroscope = consistency.cases()["gyro"]
    scenario = msgspec.structs.replace(
        gyroscope, duration_s=20.0, gnss=None, fixes=FixesTable(rate_hz=10.0)
    )
    flight = simulate(scenario, np.random.default_rng(1))
    estimate = method(gravity=gravity)(flight)
    assert estimate.converged
    # The window's first states are told by no more than its lag.
    assert (euler_rmse_deg(flight, estimate) < (0.1 if method is Batch else 1.0)).all()
    assert 0.5 < nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 6


def test_a_filter_without_phase_is_as_sure_of_its_heading_as_it_may_be(flight):
    """Linearised where it had its states by then, and by a smoother's intensity: 173, 123 and 7."""
    _, cruise, _, turn = flights(4, 77)
    for one, gravity in ((cruise, None), (turn, None), (flight, TrueGravity())):
        estimate = Forward(gravity=gravity)(one)
        assert estimate.converged
        assert 0.5 < nees(errors_rad(one, estimate), estimate.attitude_covariance_rad2) < 4.5


@pytest.mark.parametrize("method", [Smoother(), Forward()])
def test_a_window_that_loses_an_attitude_nothing_tells_says_so(flight, method, monkeypatch):
    def lost(*_, **__):
        raise NoSolutionError("position: the data do not determine it at 3.00 s")

    for solve in ("solve_window", "solve_forward"):
        monkeypatch.setattr(smoother, solve, lost)
    text = f"attitude: .* gravity directions {method.name} lost it, the batch may not: position: "
    with pytest.raises(NoSolutionError, match=text):
        method(flight)


def test_the_batch_finds_its_minimum_from_forty_degrees_off(flight):
    """Each attitude by itself: velocities follow the rotations, which are held where they lead."""
    settings = Settings(
        resolver=Batch().resolver,
        gravity=TrueGravity(),
        angular_acceleration_density=0.01,
        sub_steps=2,
        false_alarm=1e-4,
    )
    keyframes = collect(flight, settings).keyframes
    n, rng = len(keyframes.t_s), np.random.default_rng(0)
    axis = rng.standard_normal((n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    off = keyframes.R_nb @ rotations.exp(np.radians(40.0) * axis)
    right, found = (
        solve_batch(dataclasses.replace(keyframes, R_nb=R_nb)) for R_nb in (keyframes.R_nb, off)
    )
    assert found.converged
    apart = rotations.log(rotations.transpose(right.R_nb) @ found.R_nb)
    sigma = np.sqrt(np.einsum("nii->ni", right.covariance[:, :3, :3]))
    assert (np.abs(apart) < 0.1 * sigma).all()
