"""What arcs elect."""

import numpy as np

from fgnav.methods.smoother.votes import elected


def test_the_integer_with_most_votes_wins_and_of_equal_ones_the_largest():
    label, cycles = np.array([5, 2, 5, 2, 5, 2, 9, 9]), np.array([1, -3, 1, 7, 4, -3, 2, 6])
    labels, integers, votes = elected(label, cycles)
    assert labels.tolist() == [2, 5, 9]
    assert integers.tolist() == [-3, 1, 6]
    assert votes.tolist() == [2, 2, 1]


def test_no_votes_elect_nothing():
    none = np.zeros(0, dtype=np.int64)
    assert [len(part) for part in elected(none, none)] == [0, 0, 0]
