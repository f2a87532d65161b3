"""A vehicle on wheels that stands does not turn: the factor, and a bias that no heading hides."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.assembly.problem import build_problem
from fgnav.assembly.truncation import truncated
from fgnav.graph.factors.vehicle.resting_rate import NAME
from fgnav.methods.smoother import Forward, Smoother
from fgnav.types.vehicle import WheeledVehicle
from tests.assembly.standing import standing
from tests.methods.simulated import errors_rad, nees

STANDS_S = 25.0
EARTH_N_RADPS = np.array([5.6e-5, 0.0, -4.7e-5])


@pytest.fixture(scope="module")
def car():
    """A car that stands first; its gyroscope's bias is known to .6 degree a second."""
    flight = standing(20_020, stands_s=STANDS_S, span_s=36.0)
    return replace(flight, imu=replace(flight.imu, gyroscope_bias_radps=0.01))


def of_rates(flight, *, causal):
    method = Forward() if causal else Smoother()
    problem = build_problem(flight, method.preparation).problem
    return problem.t_s, next(one for one in problem.sensors if one.name == NAME)


@pytest.mark.parametrize("causal", [False, True])
def test_rates_are_of_seconds_at_rest_and_their_sigmas_of_the_gyroscope(car, causal):
    t_s, resting = of_rates(replace(car, vehicle=WheeledVehicle()), causal=causal)
    assert t_s[resting.row].max() < STANDS_S + 0.5
    assert len(resting.row) > 0.5 * (STANDS_S - 10.0)
    noise = car.imu.gyroscope_noise_radps_per_sqrt_hz
    np.testing.assert_allclose(resting.sigma_radps[-1], noise, rtol=0.6)
    late = resting.measured_b_radps - resting.measured_b_radps.mean(axis=0)
    assert np.sqrt((late**2).mean()) == pytest.approx(noise, rel=0.5)


def test_sigmas_of_a_filter_depend_on_nothing_later(car):
    car = replace(car, vehicle=WheeledVehicle())
    _, whole = of_rates(car, causal=True)
    _, part = of_rates(truncated(car, STANDS_S - 3.05), causal=True)
    n = len(part.row)
    assert 3 < n < len(whole.row)
    np.testing.assert_array_equal(whole.sigma_radps[:n], part.sigma_radps)
    np.testing.assert_array_equal(whole.measured_b_radps[:n], part.measured_b_radps)


@pytest.mark.parametrize(
    "method", [Forward(noise="nominal"), Smoother(noise="nominal")], ids=lambda m: m.name
)
def test_the_bias_about_the_vertical_is_known_while_nothing_tells_the_heading(car, method):
    """Without wheels it may as well turn: then only motion tells."""
    sigmas_radps = []
    for vehicle in (None, WheeledVehicle()):
        found = method(replace(car, vehicle=vehicle))
        row = np.flatnonzero(found.t_s < STANDS_S - 6.0)[-1]  # a window later hears of motion
        sigmas_radps.append(np.sqrt(found.gyroscope_bias_covariance_rad2ps2[row, 2, 2]))
    assert sigmas_radps[1] < 0.2 * sigmas_radps[0]
    assert nees(errors_rad(car, found), found.attitude_covariance_rad2) < 5.0
    assert any(one.what == NAME for one in found.consistency)
    assert not any(one.sensor == NAME for one in found.verdicts)
