"""The integer that the epochs of an arc agree on."""

import numpy as np
from numpy.testing import assert_array_equal

from fgnav.integers.arcs.consensus import arc_consensus


def link(cycles, *, arc=None, votes=None, causal=True):
    """Return what one link holds, each (n,)."""
    n = len(cycles)
    arc = np.zeros(n, dtype=int) if arc is None else np.asarray(arc)
    votes = np.ones(n) if votes is None else np.asarray(votes, dtype=float)
    parts = (part.reshape(n, 1, 1) for part in (arc, np.asarray(cycles), votes))
    return [part[:, 0, 0] for part in arc_consensus(*parts, causal=causal)]


def test_an_epoch_has_no_vote_on_itself():
    cycles, margin, agreed = link([7, 7, 7, 7, 7, 7, 3])
    assert_array_equal(margin, [0, 1, 2, 3, 4, 5, 6])
    assert_array_equal(agreed, [False] * 5 + [True] * 2)
    assert_array_equal(cycles[1:], 7)


def test_a_majority_is_that_of_counting():
    """Whatever the order: the integer of more than half of the votes wins."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        votes = rng.permutation(np.r_[np.full(11, 2), rng.integers(-3, 2, 9)])
        cycles, margin, _ = link([*votes, 0])
        assert cycles[-1] == 2
        assert margin[-1] >= 2


def test_the_most_votes_win_though_most_epochs_are_wrong():
    """Epochs with noisy code: nine of ten are wrong, each in its own way."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        wrong = rng.permutation(np.arange(1, 91))
        cycles, _, agreed = link([*rng.permutation(np.r_[wrong, np.zeros(10)]).astype(int), 0])
        assert cycles[-1] == 0
        assert agreed[-1]


def test_epochs_count_by_their_say():
    cycles, margin, agreed = link([1] * 20 + [2] * 3, votes=[0.25] * 20 + [1.0] * 3)
    np.testing.assert_allclose(margin[:21], 0.25 * np.arange(21))
    assert agreed[20]
    assert_array_equal(cycles[1:], 1)
    np.testing.assert_allclose(margin[21:], [4.0, 3.0])


def test_an_integer_is_displaced_by_as_many_votes_as_it_had():
    cycles, margin, agreed = link([1] * 6 + [2] * 13)
    assert_array_equal(cycles[6:12], 1)
    assert agreed[6:12].all()
    assert not agreed[12]
    assert margin[12] == 0
    assert_array_equal(cycles[13:], 2)
    assert_array_equal(agreed[13:], [False] * 4 + [True] * 2)


def test_twenty_epochs_displace_an_integer_however_old():
    """After a slip that nobody noticed the arc has the integer of before, but not for ever."""
    cycles, margin, _ = link([1] * 500 + [2] * 30)
    assert margin[:521].max() == 20
    assert_array_equal(cycles[1:521], 1)
    assert_array_equal(cycles[521:], 2)


def test_an_integer_lasts_as_long_as_its_arc_over_gaps():
    arc = np.array([4] * 6 + [-1] * 3 + [4] * 2 + [5] * 3)
    cycles, margin, agreed = link([9] * 14, arc=arc)
    assert agreed[9:11].all()
    assert not agreed[6:9].any()
    assert_array_equal(cycles[9:11], 9)
    assert_array_equal(margin[11:], [0, 1, 2])
    assert not agreed[11:].any()


def test_nothing_agreed_between_two_integers_and_more_votes_say_which():
    votes = [1] * 8 + [0] * 3 + [1] * 6
    cycles, margin, agreed = link([5] * 8 + [0] * 3 + [6] * 6, votes=votes, causal=False)
    assert not agreed[8:11].any()
    assert_array_equal(cycles[8:11], 5)
    assert_array_equal(margin[8:11], 8)


def test_later_epochs_say_it_of_earlier_ones_but_for_a_filter():
    votes = [0] * 4 + [1] * 6
    assert link([5] * 10, votes=votes, causal=False)[2][:4].all()
    assert not link([5] * 10, votes=votes)[2][:9].any()
