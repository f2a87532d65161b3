"""The integer that the epochs of an arc agree on."""

import numpy as np
from numpy.testing import assert_array_equal

from fgnav.integers.arcs.consensus import arc_consensus


def link(cycles, *, arc=None, votes=None, causal=True):
    """Return what one link has, each (n,)."""
    n = len(cycles)
    arc = np.zeros(n, dtype=int) if arc is None else np.asarray(arc)
    votes = np.ones(n) if votes is None else np.asarray(votes, dtype=float)
    parts = (part.reshape(n, 1, 1) for part in (arc, np.asarray(cycles), votes))
    return [part[:, 0, 0] for part in arc_consensus(*parts, causal=causal)]


def test_an_epoch_has_no_vote_on_itself_and_two_agree():
    cycles, agreed = link([7, 7, 7, 7, 7, 7, 3])
    assert_array_equal(agreed, [False] * 2 + [True] * 5)
    assert_array_equal(cycles[1:], 7)


def test_a_majority_is_that_of_counting():
    """Whatever the order: the integer of more than half of the votes wins."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        votes = rng.permutation(np.r_[np.full(11, 2), rng.integers(-3, 2, 9)])
        assert link([*votes, 0])[0][-1] == 2


def test_epochs_count_by_their_votes():
    cycles, agreed = link([1] * 9 + [2] * 4, votes=[0.25] * 9 + [1.0] * 4)
    assert_array_equal(agreed[:10], [False] * 8 + [True] * 2)
    assert_array_equal(cycles[1:12], 1)
    assert not agreed[-1]


def test_an_integer_is_displaced_by_as_many_votes_as_it_had():
    cycles, agreed = link([1] * 6 + [2] * 14)
    assert_array_equal(cycles[6:12], 1)
    assert agreed[6:12].all()
    assert not agreed[12]
    assert_array_equal(cycles[14:], 2)
    assert_array_equal(agreed[13:], [False] + [True] * 6)


def test_twenty_epochs_displace_an_integer_however_old():
    """After a slip that nobody noticed the arc has the integer of before, but not for ever."""
    cycles, _ = link([1] * 500 + [2] * 30)
    assert_array_equal(cycles[1:521], 1)
    assert_array_equal(cycles[522:], 2)


def test_an_integer_lasts_as_long_as_its_arc_over_gaps():
    arc = np.array([4] * 6 + [-1] * 3 + [4] * 2 + [5] * 3)
    cycles, agreed = link([9] * 14, arc=arc)
    assert agreed[9:11].all()
    assert not agreed[6:9].any()
    assert_array_equal(cycles[9:11], 9)
    assert_array_equal(agreed[11:], [False, False, True])


def test_between_two_integers_an_epoch_has_its_own_or_none():
    votes = [1] * 8 + [0] * 4 + [1] * 6
    cycles, agreed = link([5] * 8 + [0, 5, 6, 0] + [6] * 6, votes=votes, causal=False)
    assert_array_equal(agreed[8:12], [False, True, True, False])
    assert_array_equal(cycles[9:11], [5, 6])


def test_later_epochs_say_it_of_earlier_ones_but_for_a_filter():
    votes = [0] * 4 + [1] * 6
    assert link([5] * 10, votes=votes, causal=False)[1][:4].all()
    assert not link([5] * 10, votes=votes)[1][:6].any()
