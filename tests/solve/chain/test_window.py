import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.geometry.rotation_kernel import right_jacobian
from fgnav.geometry.rotations import exp
from fgnav.solve.chain.batch import solve_batch
from fgnav.solve.chain.window import ChainWindow, solve_fixed_lag, solve_forward
from tests.solve.chain.linear_flight import STEP_S, dense, random_problem

CASES = [(6, 0), (6, 2), (12, 3)]


def _axes(step):
    """From the tangent where a state is linearised to that where it is estimated."""
    T = np.eye(len(step))
    T[:3, :3], T[3:6, 3:6] = right_jacobian(step[:3]), exp(step[None, :3])[0].T
    return T


def _check(problem, solution, k, upto):
    """State k is that of the dense problem of the data of ``upto`` keyframes."""
    start, D = problem.start, problem.width
    H, g, _ = dense(problem, start, upto)
    P = np.linalg.inv(H)
    step = -P @ g
    b, own = len(start.constants), slice(k * D, k * D + D)
    expected = start.at([k]).moved(step[own][None], step[upto * D :])
    for got, want in zip(solution.states.at([k])[:4], expected[:4], strict=True):
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-8)
    T = _axes(step[own])
    expected = T @ P[own, own] @ T.T
    np.testing.assert_allclose(solution.covariance[k], expected, rtol=1e-6, atol=1e-9)
    constants = P[upto * D :, upto * D :]
    np.testing.assert_allclose(solution.constant_covariance[k], constants, rtol=1e-6, atol=1e-10)
    beside = T @ P[own, upto * D :]
    np.testing.assert_allclose(solution.constant_cross[k], beside, rtol=1e-6, atol=1e-9)
    assert solution.constant_cross[k].shape == (D, b)


@pytest.mark.parametrize(("aux", "b"), CASES)
def test_a_filtered_state_is_the_dense_one_of_the_data_by_then(aux, b):
    problem = random_problem(14, aux, b)
    solution = solve_forward(problem, 0.5, keep_linearisation=True)
    for k in range(14):
        _check(problem, solution, k, k + 1)


@pytest.mark.parametrize(("aux", "b"), CASES)
def test_a_smoothed_state_is_the_dense_one_of_the_data_up_to_its_block(aux, b):
    n, lag_s, per_block = 20, 1.75, round(1.0 / STEP_S)
    problem = random_problem(n, aux, b)
    solution = solve_fixed_lag(problem, lag_s, keep_linearisation=True)
    for k in range(n):
        block_end_s = max(np.ceil(k * STEP_S), 1.0)
        blocks = int(np.ceil(block_end_s + lag_s))
        _check(problem, solution, k, min(blocks * per_block + 1, n))


def test_departing_states_have_cross_covariances_of_the_dense_problem():
    problem = random_problem(10, 6, 2)
    window, D = ChainWindow(0.5, keep_linearisation=True), 15
    departed = [window.update(problem, row) for row in range(9)]
    part = departed[8]
    H, g, _ = dense(problem, problem.start, 9)
    P = np.linalg.inv(H)
    T = [_axes(step) for step in -(P @ g)[: 5 * D].reshape(5, D)]
    T.append(T[-1])  # of what follows the last nothing has departed
    assert part.t_s.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    for k, cross in enumerate((*part.solution.cross, part.cross_next)):
        expected = T[k] @ P[k * D : k * D + D, k * D + D : k * D + 2 * D] @ T[k + 1].T
        np.testing.assert_allclose(cross, expected, rtol=1e-6, atol=1e-9)


def test_relinearised_window_as_long_as_the_flight_is_the_batch():
    problem = random_problem(20, 12, 3, turn_rad=0.3)
    whole, window = solve_batch(problem), solve_fixed_lag(problem, 100.0)
    sigma = np.sqrt(np.einsum("nii->ni", whole.covariance))
    # Rotations may stay 0.01 rad from where they are linearised.
    apart = np.abs(window.states.p_n_m - whole.states.p_n_m)
    assert (apart < 0.02 * sigma[:, 3:6]).all()
    apart = np.abs(window.states.R_nb - whole.states.R_nb).max()
    assert apart < 0.02 * sigma[:, :3].min()
    assert window.converged


def test_relinearised_window_is_within_a_part_of_a_sigma_of_the_batch():
    problem = random_problem(60, 6, 2, turn_rad=0.3)
    whole, window = solve_batch(problem), solve_fixed_lag(problem, 3.0)
    sigma = np.sqrt(np.einsum("nii->ni", whole.covariance))
    assert (np.abs(window.states.p_n_m - whole.states.p_n_m) / sigma[:, 3:6]).max() < 0.3
    np.testing.assert_allclose(np.sqrt(np.einsum("nii->ni", window.covariance)), sigma, rtol=0.1)


def test_filter_ends_where_the_batch_does():
    problem = random_problem(20, 6, 2)
    whole, forward = solve_batch(problem), solve_forward(problem, 100.0)
    sigma = np.sqrt(np.diag(whole.covariance[-1]))
    assert (np.abs(forward.states.aux[-1] - whole.states.aux[-1]) < 0.02 * sigma[9:]).all()
    np.testing.assert_allclose(forward.covariance[-1], whole.covariance[-1], rtol=0.02, atol=1e-4)


def test_what_comes_later_changes_nothing_that_has_departed():
    long, short = random_problem(24, 6, 2), random_problem(24, 6, 2)
    for sensor in short.measurements:
        sensor.z[sensor.row > 12] += 7.0
    parts = []
    for problem in (long, short):
        window = ChainWindow(1.0)
        departed = [window.update(problem, row) for row in range(13)]
        parts.append([one for one in departed if one is not None])
    for one, two in zip(*parts, strict=True):
        assert np.array_equal(one.solution.states.p_n_m, two.solution.states.p_n_m)


def test_keyframes_may_come_from_problem_after_problem():
    n = 17
    whole, window = random_problem(n, 6, 2), ChainWindow(1.0)
    expected = solve_fixed_lag(whole, 1.0)
    parts = [window.update(random_problem(n, 6, 2), row) for row in range(n)]
    parts = [part for part in (*parts, window.rest()) if part is not None]
    p_n_m = np.concatenate([part.solution.states.p_n_m for part in parts])
    np.testing.assert_allclose(p_n_m, expected.states.p_n_m, rtol=0, atol=1e-12)


def test_a_measured_attitude_is_where_a_keyframe_starts():
    problem = random_problem(6, 6, 0)
    problem.attitude_known[:] = True
    problem.start.R_nb[3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    window = ChainWindow(10.0, 100.0)
    for row in range(4):
        window.update(problem, row)
    assert np.array_equal(window._linear.rows.R_nb[3], problem.start.R_nb[3])
    assert np.array_equal(window._linear.rows.R_nb[2], np.eye(3))


def test_window_names_the_state_that_is_open():
    problem = random_problem(12, 6, 0)
    for sensor in problem.measurements:
        sensor.H[sensor.row >= 5, :, 3:6] = 0.0
    motion = problem.motion
    motion.F[4:, :, 3:6] = motion.F[4:, 3:6] = 0.0
    motion.W[4:, :, 3:6] = motion.W[4:, 3:6] = 0.0
    with pytest.raises(NoSolutionError, match=r"position: the data do not determine it at 1\.25 s"):
        solve_fixed_lag(problem, 1.0)
