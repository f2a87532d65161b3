"""What a gyroscope knows better than fixes can see: headings that motion begins to tell, tags."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fgnav.assembly.truncation import truncated
from fgnav.evaluation.scores import errors_against
from fgnav.methods.smoother import Batch, Forward, Smoother
from tests.methods.driven import STEP_S, driven
from tests.methods.simulated import shared


def nees(flight, estimate, from_s=0.0, until_s=np.inf):
    errors = errors_against(flight.truth, estimate)
    return float(errors.nees[(errors.t_s >= from_s) & (errors.t_s < until_s)].mean())


@cache
def flown(seed, *, biased=False, until_s=np.inf, **tags):
    """Return a driven flight, the same object for the same arguments."""
    flight = truncated(driven(seed, **tags), until_s)
    if not biased:
        return flight
    f_b_mps2 = flight.imu.f_b_mps2 + np.array([0.0, 0.75, 0.0])
    return replace(flight, imu=replace(flight.imu, f_b_mps2=f_b_mps2))


def test_a_filter_waits_until_motion_has_told_the_heading():
    """Marginalised while its heading is open, level seemed told from the accelerometer's bias."""
    figures = []
    for seed in (31_001, 31_002):
        flight = flown(seed, until_s=35.0)
        estimate = shared(Forward(noise="nominal"), flight)
        figures.append(nees(flight, estimate, 15.0, 35.0))
    assert np.mean(figures) < 6.0


def test_what_leaves_a_window_knows_biases_by_what_they_did():
    """Level is three degrees off at first, the accelerometer's bias 2.5 of its sigmas."""
    figures = []
    for seed in (1, 2):
        flight = flown(seed, biased=True)
        estimate = shared(Smoother(noise="nominal"), flight)
        figures.append(nees(flight, estimate))
    assert np.mean(figures) < 6.25  # that of the bias by its prior; 27 in body axes


@pytest.mark.parametrize(
    ("method", "times"),
    [(Batch(noise="nominal"), 2.0), (Smoother(noise="nominal"), 1.2)],
)
def test_tags_within_half_a_sample_are_estimated_with_the_flight(method, times):
    """A window knows the clock by then alone, and states more doubt of attitudes anyway."""
    half = STEP_S / 2
    exact, doubted = (
        [flown(seed, late_s=half, late_sigma_s=sigma_s) for seed in (31_003, 31_004)]
        for sigma_s in (0.0, STEP_S / np.sqrt(12))
    )
    taken_as_exact = np.mean([nees(one, shared(method, one), 20.0) for one in exact])
    in_doubt = np.mean([nees(one, shared(method, one), 20.0) for one in doubted])
    assert in_doubt < 6.0
    assert taken_as_exact > times * in_doubt


def test_tags_that_are_exact_lose_nothing_by_being_doubted():
    flight = driven(31_005, late_sigma_s=STEP_S / np.sqrt(12))
    assert nees(flight, Batch(noise="nominal")(flight)) < 6.0
