"""Constant errors of satellites under a turning sky: no noise of the phase, and no motion."""

from dataclasses import replace

import numpy as np

from fgnav.gnss.arc_adjustment import adjust_arcs, adjust_best
from fgnav.gnss.code_solution import code_solution
from fgnav.gnss.position_phase import position_phase
from fgnav_sim.message_errors import with_message_errors
from tests.gnss.based import antenna_n_m, flown

NAMES = ("models", "a1")
SPAN_S = 60.0


def erring(seed):
    """Return a flight whose satellites are metres off, and the variance of what that shifts."""
    flight = flown(base=None, span_s=SPAN_S, rate_hz=2.0, seed=seed)
    flight = with_message_errors(flight, np.random.default_rng(seed))
    code = code_solution(flight)
    return flight, (code.position_covariance_m2 - code.position_noise_m2).mean(axis=0)


def drift_mps(flight, positions):
    """Return the slope of a line through errors of position, (3,)."""
    error = positions.p_n_m - antenna_n_m(flight, positions.t_s)
    return np.polyfit(positions.t_s, error, 1)[0]


def test_a_constant_error_of_satellites_is_no_noise_of_the_phase_and_no_velocity():
    with_drift, without = [], []
    for seed in range(6):
        flight, common_m2 = erring(seed)
        equations = position_phase(flight, base=False)
        told = adjust_best((equations,), NAMES, common_m2)
        assert 0.8 < told.misfit < 1.3
        with_drift.append(drift_mps(flight, told.positions()))
        left = adjust_arcs(equations, NAMES)
        without.append((left.misfit, *drift_mps(flight, left.positions())))
    assert np.max(without, axis=0)[0] > 1.5
    rms = [np.sqrt(np.mean(np.square(x))) for x in (with_drift, np.array(without)[:, 1:])]
    assert rms[0] < 0.7 * rms[1]


def test_the_shift_is_known_as_well_as_stated():
    squares = []
    for seed in range(12):
        flight, common_m2 = erring(seed)
        told = adjust_best((position_phase(flight, base=False),), NAMES, common_m2)
        assert (np.linalg.eigvalsh(common_m2 - told.shift_covariance_m2) > 0).all()
        D = code_solution(flight).drift_per_s.mean(axis=0)
        slope = drift_mps(flight, told.positions())
        noise = np.diag(told.positions().noise_m2.mean(axis=0).diagonal())
        noise = noise * 12 / SPAN_S**2 / len(told.positions().t_s)
        covariance = D @ told.shift_covariance_m2 @ D.T + noise
        squares.append(slope @ np.linalg.solve(covariance, slope))
    assert 1.0 < np.mean(squares) < 5.0  # 12 of three degrees of freedom: 3 +- 0.7


def test_without_errors_of_messages_there_is_no_shift():
    assert (adjust_arcs(position_phase(flown(), base=True), NAMES).shift_covariance_m2 == 0).all()


def test_an_error_of_position_that_satellites_keep_moves_as_stated():
    """Ranges are lengthened as a shift of the antenna would in the middle of the flight."""
    flight = flown(base=None, span_s=SPAN_S, rate_hz=2.0)
    single = position_phase(flight, base=False).single
    shift_n_m = np.array([30.0, -20.0, 50.0])
    longer_m = dict(
        zip(single.satellites, -single.e_n[len(single.t_s) // 2] @ shift_n_m, strict=True)
    )
    seen = flight.observations
    further_m = np.array([np.nan_to_num(longer_m.get(name, 0.0)) for name in seen.satellites])
    moved = replace(flight, observations=replace(seen, code_m=seen.code_m + further_m))
    before, after = code_solution(flight), code_solution(moved)
    drift = np.polyfit(before.t_s, after.p_n_m - before.p_n_m, 1)[0]
    expected = before.drift_per_s[len(before.t_s) // 2] @ shift_n_m
    np.testing.assert_allclose(drift, expected, atol=0.1 * np.linalg.norm(expected))
