"""The unit's clock beside phases of arcs: found where it is off, and not where it is right."""

import re
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from fgnav.frontend.problem import build_problem
from fgnav.identification.likelihood.beside_phases import is_misfit
from fgnav.identification.likelihood.record_clock import clock_off, record_clock
from fgnav.identification.tested_constants import SQUARES_OF_TWO
from fgnav.identification.track.tags import middle_of_tags_s
from fgnav.methods.smoother import Smoother
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.flights import SCENARIOS, right_flight

SETTINGS = Smoother().preparation
STATED = np.zeros(2)


def problem_of(flight):
    return build_problem(flight, SETTINGS).problem


def clock_of(flight):
    return record_clock(problem_of(flight), middle_of_tags_s(flight.imu), STATED)


def fast(flight, ppm):
    imu = flight.imu
    since_s = imu.t_s - imu.t_s[0]
    return replace(flight, imu=replace(imu, t_s=imu.t_s + ppm * 1e-6 * since_s))


@pytest.mark.parametrize("kind", ["array", "raw", "seeker"])
def test_a_clock_that_is_right_is_within_chance(kind):
    flight = right_flight(kind, 731)
    clock = clock_of(flight)
    assert clock.squares < SQUARES_OF_TWO / 2
    assert not is_misfit(problem_of(flight), clock.cost)


@pytest.mark.parametrize(("kind", "ppm"), [("array", 2000.0), ("raw", -1500.0), ("seeker", 1500.0)])
def test_a_clock_that_runs_fast_or_slow_is_put_right(kind, ppm):
    """Doppler and attitudes alone had it within two sigmas: nothing was said."""
    right = right_flight(kind, 731)
    flight = fast(right, ppm)
    half_s = np.ptp(right.imu.t_s) / 2
    clock = clock_of(flight)
    off = clock.value + np.array([ppm * 1e-6 * half_s, ppm])
    assert clock.squares > SQUARES_OF_TWO
    assert off @ np.linalg.solve(clock.covariance, off) < SQUARES_OF_TWO  # a single step
    estimate = Smoother()(flight)
    assert any("clock disagrees with GNSS" in note for note in estimate.notes)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 6.0


@pytest.mark.parametrize("off_s", [-0.1, 0.5])
def test_noise_of_samples_is_no_information_about_a_clock(off_s):
    """Straight flight, whose turns are slow beside its gyroscope's noise: NEES 648 and 15,600.

    Differences of samples, noise and all, knew the clock to 1.4 ms, and that it was right.
    """
    scenario = load_scenario(SCENARIOS / "surroundings.toml")
    right = simulate(msgspec.structs.replace(scenario, duration_s=30.0), np.random.default_rng(7))
    flight = replace(right, imu=replace(right.imu, t_s=right.imu.t_s - off_s))
    estimate = Smoother()(flight)
    said = next(note for note in estimate.notes if "clock disagrees with GNSS" in note)
    value_s, sigma_s = map(float, re.search(r"([+-][.\d]+) ± ([.\d]+) s", said).groups())
    assert abs(value_s - off_s) < 3.0 * sigma_s
    assert 5e-3 < sigma_s < 3e-2
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 6.0


def test_a_problem_that_estimates_its_clock_is_not_asked_again():
    flight = right_flight("array", 731)
    problem = build_problem(flight, Smoother(estimate=("clock",)).preparation).problem
    assert record_clock(problem, middle_of_tags_s(flight.imu), STATED) is None


def test_a_drift_of_the_accelerometer_is_no_clock():
    """Alone the clock was 19 sigmas off, and taken for that attitudes had an NEES of 160."""
    right = right_flight("raw", 731)
    imu = right.imu
    drift_b_mps2 = np.outer((imu.t_s - imu.t_s[0]) / np.ptp(imu.t_s), [0.4, 0.0, 0.0])
    drifting = replace(right, imu=replace(imu, f_b_mps2=imu.f_b_mps2 + drift_b_mps2))
    assert clock_of(drifting).squares > SQUARES_OF_TWO
    problem = build_problem(drifting, SETTINGS).problem
    assert clock_off(problem, middle_of_tags_s(drifting.imu), STATED) is None
