import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav import rotations
from fgnav.checks import NoSolutionError
from fgnav.integers.truth import Truth, attitude_at
from fgnav.methods.smoother import Batch
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.calibration import calibrated, with_intensity
from fgnav.methods.smoother.linear import blocks_of, eliminated
from fgnav.methods.smoother.posterior_bound import posterior_bound
from fgnav.methods.smoother.smoother import collected_for
from tests.benchmarks.consistency import DRAWN_DENSITY, flown

from .flights import attitude_errors_rad, nees, turning

BATCH = Batch(resolver=Truth())
ROTATION, VELOCITY = slice(0, 3), slice(6, 9)


def errors_and_nees(case, solution):
    error = attitude_errors_rad(solution.R_nb, case.truth)
    return error, nees(error, solution.covariance[:, :3, :3]).mean()


def test_a_swing_is_stated_closer_than_a_random_walk_of_its_intensity():
    before, after = [], []
    for seed in range(2):
        case = turning(np.random.default_rng(seed), span_s=40.0)
        found = calibrated(case.keyframes, solve_batch)
        assert (np.diag(found.told)[ROTATION] < 1).all()
        assert len(found.notes) == 1
        before.append(errors_and_nees(case, found.solution)[1])
        after.append(errors_and_nees(case, found.believed(found.solution))[1])
    assert np.mean(before) < 2.5  # of 3
    assert 2.6 < np.mean(after) < 3.6


def test_a_random_walk_keeps_its_covariance():
    told = []
    for seed in range(8):
        keyframes = collected_for(BATCH, flown("drawn", seed)).keyframes
        usual = keyframes.preintegrate.angular_acceleration_density
        right = with_intensity(keyframes, DRAWN_DENSITY / usual)
        told.append(np.diag(calibrated(right, solve_batch).told)[ROTATION])
    assert_allclose(np.mean(told), 1.0, atol=0.12)  # its standard deviation: 0.06


def test_an_intensity_that_is_too_small_is_made_up_for():
    told = []
    for seed in range(4):
        keyframes = collected_for(BATCH, flown("drawn", seed)).keyframes
        usual = keyframes.preintegrate.angular_acceleration_density
        low = with_intensity(keyframes, 0.25 * DRAWN_DENSITY / usual)
        told.append(np.diag(calibrated(low, solve_batch).told)[ROTATION])
    assert (np.mean(told, axis=0) > 1.15).all()


def test_an_intensity_that_loses_nothing_by_a_third_is_cut():
    case = turning(np.random.default_rng(0), span_s=40.0)
    loud = with_intensity(case.keyframes, 100.0)
    found = calibrated(loud, solve_batch)
    before = loud.preintegrate.angular_acceleration_density
    assert_allclose(found.keyframes.preintegrate.angular_acceleration_density, before / 3)
    rms = [(errors_and_nees(case, s)[0] ** 2).mean() for s in (found.solution, solve_batch(loud))]
    assert rms[0] < rms[1]


def test_the_intensity_is_told_before_the_flight_is_solved():
    keyframes = turning(np.random.default_rng(0), span_s=40.0).keyframes
    solved = []

    def solve(tried):
        solved.append(tried)
        return solve_batch(tried)

    found = calibrated(with_intensity(keyframes, 100.0), solve)
    assert [found.keyframes] == solved


def test_an_intensity_whose_search_fails_is_not_taken():
    loud = with_intensity(turning(np.random.default_rng(0), span_s=40.0).keyframes, 100.0)
    found = calibrated(
        loud, lambda tried: dataclasses.replace(solve_batch(tried), converged=tried is loud)
    )
    assert found.keyframes is loud
    assert (np.diag(found.told)[ROTATION] < 1).all()


def test_what_is_known_worse_than_usual_keeps_the_rest_of_its_variance():
    case = turning(np.random.default_rng(0), span_s=40.0)
    found = calibrated(case.keyframes, solve_batch)
    wide = found.solution.covariance.copy()
    wide[7] *= 1000.0
    believed = found.believed(dataclasses.replace(found.solution, covariance=wide))
    share = np.diag(believed.covariance[7])[ROTATION] / np.diag(wide[7])[ROTATION]
    assert (share > 0.99).all()
    assert (np.linalg.eigvalsh(believed.covariance) > 0).all()


@pytest.mark.parametrize("what", ["gyroscope", "no array", "short"])
def test_covariances_stay_where_nothing_speaks_against_them(what):
    span_s = 4.0 if what == "short" else 8.0
    rng = np.random.default_rng(0)
    keyframes = turning(rng, span_s=span_s, gyro=what == "gyroscope").keyframes
    if what == "no array":
        vague = dataclasses.replace(keyframes.array, root=1e-3 * keyframes.array.root)
        keyframes = dataclasses.replace(keyframes, array=vague)
    found = calibrated(keyframes, solve_batch)
    assert (found.told == np.eye(15)).all()
    assert found.notes == ()
    assert_allclose(found.believed(found.solution).covariance, found.solution.covariance)


def test_velocities_and_biases_follow_rotations_in_the_directions_that_these_move_them():
    """What the intensity does to the whole covariance, by differences of two solutions."""
    case = turning(np.random.default_rng(0), span_s=40.0)
    found = calibrated(case.keyframes, solve_batch)
    share = 1 - (1 - np.diag(found.told)[0]) / _by_rotation(case.keyframes, found.solution)[0]
    before, after = (s.covariance[50:-50] for s in (found.solution, found.believed(found.solution)))
    slope = _slope(found.keyframes, found.solution)[50:-50]
    expected = (before - (1 - share) * slope)[:, VELOCITY, VELOCITY]
    ratio = np.linalg.solve(expected, after[:, VELOCITY, VELOCITY])
    assert_allclose(np.trace(ratio.mean(axis=0)) / 3, 1.0, atol=0.05)
    diagonal = np.einsum("nii->ni", after) / np.einsum("nii->ni", before)
    assert diagonal[:, VELOCITY].mean() < 0.97
    assert (np.linalg.eigvalsh(after) > 0).all()


def _slope(keyframes, solution):
    """Return dP/dlnS by a central difference, (n, 15, 15)."""
    names = ("R_nb", "p_n_m", "v_n_mps", "slot")
    there = dataclasses.replace(keyframes, **{name: getattr(solution, name) for name in names})
    n = len(keyframes.t_s)
    block = next(blocks_of(there, [0], n))
    more, less = (eliminated(block, f).marginals(0, n - 1).covariance for f in (1.05, 1 / 1.05))
    return (more - less) / (2 * np.log(1.05))


def _by_rotation(keyframes, solution):
    """Return the share of the variances of rotation that a random walk loses, (3,)."""
    slope = np.einsum("nii->ni", _slope(keyframes, solution))
    return (slope / np.einsum("nii->ni", solution.covariance))[50:-50, ROTATION].mean(axis=0)


def test_a_stated_intensity_is_believed():
    flight = flown("drawn", 0)
    stated = dataclasses.replace(BATCH, angular_acceleration_density=DRAWN_DENSITY)
    solution = solve_batch(collected_for(stated, flight).keyframes)
    covariance = solution.covariance[:, :3, :3]
    assert_allclose(stated(flight).attitude_covariance_rad2, covariance, rtol=1e-9)


def test_one_linearisation_at_the_minimum_has_the_covariance_of_the_search():
    keyframes = turning(np.random.default_rng(0), span_s=5.0).keyframes
    found = solve_batch(keyframes)
    names = ("R_nb", "p_n_m", "v_n_mps", "slot")
    there = dataclasses.replace(keyframes, **{name: getattr(found, name) for name in names})
    n = len(keyframes.t_s)
    chain = eliminated(next(blocks_of(there, [0], n)), 1.0)
    step, _ = chain.step(0, n - 1)
    sigma = np.sqrt(np.einsum("nii->ni", found.covariance))
    assert (np.abs(step) < 0.05 * sigma).all()
    assert_allclose(
        np.sqrt(np.einsum("nii->ni", chain.marginals(0, n - 1).covariance)), sigma, rtol=0.01
    )


def test_errors_of_a_known_walk_reach_the_posterior_bound():
    squares, bounds = [], []
    for seed in range(3):
        flight = flown("drawn", seed)
        collected = collected_for(BATCH, flight)
        bound = posterior_bound(flight, collected, np.full(3, DRAWN_DENSITY))
        told = posterior_bound(flight, collected)
        assert_allclose(np.trace(told.mean(axis=0)), np.trace(bound.mean(axis=0)), rtol=0.2)
        estimate = dataclasses.replace(BATCH, angular_acceleration_density=DRAWN_DENSITY)(flight)
        real = attitude_at(flight.truth, estimate.t_s)[0]
        error = rotations.log(rotations.transpose(estimate.R_nb) @ real)
        squares.append((error**2).mean(axis=0))
        bounds.append(np.einsum("nii->i", bound) / len(bound))
    ratio = np.sqrt(np.mean(squares, axis=0) / np.mean(bounds, axis=0))
    assert ((ratio > 0.75) & (ratio < 1.25)).all()


def test_a_posterior_bound_needs_the_truth():
    flight = flown("drawn", 0)
    collected = collected_for(BATCH, flight)
    with pytest.raises(NoSolutionError, match="a posterior bound needs its truth"):
        posterior_bound(dataclasses.replace(flight, truth=None), collected)
