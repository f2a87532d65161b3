"""Rows without clocks: whatever is measured, they span what the clocks leave, and no more."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.assembly.position.whitening import by_clock, without_clocks


@pytest.mark.parametrize("groups", [([4, 4, 4],), ([2, 0, 2, 7, 0, 2], [0, 0]), ([3], [3])])
def test_combinations_are_white_and_span_all_but_the_clocks(groups):
    rng = np.random.default_rng(len(groups))
    order, clock = by_clock(*map(np.array, groups))
    n = len(order)
    assert sorted(order) == list(range(n))
    sigma, at = rng.uniform(0.1, 3.0, n), np.eye(clock[-1] + 1)[clock]
    combinations = without_clocks(clock, sigma, np.eye(n))
    assert combinations.shape == (n - at.shape[1], n)
    assert_allclose(combinations @ at, 0.0, atol=1e-12)
    white = combinations * sigma
    assert_allclose(white @ white.T, np.eye(len(white)), atol=1e-12)


def test_clocks_are_those_of_groups_of_one_kind():
    order, clock = by_clock(np.array([5, 1, 5]), np.array([5, 5]))
    assert [order.tolist(), clock.tolist()] == [[1, 0, 2, 3, 4], [0, 1, 1, 2, 2]]
    assert [len(part) for part in by_clock(np.array([], int), np.array([], int))] == [0, 0]
