"""Noises that a record leaves open count by the mean square of their posterior."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fgnav.frontend.problem import build_problem
from fgnav.identification.from_past import look
from fgnav.identification.noise.doubted import is_doubted, mean_squares
from fgnav.methods.smoother import Forward
from tests.identification.test_from_past import every_second

SIGMA = np.log(5.0)  # of white noise that nobody stated


def gyroscope_by(log_likelihood):
    """What a chain of one open noise says, by the logarithm of the factor on it."""
    flight = SimpleNamespace(
        names=("accelerometer", "gyroscope"),
        likelihood_at=lambda factors: log_likelihood(np.log(factors["gyroscope"])),
    )
    return mean_squares(flight, {"accelerometer": 30.0})


@pytest.mark.parametrize(("theta", "sigma"), [(0.0, 1.0), (1.0, 0.8), (2.0, 0.5)])
def test_a_noise_known_to_a_factor_counts_by_its_mean_square(theta, sigma):
    """Prior and likelihood are log-normal: so is the posterior, whose moments are known."""
    factors = gyroscope_by(lambda at: -(((at - theta) / sigma) ** 2) / 2)
    variance = 1 / (SIGMA**-2 + sigma**-2)
    f = np.exp(theta * variance / sigma**2 + variance)
    assert factors == {"gyroscope": pytest.approx(f, rel=0.01)}


def test_a_noise_that_nothing_tells_counts_as_its_prior_up_to_three_sigmas():
    theta = np.linspace(-3, 3, 100_001)
    density = np.exp(-(theta**2) / 2)
    f = np.sqrt((density * np.exp(2 * SIGMA * theta)).sum() / density.sum())
    assert gyroscope_by(lambda at: 0.0 * at) == {"gyroscope": pytest.approx(f, rel=0.02)}


@pytest.mark.parametrize(
    ("factors", "unstated", "doubted"),
    [
        ({"accelerometer": 20.0}, (), True),
        ({"gyroscope": 3.0, "velocity": 2.0}, (), True),
        ({"accelerometer": 0.4}, (), False),
        ({"velocity": 5.0, "gyroscope bias": 30.0}, (), False),
        ({"accelerometer": 20.0}, ("accelerometer",), False),
    ],
)
def test_a_sheet_is_doubted_where_white_noise_is_louder_than_it_states(factors, unstated, doubted):
    assert is_doubted(factors, unstated) == doubted


def test_a_loud_accelerometer_leaves_its_gyroscope_open_as_far_as_the_record_does():
    """Thirty times as loud as stated, by a dozen fixes: these see ten times its gyroscope's noise.

    The problem that goes on has the noise found and the doubt of the other, and its clock open.
    """
    flight, rng = every_second(20_011, position_noise_m=0.02, velocity_noise_mps=0.02)
    imu, step_s = flight.imu, np.diff(flight.imu.t_s).mean()
    noise = 30 * imu.accelerometer_noise_mps2_per_sqrt_hz / np.sqrt(step_s)
    f_b_mps2 = imu.f_b_mps2 + rng.normal(0.0, noise, imu.f_b_mps2.shape)
    loud = replace(flight, imu=replace(imu, f_b_mps2=f_b_mps2))
    settings = Forward().preparation
    by_then = look(loud, settings, 13.0, build_problem)
    assert set(by_then.doubted) == {"gyroscope", "accelerometer bias", "gyroscope bias"}
    f = by_then.doubted["gyroscope"]
    assert 1.5 < f < 10.0
    prepared = by_then.prepared(loud, settings, build_problem)
    stated = imu.gyroscope_noise_radps_per_sqrt_hz
    np.testing.assert_allclose(prepared.problem.motion.gyroscope_noise, (f * stated) ** 2)
    assert any("leaves open how loud" in note for note in prepared.notes)
    parts = {one.name: one for one in prepared.problem.constants.parts}
    # .3 s, less what the determinant of the states tells of a clock.
    assert 0.05 < np.sqrt(parts["clock offset"].covariance[0, 0]) <= 0.3
