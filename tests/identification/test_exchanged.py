"""Antennas that are exchanged for a while: found by their phases, and exchanged back."""

import numpy as np

from fgnav.frontend.problem import build_problem
from fgnav.identification.array.exchanged import exchange_of
from fgnav.methods.smoother import Smoother
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.dirty import dirty
from tests.robustness.drawn.flights import KINDS, right_flight

SETTINGS = Smoother().preparation
# Exchanged with the reference till the end, or two others for a while: refused, both, if believed.
TILL_THE_END, FOR_A_WHILE = 99200046, 99200279
LOUD_FROM_6_S = 99200583  # phases' noise .16 cycles


def of_seed(seed):
    right = right_flight(KINDS[seed // 12 % len(KINDS)], seed // 12)
    return right, dirty(right, seed)[0]


def test_exchanged_antennas_are_exchanged_back():
    right, flight = of_seed(TILL_THE_END)
    found = exchange_of(build_problem(flight, SETTINGS))
    assert found is not None
    assert found.pair == (0, 2)
    np.testing.assert_allclose((found.from_s, found.until_s), (4.4, 11.8), atol=1e-9)
    seen = found.undone(flight).observations
    np.testing.assert_array_equal(seen.phase_cycles, right.observations.phase_cycles)
    np.testing.assert_array_equal(seen.lock_flags, right.observations.lock_flags)


def test_attitudes_are_those_of_the_right_flight_and_the_exchange_is_said():
    _, flight = of_seed(FOR_A_WHILE)
    estimate = Smoother()(flight)
    (sentence,) = (note for note in estimate.notes if "exchanged" in note)
    assert sentence.startswith("Antennas a2 and a3 are exchanged from 2.8 to 7.4 s")
    assert nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 3.5  # 1.92


def test_neither_a_right_flight_nor_loud_phases_are_an_exchange():
    right, loud = of_seed(LOUD_FROM_6_S)
    for flight in (right, loud):
        assert exchange_of(build_problem(flight, SETTINGS)) is None
