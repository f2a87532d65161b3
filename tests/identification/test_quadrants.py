"""A detector one of whose quadrants has another gain."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.frontend.problem import build_problem
from fgnav.identification.lasting.quadrants import QUADRANTS, in_balance, quadrant_error
from fgnav.identification.likelihood.thinned import thinned
from fgnav.solve.chain import solve_batch
from tests.identification.identified import SETTINGS, estimate_by, found_in
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.flights import right_flight


def gained(flight, gains):
    return replace(flight, seeker=replace(flight.seeker, currents=flight.seeker.currents * gains))


@pytest.mark.parametrize("gains", [(1.5, 1.0, 1.0, 1.0), (1.0, 1.0, 1.0, 1.4)])
def test_a_quadrant_of_another_gain_is_told_and_taken_out(gains):
    """It was noise of the accelerometer and a boresight."""
    right = right_flight("seeker", 9360004)
    flight = gained(right, np.array(gains))
    found = found_in(flight)
    assert found.cause.kind == QUADRANTS
    error = found.cause.error
    off = error.off - np.log([gains[3], gains[0]])
    assert off @ np.linalg.solve(error.covariance, off) < 16.0
    assert found.notes[0].startswith("The detector's quadrants have unlike gains")
    estimate = estimate_by(found, flight)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 6.0


def test_a_quadrant_that_changes_early_on_is_told_with_its_time():
    """Throughout it left more than chance, and a unit 36 times as loud explained it."""
    right = right_flight("seeker", 9360004)
    late = right.seeker.t_s >= 2.45
    flight = gained(right, np.where(late[:, None], [0.8, 1.0, 1.0, 1.0], 1.0))
    found = found_in(flight)
    assert found.cause.kind == QUADRANTS
    assert found.cause.error.from_s == pytest.approx(2.45, abs=0.06)
    assert found.cause.error.until_s == np.inf
    assert "unlike gains from 2.4 s on" in found.notes[0] or "from 2.5 s on" in found.notes[0]
    estimate = estimate_by(found, flight)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 6.0


def test_right_quadrants_gain_nothing():
    right = right_flight("seeker", 9360009)
    problem = thinned(build_problem(right, SETTINGS).problem)
    stated = solve_batch(problem)
    error = quadrant_error(problem, stated, right.seeker)
    assert error.nats < 0.0
    assert (np.abs(error.off) < 4 * np.sqrt(np.diag(error.covariance))).all()


def test_currents_put_right_are_of_like_gains():
    seeker = right_flight("seeker", 9360004).seeker
    off = np.array([0.2, -0.1])
    right = in_balance(seeker, off, (-np.inf, np.inf)).currents
    np.testing.assert_allclose(
        np.log(right[:, 3] / right[:, 1]) + 0.2,
        np.log(seeker.currents[:, 3] / seeker.currents[:, 1]),
    )
    np.testing.assert_allclose(
        np.log(right[:, 0] / right[:, 2]) - 0.1,
        np.log(seeker.currents[:, 0] / seeker.currents[:, 2]),
    )
