import msgspec
import numpy as np
import pytest

from fgnav.gnss.difference import double_differences
from fgnav.gnss.single_point.solution import code_solution
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.methods.simulated import SCENARIOS

FLIGHTS = 40


def flown(seed, *, message_errors, span_s=2.0):
    scenario = load_scenario(SCENARIOS / "demo.toml")
    gnss = msgspec.structs.replace(scenario.gnss, message_errors=message_errors, rate_hz=1.0)
    scenario = msgspec.structs.replace(scenario, gnss=gnss, duration_s=span_s, imu=None)
    return simulate(scenario, np.random.default_rng(seed))


def test_positions_err_as_their_covariance_says():
    """Mean of normalised squares over flights; each has one draw of all its satellites."""
    squares = []
    for seed in range(FLIGHTS):
        flight = flown(seed, message_errors=True)
        code = code_solution(flight)
        row = np.searchsorted(flight.truth.t_s, code.t_s[0] - 1e-6)
        error_m = code.p_n_m[0] - flight.truth.p_n_m[row]
        squares.append(error_m @ np.linalg.solve(code.position_covariance_m2[0], error_m))
    # Chi-square of 3 degrees over 40 flights: 99.9 % lie between 1.9 and 4.4.
    assert 1.9 < np.mean(squares) < 4.4


def test_differences_of_the_array_are_left_as_they_are():
    without, with_errors = (flown(1, message_errors=flag) for flag in (False, True))
    assert np.abs(with_errors.observations.code_m - without.observations.code_m)[0, 0, 0] > 1e-3
    plain, erring = double_differences(without), double_differences(with_errors)
    assert erring.code_m == pytest.approx(plain.code_m, abs=1e-4, nan_ok=True)
    cycles = (erring.phase_m - plain.phase_m) / plain.wavelength_m
    assert np.nan_to_num(cycles) == pytest.approx(np.rint(np.nan_to_num(cycles)), abs=1e-3)


def test_other_noise_stays_as_it_was():
    without, with_errors = (flown(1, message_errors=flag) for flag in (False, True))
    longer_m = with_errors.observations.code_m - without.observations.code_m
    spread_m = np.nanmax(longer_m, axis=1) - np.nanmin(longer_m, axis=1)
    assert np.nanmax(spread_m) < 1e-6


def test_errors_move_as_the_flight_states():
    """Of 40 flights of 20 s, the change over 10 s: a rate and a walk of 10 s."""
    changes_m = []
    for seed in range(FLIGHTS):
        without, erring = (flown(seed, message_errors=flag, span_s=20.0) for flag in (False, True))
        longer_m = (erring.observations.phase_cycles - without.observations.phase_cycles)[:, 0]
        changes_m.append((longer_m[-1] - longer_m[-11]) * 0.19029)
    noise = erring.gnss_noise
    variance_m2 = (10 * noise.satellite_error_rate_mps) ** 2
    variance_m2 += 10 * noise.satellite_error_walk_m_per_sqrt_s**2
    changes_m = np.concatenate(changes_m)
    # Some 360 draws: 99.9 % of their mean squares lie within a quarter of the variance.
    assert np.nanmean(changes_m**2) == pytest.approx(variance_m2, rel=0.25)
