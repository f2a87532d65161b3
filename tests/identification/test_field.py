"""A magnetometer that is turned or drifts, and a field stated with another declination."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from fgnav.frontend.problem import build_problem
from fgnav.geometry.rotations import exp
from fgnav.graph.types.constants import Constants, flight_constant
from fgnav.graph.types.states import ROTATION
from fgnav.identification.lasting.error import LastingError
from fgnav.identification.lasting.field import DECLINATION, DRIFT, MAGNETOMETER, Declined
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.identification.identified import SETTINGS, estimate_by, found_in
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.dirty import dirty
from tests.robustness.drawn.flights import SCENARIOS, right_flight

SIGMAS = 4.0
TURN_RAD = np.radians([-1.8, 1.4, 2.0])  # 3 degrees


def with_field(flight, **changes):
    return replace(flight, magnetometer=replace(flight.magnetometer, **changes))


def declined(flight, by_rad):
    """Return a flight that states the field of another declination."""
    R = exp(np.array([[0.0, 0.0, by_rad]]))[0]
    return with_field(flight, field_n_ut=R @ flight.magnetometer.field_n_ut)


def attitude_nees(right, estimate):
    return nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2)


@pytest.mark.parametrize("times", [1.0, 10.0])
def test_a_turned_magnetometer_is_no_turned_gyroscope(times):
    right = right_flight("instruments", 7002)
    samples = right.magnetometer.field_b_ut @ exp(times * TURN_RAD[None])[0]
    flight = with_field(right, field_b_ut=samples)
    found = found_in(flight)
    cause = found.cause
    assert cause.error.kind == MAGNETOMETER
    error = cause.error.off - times * TURN_RAD
    assert error @ np.linalg.solve(cause.error.covariance, error) < SIGMAS**2
    estimate = estimate_by(found, flight)
    assert any(note.startswith("The magnetometer's axes are turned") for note in estimate.notes)
    assert attitude_nees(right, estimate) < 3.0  # 1.6


def test_a_turn_from_which_no_step_leads_is_sought_where_its_score_leads():
    """Beside phases of one antenna it was a clock .26 s off: attitude NEES 630, now 1.7."""
    scenario = msgspec.structs.replace(
        load_scenario(SCENARIOS / "surroundings.toml"), duration_s=30.0
    )
    right = simulate(scenario, np.random.default_rng(4242))
    turn_rad = np.radians([0.0, 0.0, 10.0])
    flight = with_field(right, field_b_ut=right.magnetometer.field_b_ut @ exp(turn_rad[None])[0])
    error = found_in(flight).cause.error
    assert error.kind == MAGNETOMETER
    off = error.off - turn_rad
    assert off @ np.linalg.solve(error.covariance, off) < SIGMAS**2


def test_a_drawn_one_was_the_gyroscope():
    """Seed 910000172, which showed it: attitude NEES 139, by 41 nats; as it is by 85."""
    right = right_flight("instruments", 910000172 // 12)
    flight, _ = dirty(right, 910000172)
    found = found_in(flight)
    assert found.cause.error.kind == MAGNETOMETER
    assert attitude_nees(right, estimate_by(found, flight)) < 10.0  # 6.8


@pytest.mark.parametrize(("number", "by_deg"), [(7003, 5.0), (7005, 5.0), (7007, 60.0)])
def test_a_declination_that_is_off_is_no_turned_accelerometer(number, by_deg):
    """Of five degrees: attitude NEES 153 and 117."""
    right = right_flight("instruments", number)
    flight = declined(right, np.radians(by_deg))
    found = found_in(flight)
    cause = found.cause
    assert cause.error.kind == DECLINATION
    assert (
        abs(cause.error.off[0] + np.radians(by_deg)) < SIGMAS * cause.error.covariance[0, 0] ** 0.5
    )
    estimate = estimate_by(found, flight)
    assert any(note.startswith("The magnetic field's declination") for note in estimate.notes)
    assert attitude_nees(right, estimate) < 4.0  # 2.0, 1.3, 1.1


@pytest.mark.parametrize("number", [8601, 8604])
def test_a_hard_iron_that_drifts_is_taken_out(number):
    """Attitude NEES 23 and 128 of 3, as it was drawn."""
    right, rates = right_flight("instruments", number), np.array([0.1, 0.5, 0.0])  # uT/s
    since_s = right.magnetometer.t_s - right.magnetometer.t_s[0]
    flight = with_field(right, field_b_ut=right.magnetometer.field_b_ut + since_s[:, None] * rates)
    found = found_in(flight)
    error = found.cause.error
    assert error.kind == DRIFT
    off = error.off - rates
    assert off @ np.linalg.solve(error.covariance, off) < SIGMAS**2
    estimate = estimate_by(found, flight)
    assert any(note.startswith("The magnetometer's hard iron drifts") for note in estimate.notes)
    assert attitude_nees(right, estimate) < 6.0


def test_a_declination_s_derivative_is_that_of_residuals():
    problem = build_problem(right_flight("instruments", 7002), SETTINGS).problem
    part = flight_constant(DECLINATION, ("east",), "rad", 0.2)
    constants = Constants((*problem.constants.parts, part))
    (inner,) = (one for one in problem.measurements if one.name == "magnetic field")
    one = Declined(measurement=inner, column=constants.width - 1, constants=constants)
    rows = np.array([3, 8])
    at = problem.start.at(one.row[rows])

    def at_rad(d, turn_rad=(0.0, 0.0, 0.0)):
        R_nb = at.R_nb @ exp(np.array([turn_rad]))
        return at._replace(constants=np.append(at.constants, d), R_nb=R_nb)

    linear, step = one.linearise(at_rad(0.3), rows), 1e-6
    by_d = (one.linearise(at_rad(0.3 + step), rows).value - linear.value) / step
    np.testing.assert_allclose(linear.shared[:, :, -1], by_d, rtol=1e-3, atol=1e-2)
    for i in range(3):
        turned = one.linearise(at_rad(0.3, step * np.eye(3)[i]), rows)
        by_turn = (turned.value - linear.value) / step
        np.testing.assert_allclose(
            linear.state[:, :, ROTATION][:, :, i], by_turn, rtol=1e-3, atol=1e-2
        )


def test_what_is_as_likely_another_s_turn_is_in_the_sigmas():
    G, off, P = np.zeros((1, 3, 3)), np.array([0.1, 0.0, 0.0]), 1e-4 * np.eye(3)
    error = LastingError(MAGNETOMETER, off, P, np.zeros(1), G, 100.0, 0.0)
    expected = 0.5 * (P + np.outer(off, off))
    np.testing.assert_allclose(error.doubt(0.5).covariance_rad2[0], expected)
    np.testing.assert_allclose(error.doubt(1.0).covariance_rad2, 0.0)
