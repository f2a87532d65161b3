"""Flights without carrier phase: the smoother started from vectors."""

import dataclasses
from functools import cache

import msgspec
import numpy as np
import pytest

from fgnav.alignment import vector_alignment
from fgnav.assembly.truncation import truncated
from fgnav.checks import NoSolutionError
from fgnav.geometry import rotations
from fgnav.methods.smoother import Batch, Smoother
from fgnav.solve.batch import solve_batch
from fgnav_sim.scenario import FixesTable
from fgnav_sim.simulate import simulate
from tests.alignment.test_vector_alignment import swinging
from tests.benchmarks import consistency
from tests.methods.commanded import flights
from tests.methods.simulated import errors_rad, euler_rmse_deg, nees, prepared_of, shared
from tests.methods.true_gravity import TrueGravity


@pytest.fixture(scope="module")
def flight():
    """A body that swings by 20 degrees about all axes in a turn: never nose first."""
    return swinging()


@pytest.mark.parametrize("method", [Batch, Smoother])
def test_a_flight_without_phases_is_solved_with_gravity_and_an_honest_covariance(flight, method):
    estimate = shared(method(gravity=TrueGravity()), flight)
    assert estimate.converged
    assert (euler_rmse_deg(flight, estimate) < 1.5).all()
    assert 1 < nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 4.5
    assert not any(loss.what == "velocity" for loss in estimate.unused)


@cache
def of_the_world():
    """Return flights of the networks' world."""
    return flights(15, 77)


@cache
def first_half(number):
    """Return fifteen seconds of a flight of the networks' world."""
    return truncated(of_the_world()[number], 15.0)


def test_a_heading_known_to_twenty_degrees_ends_at_its_minimum():
    """Full steps cross the valley to and fro: after a hundred they still were at it."""
    prepared = Batch(gravity=TrueGravity(every=60), noise="nominal").prepare(first_half(1))
    assert solve_batch(prepared.problem).converged


@pytest.mark.parametrize("noise", ["nominal", "estimated"])
@pytest.mark.parametrize("number", [4, 14])
def test_a_spin_is_solved_without_phase(number, noise):
    """1.2 and 4.6 turns a second."""
    flight = first_half(number)
    estimate = Batch(noise=noise)(flight)
    assert estimate.consistent
    assert estimate.converged
    assert not any(loss.what == "velocity" for loss in estimate.unused)
    assert 0.5 < nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 4.5


@pytest.fixture(scope="module")
def spin_that_nobody_tells():
    """Return a flight of 1.2 turns a second, and its problem without own rotations."""
    flight = first_half(4)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(vector_alignment, "imu_rotation", lambda _: None)
        return flight, Batch().prepare(flight)


@pytest.mark.parametrize("method", [Batch, Smoother])
def test_a_spin_that_nobody_tells_is_solved_from_where_it_seems_not_to_turn(
    spin_that_nobody_tells, method, monkeypatch
):
    """No attitude of single epochs for seconds: a long valley leads there."""
    monkeypatch.setattr(vector_alignment, "imu_rotation", lambda _: None)
    flight, prepared = spin_that_nobody_tells
    assert method().preparation == Batch().preparation
    estimate = method().estimate_prepared(flight, prepared)
    assert estimate.converged
    assert 0.5 < nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 4.5


def test_a_minimum_counts_where_it_explains_what_was_measured():
    """The very same search, the noise stated three times too small."""
    flight = first_half(2)
    fixes = flight.fixes[0]
    loud = dataclasses.replace(
        flight, fixes=(dataclasses.replace(fixes, velocity_sigma_mps=fixes.velocity_sigma_mps / 3),)
    )
    assert Batch(noise="nominal")(flight).converged
    estimate = shared(Batch(noise="nominal"), loud)
    assert not estimate.converged
    assert "turn about the specific force" in estimate.unobservable
    text = "attitude: the turn about the specific force is left open: .* explains the measurements"
    with pytest.raises(NoSolutionError, match=text):
        shared(Smoother(noise="nominal"), loud)


@pytest.mark.parametrize("every", [20, 30, 60])
def test_gravity_now_and_then_tells_how_far_from_nose_first_a_body_flies(flight, every):
    """Once in two to six seconds."""
    estimate = Batch(gravity=TrueGravity(every=every))(flight)
    assert estimate.converged
    assert 0.5 < nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 6


@cache
def beside_a_gyroscope():
    scenario = msgspec.structs.replace(
        consistency.cases()["gyro"], duration_s=20.0, gnss=None, fixes=FixesTable(rate_hz=10.0)
    )
    return simulate(scenario, np.random.default_rng(1))


@pytest.mark.parametrize("gravity", [None, TrueGravity(every=100)], ids=["none", "too little"])
@pytest.mark.parametrize("method", [Batch, Smoother])
def test_a_gyroscope_tells_the_attitude_of_a_body_that_is_never_nose_first(method, gravity):
    """Specific forces of different times are vectors enough: no direction of travel is assumed."""
    flight = beside_a_gyroscope()
    estimate = shared(method(gravity=gravity), flight)
    assert estimate.converged
    # The window's first states are known from no more than its lag.
    assert (euler_rmse_deg(flight, estimate) < (0.1 if method is Batch else 1.0)).all()
    assert 0.5 < nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 6


def test_the_batch_finds_its_minimum_from_forty_degrees_off(flight):
    """Each attitude by itself about an axis of its own."""
    problem = prepared_of(Batch(gravity=TrueGravity()), flight).problem
    n, rng = len(problem.t_s), np.random.default_rng(0)
    axis = rng.standard_normal((n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    off = problem.start.R_nb @ rotations.exp(np.radians(40.0) * axis)
    right, turned = (
        solve_batch(dataclasses.replace(problem, start=problem.start._replace(R_nb=R_nb)))
        for R_nb in (problem.start.R_nb, off)
    )
    assert turned.converged
    apart = rotations.log(rotations.transpose(right.states.R_nb) @ turned.states.R_nb)
    sigma = np.sqrt(np.einsum("nii->ni", right.covariance[:, :3, :3]))
    assert (np.abs(apart) < 0.1 * sigma).all()
