import dataclasses

import numpy as np
import pytest

from fgnav.methods.smoother.batch import _Search, solve_batch
from fgnav.methods.smoother.window import solve_window

from .flights import attitude_errors_rad, euler_rmse_deg, nees, turning


@pytest.fixture(scope="module")
def case():
    return turning(np.random.default_rng(0), span_s=40.0)


@pytest.fixture(scope="module")
def batch(case):
    return solve_batch(case.keyframes)


def test_batch_is_three_times_better_than_single_epochs_and_believable(case, batch):
    assert batch.converged
    single = euler_rmse_deg(case.keyframes.R_nb, case.truth)
    rmse = euler_rmse_deg(batch.R_nb, case.truth)
    assert (rmse < [0.30, 0.15, 0.08]).all()
    assert rmse[0] < single[0] / 2.5
    error = attitude_errors_rad(batch.R_nb, case.truth)
    assert 1.5 < nees(error, batch.covariance[:, :3, :3]).mean() < 4
    R_bn = batch.R_nb.swapaxes(1, 2)
    gap = np.einsum("nij,nj->ni", R_bn, case.truth.p_n_m - batch.p_n_m)
    # Positions of one flight share their error: this is a handful of independent samples.
    assert 0.3 < nees(gap, batch.covariance[:, 3:6, 3:6]).mean() < 8
    gap = case.truth.v_n_mps - batch.v_n_mps
    assert 1 < nees(gap, batch.velocity_covariance_m2ps2).mean() < 6


def test_window_reaches_the_batch(case):
    window = solve_window(case.keyframes, 2.0)
    assert window.converged
    error = attitude_errors_rad(window.R_nb, case.truth)
    assert 1.5 < nees(error, window.covariance[:, :3, :3]).mean() < 4
    squares = []
    for seed in range(3):  # of one flight alone the ratio is luck
        turn = turning(np.random.default_rng(seed), span_s=40.0)
        found = (solve_window(turn.keyframes, 2.0), solve_batch(turn.keyframes))
        squares.append([euler_rmse_deg(s.R_nb, turn.truth) ** 2 for s in found])
    rmse = np.sqrt(np.mean(squares, axis=0))
    assert (rmse[0] / rmse[1] < 1.04).all()


def test_a_window_longer_than_the_flight_is_the_batch(case, batch):
    window = solve_window(case.keyframes, 1000.0)
    assert np.abs(attitude_errors_rad(window.R_nb, batch)).max() < np.radians(0.02)
    sigmas = [np.sqrt(np.einsum("nii->ni", x.covariance[:, :6, :6])) for x in (window, batch)]
    np.testing.assert_allclose(*sigmas, rtol=0.01)


def test_with_a_gyroscope_the_same_path_is_more_accurate(case, batch):
    gyro = turning(np.random.default_rng(0), span_s=40.0, gyro=True)
    solution = solve_batch(gyro.keyframes)
    assert solution.converged
    assert (
        euler_rmse_deg(solution.R_nb, gyro.truth) < euler_rmse_deg(batch.R_nb, case.truth)
    ).all()
    assert np.abs(solution.slot[:, 3:]).max() < 0.02  # a bias, not a rate


def test_a_start_far_from_the_minimum_is_not_called_converged(case):
    turned = case.keyframes.R_nb @ np.diag([-1.0, -1.0, 1.0])
    lost = solve_batch(dataclasses.replace(case.keyframes, R_nb=turned))
    far = np.degrees(np.linalg.norm(attitude_errors_rad(lost.R_nb, case.truth), axis=1)).max()
    assert not lost.converged or far < 5


def test_a_search_that_stands_at_its_minimum_ends(case):
    search = _Search(case.keyframes)
    search.begin()
    assert search.descend()
    search._promised = 0.0  # rounding may leave a step nothing to promise
    assert search.descend()


def test_a_keyframe_without_phases_is_bridged(case):
    told = np.ones(len(case.keyframes.t_s), dtype=bool)
    told[100:120] = False
    preintegrate = dataclasses.replace(  # two seconds of a sine, not a tenth
        case.keyframes.preintegrate, angular_acceleration_density=np.full(3, 0.03)
    )
    gap = dataclasses.replace(
        case.keyframes,
        array=dataclasses.replace(case.keyframes.array, there=told),
        preintegrate=preintegrate,
    )
    for solution in (solve_batch(gap), solve_window(gap, 5.0)):
        sigma = np.sqrt(np.einsum("nii->ni", solution.covariance[:, :3, :3]))
        assert sigma[110, 0] > 1.5 * sigma[50, 0]
        error = attitude_errors_rad(solution.R_nb, case.truth)
        assert np.abs(error[100:120] / sigma[100:120]).max() < 5
