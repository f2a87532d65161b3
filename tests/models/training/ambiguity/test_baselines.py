"""Figures by hand, and baselines that do what they say."""

import numpy as np
import pytest

from fgnav_models.training.ambiguity.baselines import figures, majority, of_baselines, same_time
from fgnav_models.training.ambiguity.data import Samples
from fgnav_models.training.ambiguity.failures import (
    LONGEST,
    conditional_percent,
    independent_joint_failures,
    joint_failures,
    run_lengths,
    shuffled_run_lengths,
)


def samples(cycles, t_s):
    cycles = np.array(cycles)
    n = len(cycles)
    return Samples(
        features=np.zeros((n, 1), dtype=np.float32),
        cycles=cycles,
        rounded=cycles + (np.arange(n) == 0)[:, None],
        is_present=np.ones(cycles.shape, dtype=bool),
        t_s=np.array(t_s, dtype=float),
        run=np.arange(n),
        first=np.arange(n),
        satellites=2,
    )


def test_figures_are_those_counted_by_hand():
    cycles = np.array([[0, 5], [2, 5], [-2, 5], [0, 5]])
    answer = np.array([[0, 5], [1, 5], [1, 5], [0, 7]])
    is_present = np.array([[True, True], [True, True], [True, True], [True, False]])
    got = figures(answer, cycles, is_present)
    np.testing.assert_allclose(got.accuracy_percent, [50.0, 100.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(got.mse_failed_cycles2, [5.0, np.nan], rtol=0, atol=1e-12)
    np.testing.assert_allclose(got.mse_failed_normalised, [5 / 16, np.nan], rtol=0, atol=1e-12)
    np.testing.assert_allclose(got.mse_total_cycles2, [2.5, 0.0], rtol=0, atol=1e-12)
    assert got.all_right_percent == 50.0
    plain = got.to_dict()
    assert plain["mse_failed_cycles2"] == [5.0, None]
    assert plain["mse_total_normalised"][1] is None  # a constant has no range


def test_the_majority_counts_only_what_is_there():
    cycles = np.array([[1, -3], [1, -3], [2, 0], [2, 0], [2, 0]])
    is_present = np.ones((5, 2), dtype=bool)
    is_present[2:, 1] = False
    np.testing.assert_array_equal(majority(cycles, is_present), [2, -3])


def test_the_leak_takes_the_nearest_time_of_training():
    data = samples([[10], [20], [30], [0], [0], [0]], [0.0, 100.0, 200.0, 40.0, 60.0, 999.0])
    got = same_time(data, np.array([2, 0, 1]), np.array([3, 4, 5]))
    np.testing.assert_array_equal(got[:, 0], [10, 20, 30])


def test_baselines_are_judged_on_the_test_rows_alone():
    data = samples([[4], [1], [1], [1]], [0.0, 1.0, 2.0, 3.0])
    got = of_baselines(data, np.array([1, 2]), np.array([0, 3]))
    assert got["majority"].accuracy_percent[0] == 50.0
    assert got["rounding"].accuracy_percent[0] == 50.0  # row 0 is made to round wrongly


def test_runs_of_failures_end_with_their_group():
    failed = np.array([[1, 0], [1, 0], [0, 0], [1, 1], [1, 1], [1, 0]], dtype=bool)
    one = run_lengths(failed, np.zeros(6, dtype=int))
    assert (one[1], one[2], one[3]) == (0, 2, 1)
    cut = run_lengths(failed, np.array([0, 0, 0, 0, 1, 1]))
    assert (cut[1], cut[2], cut[3]) == (3, 2, 0)
    assert run_lengths(np.ones((99, 1), dtype=bool), np.zeros(99, dtype=int))[LONGEST] == 1


def test_shuffles_keep_the_number_of_failures_and_break_the_runs():
    failed = np.zeros((2000, 4), dtype=bool)
    failed[100:140] = True
    group = np.zeros(2000, dtype=int)
    shuffled = shuffled_run_lengths(failed, group, 20, rng=np.random.default_rng(1))
    lengths = np.arange(LONGEST + 1)
    assert (lengths * shuffled).sum() == pytest.approx(160.0, rel=1e-12, abs=0)
    # Of 40 failures among 2000, 40 x 0.98² stand alone.
    assert shuffled[1] == pytest.approx(4 * 40 * 0.98**2, rel=0.05, abs=0)
    assert run_lengths(failed, group)[LONGEST] == 4


def test_failures_that_follow_failures_are_told_from_those_that_do_not():
    failed = np.tile(np.array([[True], [True], [False], [False]]), (50, 1))
    got = conditional_percent(failed, np.repeat([0, 1], 100))
    assert got["after_failure"] == pytest.approx(50.0, abs=1.0)
    # In each of two groups of 100, 24 of the 50 successes are followed by a failure, 25 by none.
    assert got["after_success"] == pytest.approx(100 * 24 / 49, rel=0, abs=1e-9)


def test_joint_failures_of_independent_networks_are_binomial():
    rng = np.random.default_rng(2)
    failed = rng.random((40_000, 5)) < 0.2
    expected = independent_joint_failures(failed)
    assert expected.sum() == pytest.approx(40_000, rel=1e-12, abs=0)
    counts = joint_failures(failed)
    np.testing.assert_allclose(counts, expected, rtol=0, atol=4 * np.sqrt(40_000 * 0.25))
    together = np.repeat(failed[:, :1], 5, axis=1)
    assert joint_failures(together)[5] > 10 * independent_joint_failures(together)[5]
