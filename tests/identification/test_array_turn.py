"""An array that is turned against the inertial unit, or the unit against the array."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fgnav.evaluation.scores import errors_against
from fgnav.geometry.rotations import exp
from fgnav.methods.smoother import Batch, Smoother
from fgnav.types.flight import Flight
from tests.methods.simulated import shared
from tests.robustness.drawn.dirty import dirty
from tests.robustness.drawn.flights import right_flight

TURN_RAD = np.radians([2.0, -3.0, 3.0])  # from the unit to the array


@cache
def right(kind: str) -> Flight:
    return right_flight(kind, 40)


@cache
def turned(kind: str, what: str) -> Flight:
    """Return a flight whose unit, or whose array, stands otherwise than it states."""
    flight, R_ua = right(kind), exp(TURN_RAD[None])[0]
    if what == "unit":  # what truly is along x_a is read along x_u
        return replace(flight, imu=replace(flight.imu, f_b_mps2=flight.imu.f_b_mps2 @ R_ua.T))
    antennas = tuple(
        replace(one, position_b_m=R_ua.T @ one.position_b_m) for one in flight.antennas
    )
    return replace(flight, antennas=antennas)


def nees(flight: Flight, estimate) -> float:
    return float(errors_against(flight.truth, estimate).nees.mean())


@pytest.mark.parametrize("what", ["unit", "array"])
def test_a_turn_is_said_and_sigmas_hold_whichever_is_turned(what):
    flight = turned("array", what)
    estimate = shared(Smoother(), flight)
    (said,) = (note for note in estimate.notes if "turned against each other" in note)
    assert "by 4.7 deg" in said
    assert "nothing tells which of them" in said
    (turn,) = estimate.constants
    off = turn.value - TURN_RAD
    assert off @ np.linalg.solve(turn.covariance, off) < 22.1  # of three, 6e-5
    angle = np.linalg.norm(TURN_RAD)
    along = TURN_RAD / angle
    variance = along @ estimate.attitude_covariance_rad2.mean(axis=0) @ along
    np.testing.assert_allclose(variance, angle**2 / 2, rtol=0.1)
    assert nees(flight, estimate) < 10.0  # was 3,600 of an array turned by five degrees


def test_attitudes_are_of_the_antennas_axes_where_nothing_tells():
    flight = turned("array", "unit")
    errors = errors_against(flight.truth, shared(Batch(), flight))
    assert np.sqrt((errors.tangent_b_rad**2).sum(axis=1).mean()) < np.radians(0.3)


@pytest.mark.parametrize(("what", "axes"), [("unit", "antennas'"), ("array", "inertial unit's")])
def test_a_detector_tells_which_is_turned(what, axes):
    flight = turned("seeker", what)
    estimate = Smoother()(flight)
    assert any(f"attitudes are of the {axes} axes" in note for note in estimate.notes)
    errors = errors_against(flight.truth, estimate)
    assert np.sqrt((errors.tangent_b_rad**2).sum(axis=1).mean()) < np.radians(0.3)
    assert errors.nees.mean() < 10.0


@pytest.mark.parametrize("kind", ["array", "seeker"])
def test_nothing_is_said_of_right_flights(kind):
    assert Smoother().prepare(right(kind)).axes is None


def test_no_clock_stands_for_what_is_left_of_a_turn():
    """Of ten degrees, by the chain's .4 that were left: 12 ms, NEES 17.8 (943000011)."""
    flight = right_flight("seeker", 943000011 // 12)
    turned = dirty(flight, 943000011)[0]
    estimate = Smoother()(turned)
    assert not any("clock" in note for note in estimate.notes)
    assert nees(turned, estimate) < 4.0
