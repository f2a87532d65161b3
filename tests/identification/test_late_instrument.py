"""A magnetometer that is late, or a clock of the unit that looks like it."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.frontend.problem import build_problem
from fgnav.geometry.rotations import exp
from fgnav.graph.types.constants import Constants, flight_constant
from fgnav.graph.types.states import POSITION, ROTATION, VELOCITY
from fgnav.identification.lasting.averaging import possible, rivals_of
from fgnav.identification.lasting.late_instrument import Late
from fgnav.identification.track.windows import EXCLUDED
from tests.identification.identified import SETTINGS, estimate_by, found_in
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.flights import right_flight

MAGNETIC = "late magnetic field"
SIGMAS = 4.0


def late(flight, by_s):
    field = flight.magnetometer
    return replace(flight, magnetometer=replace(field, t_s=field.t_s + by_s))


def attitude_nees(right, estimate):
    return nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2)


@pytest.mark.parametrize("by_s", [0.3, -0.4])
def test_a_magnetometer_that_is_late_is_taken_early(by_s):
    right = right_flight("instruments", 7002)
    flight = late(right, by_s)
    found = found_in(flight)
    assert found.cause.kind == MAGNETIC
    error = found.cause.error
    assert abs(error.off[0] - by_s) < SIGMAS * error.covariance[0, 0] ** 0.5
    assert found.notes[0].startswith("The magnetometer's samples are late")
    assert attitude_nees(right, estimate_by(found, flight)) < 4.0


@pytest.mark.parametrize(("number", "by_s"), [(7002, 0.06), (7005, -0.05)])
def test_a_clock_of_an_instrument_may_be_set_while_it_runs(number, by_s):
    """Seed 974000253, such a flight, had an attitude NEES of 17.9."""
    right = right_flight("instruments", number)
    field = right.magnetometer
    t_s = field.t_s + by_s * (field.t_s >= 7.4)
    flight = replace(right, magnetometer=replace(field, t_s=t_s))
    found = found_in(flight)
    error = found.cause.error
    assert found.cause.kind == MAGNETIC
    assert abs(error.from_s - 7.35 - by_s / 2) < 1e-9
    assert abs(error.off[0] - by_s) < SIGMAS * error.covariance[0, 0] ** 0.5
    assert "s from 7." in found.notes[0]
    assert attitude_nees(right, estimate_by(found, flight)) < 4.0


def test_a_lost_sample_is_no_clock_that_was_set():
    """From it on the tags, taken off, would come before those of the samples before."""
    right = late(right_flight("instruments", 7002), 0.3)
    field = right.magnetometer
    others = np.arange(len(field.t_s)) != 70
    series = {name: getattr(field, name)[others] for name in ("t_s", "field_b_ut")}
    found = found_in(replace(right, magnetometer=replace(field, **series)))
    assert (found.cause.kind, found.cause.error.from_s) == (MAGNETIC, -np.inf)


def test_a_detector_that_is_late_is_no_other_landmark():
    """Its rates are those of the states, bent until they have the delay."""
    right = right_flight("seeker", 9360004)
    seeker = right.seeker
    flight = replace(right, seeker=replace(seeker, t_s=seeker.t_s + 0.3))
    found = found_in(flight)
    assert found.cause.kind == "late line of sight"
    assert abs(found.cause.error.off[0] - 0.3) < 0.01
    assert attitude_nees(right, estimate_by(found, flight)) < 6.0


@pytest.mark.parametrize("by_s", [0.02, 0.05])
def test_a_clock_of_the_unit_is_no_late_magnetometer(by_s):
    right = right_flight("instruments", 7003)
    flight = replace(right, imu=replace(right.imu, t_s=right.imu.t_s + by_s))
    found = found_in(flight)
    assert (found.cause.kind, found.cause.rivals) == ("clock", None)
    assert attitude_nees(right, estimate_by(found, flight)) < 4.0  # 2.0 2.1


def test_where_a_declination_is_as_likely_sigmas_hold_both():
    right = right_flight("instruments", 7005)
    flight = late(right, 0.05)
    found = found_in(flight)
    assert {found.cause.kind, *found.cause.rivals.kinds} == {MAGNETIC, "declination"}
    assert found.notes[1].startswith("As likely instead")
    assert attitude_nees(right, estimate_by(found, flight)) < 4.0  # 1.2


@pytest.mark.parametrize("name", ["magnetic field", "barometric height"])
def test_derivatives_are_those_of_residuals(name):
    problem = build_problem(right_flight("instruments", 7002), SETTINGS).problem
    part = flight_constant("late", ("delay",), "s", 0.3)
    constants = Constants((*problem.constants.parts, part))
    (inner,) = (one for one in problem.measurements if one.name == name)
    k, rng = len(inner.row), np.random.default_rng(1)
    one = Late(
        measurement=inner,
        back=exp(0.2 * rng.normal(size=(k, 3))),
        w_b_radps=rng.normal(size=(k, 3)),
        is_late=np.arange(k) < 5,
        by_s=0.2,
        column=constants.width - 1,
        constants=constants,
    )
    rows = np.array([3, 8])
    at = problem.start.at(one.row[rows])
    at = at._replace(v_n_mps=at.v_n_mps + 1.0, constants=np.append(at.constants, 0.25))
    linear, step = one.linearise(at, rows), 1e-6
    close = {"rtol": 1e-3, "atol": 1e-2}
    further = at._replace(
        constants=at.constants + step * (np.arange(constants.width) == one.column)
    )
    by_d = (one.linearise(further, rows).value - linear.value) / step
    np.testing.assert_allclose(linear.shared[:, :, -1], by_d, **close)
    for i in (*range(9)[ROTATION], *range(9)[POSITION], *range(9)[VELOCITY]):
        steps = np.zeros((len(rows), at.width))
        steps[:, i] = step
        moved = one.linearise(at.moved(steps, np.zeros(constants.width)), rows)
        by_state = (moved.value - linear.value) / step
        np.testing.assert_allclose(linear.state[:, :, i], by_state, **close)


class Cause:
    attitude_rad2 = 1e-4 * np.eye(3)[None]

    def __init__(self, kind, nats, turn_rad):
        self.kind, self.nats = kind, nats
        self.R_nb = exp(np.array([[turn_rad, 0.0, 0.0]]))


def test_attitudes_hold_what_is_as_likely():
    best, t_s = Cause("one", 100.0, 0.0), np.zeros(1)
    near, far = Cause("two", 100.0 - EXCLUDED / 2, 0.1), Cause("three", 99.0 - EXCLUDED, 0.3)
    assert rivals_of(best, [far], t_s) is None
    rivals = rivals_of(best, [near, far], t_s)
    assert rivals.kinds == ("two",)
    np.testing.assert_allclose(rivals.doubt.covariance_rad2[0], np.diag([0.1**2 / 2, 0.0, 0.0]))


def test_attitudes_hold_what_is_possible():
    """As likely as none and what is sought elsewhere: a third of its second moment."""
    doubted = possible([Cause("one", 1e-9, 0.1)], [0.0], np.zeros(1), np.eye(3)[None])
    assert doubted.kinds == ("one",)
    expected = (np.diag([0.1**2, 0.0, 0.0]) + 1e-4 * np.eye(3)) / 3
    np.testing.assert_allclose(doubted.doubt.covariance_rad2[0], expected, rtol=1e-6, atol=1e-12)
