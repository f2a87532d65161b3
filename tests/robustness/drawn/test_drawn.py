"""Drawn flights: right ones have no verdict, and hardly any fault is silent and wrong.

How often is counted by the benchmark ``yardstick``, of more flights and all states.
"""

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.methods.smoother import Batch
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.dirty import FAULTS, dirty
from tests.robustness.drawn.flights import KINDS, right_flight

RIGHT_SEED, FAULT_SEED = 620_000_000, 630_000_000
RIGHT, FAULTS_EACH = 3, 3
WRONG_NEES = 16.3  # of 3: one in a thousand errors that last all along a flight


def attitude_nees(right, estimate):
    return nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2)


@pytest.fixture(scope="module", params=KINDS)
def right(request):
    return right_flight(request.param, 1)


def test_a_fault_changes_a_flight_and_says_how(right):
    texts = [dirty(right, seed)[1] for seed in range(60)]
    assert len(set(texts)) > 0.9 * len(texts)  # some are drawn alike
    assert dirty(right, 7)[1] == dirty(right, 7)[1]


def test_every_fault_can_be_drawn(right):
    rng = np.random.default_rng(0)
    for sensor, faults in FAULTS.items():
        is_there = {"gyroscope": "imu", "array": "observations"}.get(sensor, sensor)
        if getattr(right, is_there) in (None, ()) or (
            sensor == "array" and len(right.antennas) < 2
        ):
            continue
        if sensor == "gyroscope" and right.imu.w_b_radps is None:
            continue
        for fault in faults:
            flight, text = fault(right, rng)
            assert flight is not right
            assert text


@pytest.mark.parametrize("kind", KINDS)
def test_right_flights_have_no_verdict(kind):
    for seed in range(RIGHT_SEED, RIGHT_SEED + RIGHT):
        flight = right_flight(kind, seed)
        estimate = Batch()(flight)
        assert estimate.verdicts == ()
        assert attitude_nees(flight, estimate) < WRONG_NEES


@pytest.mark.parametrize("kind", KINDS)
def test_hardly_any_fault_is_silent_and_its_attitude_wrong(kind):
    """One of three at most: those within what real noise is allowed to be show in nothing."""
    flight, silent = right_flight(kind, RIGHT_SEED), []
    for seed in range(FAULT_SEED, FAULT_SEED + FAULTS_EACH):
        wrong, fault = dirty(flight, seed)
        try:
            estimate = Batch()(wrong)
        except NoSolutionError:
            continue
        if (
            estimate.consistent
            and estimate.converged
            and attitude_nees(flight, estimate) > WRONG_NEES
        ):
            silent.append(fault)
    assert len(silent) <= 1, silent
