"""Attitudes of epochs without an array: by vectors known in two frames."""

import dataclasses

import msgspec
import numpy as np
import pytest

from fgnav.alignment.vector_alignment import vector_attitudes
from fgnav.geometry import rotations
from fgnav.integers.resolvers.truth import attitude_at
from fgnav_sim.motion import Sine
from fgnav_sim.scenario import FixesTable, load_scenario
from fgnav_sim.simulate import simulate
from tests.methods.simulated import SCENARIOS, nees
from tests.methods.true_gravity import TrueGravity


def swinging(span_s=20.0, **imu):
    """A body that swings by 20 degrees about all axes in a turn: never nose first."""
    change, swing = msgspec.structs.replace, Sine(amplitude_deg=20.0)
    scenario = load_scenario(SCENARIOS / "six.toml")
    motion = change(scenario.motion, roll=swing, pitch=swing, yaw=swing)
    fixes, imu = FixesTable(rate_hz=10.0), change(scenario.imu, **imu)
    scenario = change(scenario, motion=motion, duration_s=span_s, gnss=None, fixes=fixes, imu=imu)
    return simulate(scenario, np.random.default_rng(1))


@pytest.fixture(scope="module")
def flight():
    return swinging()


def errors_rad(flight, attitudes):
    R_nb, _ = attitude_at(flight.truth, attitudes.t_s)
    return rotations.log(rotations.transpose(attitudes.R_nb) @ R_nb)[attitudes.valid]


def test_gravity_and_specific_force_tell_attitudes_as_well_as_stated(flight):
    attitudes = vector_attitudes(flight, TrueGravity()(flight))
    assert attitudes.valid.mean() > 0.95
    assert not attitudes.rough
    assert attitudes.notes == ()
    error = errors_rad(flight, attitudes)
    assert 2 < nees(error, attitudes.covariance_rad2[attitudes.valid]) < 5


@pytest.mark.parametrize(
    "gravity",
    [None, TrueGravity(every=100), TrueGravity(every=40)],
    ids=["none", "too little", "too seldom"],
)
def test_without_gravity_the_velocity_is_taken_for_the_nose_with_a_note(flight, gravity):
    attitudes = vector_attitudes(flight, None if gravity is None else gravity(flight))
    assert attitudes.rough
    assert "starts with the velocity along x_b" in attitudes.notes[0]


def test_gravity_now_and_then_turns_the_others_about_the_specific_force(flight):
    """A body that is not nose first is off by that turn alone, and it goes along slowly."""
    nose_first = errors_rad(flight, vector_attitudes(flight, None))
    turned = errors_rad(flight, vector_attitudes(flight, TrueGravity(every=20)(flight)))
    assert np.sqrt((turned**2).sum(axis=1).mean()) < np.sqrt((nose_first**2).sum(axis=1).mean())


def test_gravity_along_specific_force_tells_nothing_of_the_turn_about_it(flight):
    """At rest they are one vector."""
    still = np.tile(flight.fixes[0].p_n_m[0], (len(flight.fixes[0].t_s), 1))
    fixes = dataclasses.replace(flight.fixes[0], p_n_m=still, v_n_mps=0 * still)
    resting = dataclasses.replace(flight, fixes=(fixes,))
    assert vector_attitudes(resting, TrueGravity()(flight)).rough
